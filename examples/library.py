"""From an array of pixels to maps, their errors and a picture, by the library alone.

Read it from top to bottom, or run it: python examples/library.py [FOLDER]
"""

# %% A probe: a dim sky, a darker ground, and a lamp.
import sys
from pathlib import Path

import numpy as np

import shrm_cli as shrm

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
pixels = np.full((64, 128, 3), (0.3, 0.4, 0.6), dtype=np.float32)
pixels[32:] = (0.15, 0.12, 0.1)
pixels[12:18, 30:42] = 12.0
probe = shrm.Probe.from_array(pixels, layout="latlong", name="lamp")

# %% A glossy map, to a tolerance: the library chooses the orders and says what they cost.
glossy = shrm.prefilter(probe, "microfacet:sigma=0.3", eps=0.03)
info = glossy.info
print(f"F = {info.order_f}, P = {info.order_p}, {info.predicted_error:.2%} RMS error predicted")

# %% What it reflects of 200 random pairs of a normal and a view, beside the brute-force integral.
random = np.random.default_rng(1)
normals, views = random.normal(size=(2, 200, 3))
normals /= np.linalg.norm(normals, axis=1, keepdims=True)
views /= np.linalg.norm(views, axis=1, keepdims=True)
seen = np.sum(normals * views, axis=1) > 0.05
normals, views = normals[seen], views[seen]
exact = shrm.reference(probe, "microfacet:sigma=0.3", normals, views)
error = np.sqrt(np.mean((glossy.radiance(normals, views) - exact) ** 2) / np.mean(exact**2))
print(f"measured over {len(normals)} visible pairs: {error:.2%}")

# %% The same light for engines: a split sum, shown as gold, and nine irradiance coefficients.
chain = shrm.prefilter(probe, to="splitsum", levels=[0.25, 0.5, 1.0])
gold = chain.shaded(roughness=0.4, f0=(1.0, 0.78, 0.34))
diffuse = shrm.prefilter(probe, to="irradiance", window="auto")
print("gold, seen from the front:", gold.radiance([0.0, 0.0, 1.0], [0.0, 0.0, 1.0]).round(3))
print("irradiance of an upward normal:", diffuse.irradiance([0.0, 1.0, 0.0]).round(3))

# %% Files: every map is written whole, and read back as it was.
for name, made in {"glossy": glossy, "chain": chain, "diffuse": diffuse}.items():
    path = folder / f"lamp.{name}.exr"
    made.save(path)
    assert shrm.open_map(path).representation == made.representation
    print(f"{path}: {path.stat().st_size:,} bytes")
