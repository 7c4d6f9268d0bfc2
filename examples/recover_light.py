"""Light and roughness found from eight pictures of a shiny object, by gradients.

python examples/recover_light.py [PROBE] [MESH] [FOLDER]

The pictures are drawn by the numpy code from a probe. The search knows them, the mesh, the cameras
and the reflectance; it starts at a grey light and a roughness of 0.7. It needs PyTorch, and for a
mesh trimesh and embreex. Without a mesh the object is a sphere.
"""

# %% What is known: the camera's views of the object, and one more that judges the result.
import sys
from pathlib import Path

import numpy as np

import shrm_cli as shrm

try:
    from shrm_cli import torch as shrm_torch
except ImportError as error:
    sys.exit(f"Error: {error}")
import torch

from shrm_cli.files.png import encode_srgb, write_png
from shrm_cli.geometry.load import load_mesh
from shrm_cli.geometry.rays import Rays
from shrm_cli.render.camera import Lens, Viewer, aimed, sphere_normals
from shrm_cli.render.image import expose, suitable_exposure
from shrm_cli.sphere.directions import normalize
from shrm_cli.sphere.grid.latlong import latlong_directions

# The arrays are small: on a machine that is busy a second thread makes it take ten times as long.
torch.set_num_threads(1)
ROOT = Path(__file__).resolve().parents[1]
SIZE, ROUGHNESS, F0 = 56, 0.4, (0.06, 0.06, 0.06)
ORDER, WHOLE, HEIGHT, STEPS = 28, 24, 32, 600
VIEWERS = [Viewer(45 * k, (-25, 10, 40)[k % 3]) for k in range(8)] + [Viewer(20, 25)]

given = sys.argv[1:]
try:
    probe = shrm.open_probe(given[0] if given else ROOT / "probes" / "studio.exr")
    mesh = load_mesh(given[1]) if len(given) > 1 else None
except shrm.ShrmError as error:
    sys.exit(f"Error: {error}")
folder = Path(given[2] if len(given) > 2 else ".")
y, x = np.mgrid[SIZE / 2 - 0.5 : -SIZE / 2 : -1, -SIZE / 2 + 0.5 : SIZE / 2]


def seen(viewer):
    """Return which pixels show the object, and their normals and views."""
    if mesh is None:
        u, v = x / (0.48 * SIZE), y / (0.48 * SIZE)
        shown = np.hypot(u, v) < 0.99
        normals = sphere_normals(viewer, u[shown], v[shown])
        return shown, normals, np.broadcast_to(viewer.direction, normals.shape)
    lens = Lens(SIZE, SIZE)
    aim = aimed(mesh.vertices, VIEWERS, lens)
    directions = lens.directions(viewer, x, y)
    faces, corners, _ = rays.first_hits(aim.eye(viewer), directions.reshape(-1, 3))
    normals = normalize(mesh.interpolated(mesh.normals, np.maximum(faces, 0), corners))
    views = -directions.reshape(-1, 3)
    shown = (faces >= 0) & (np.sum(normals * views, axis=1) > 0.1)
    return shown.reshape(SIZE, SIZE), normals[shown], views[shown]


rays = None if mesh is None else Rays(mesh)
shown, normals, views = (list(each) for each in zip(*map(seen, VIEWERS), strict=True))

# %% The pictures, which know nothing of PyTorch, and the modules that will explain them.
surface = shrm.prefilter(probe, to="splitsum", levels=[ROUGHNESS, 1.0]).shaded(ROUGHNESS, F0)
pictures = [surface.radiance(*each) for each in zip(normals, views, strict=True)]
known = np.concatenate(pictures[:-1])
scale = float(known.mean())
target = torch.tensor(known / scale, dtype=torch.float32)
f0 = torch.tensor(F0)
mean = target.mean(dim=0) / f0.mean() / 2
draw = shrm_torch.SplitSumRadiance(
    ORDER, np.concatenate(normals[:-1]), np.concatenate(views[:-1]), WHOLE
).float()
light_of = shrm_torch.LatLongProjection(ORDER, HEIGHT).float()

# %% The search: the logarithm of each pixel, because light is not negative, and the roughness.
pixels = (torch.ones(HEIGHT, 2 * HEIGHT, 3) * mean.log()).requires_grad_()
logit = torch.tensor(float(np.log(0.7 / 0.3)), requires_grad=True)
optimizer = torch.optim.Adam([{"params": [pixels], "lr": 0.25}, {"params": [logit], "lr": 0.02}])
schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, STEPS, eta_min=1e-3)
for step in range(STEPS):
    optimizer.zero_grad()
    drawn = draw(light_of(pixels.exp()), torch.sigmoid(logit), f0)
    loss = torch.mean((drawn - target) ** 2 / (target + 0.05) ** 2)
    loss.backward()
    optimizer.step()
    schedule.step()
    if step % 100 == 0 or step == STEPS - 1:
        print(f"step {step}: loss {loss.item():.2e}, roughness {torch.sigmoid(logit).item():.3f}")

# %% What was found: a view that was not known, and the light as far as the surface shows it.
found = (light_of(pixels.exp()) * scale).detach().numpy()
roughness = torch.sigmoid(logit.detach())
judge = shrm_torch.SplitSumRadiance(ORDER, normals[-1], views[-1], WHOLE).float()
again = (judge(torch.from_numpy(found), roughness, f0)).numpy()
directions = latlong_directions(2 * SIZE, SIZE)
show = shrm_torch.DirectionSynthesis(ORDER, directions)
seen_by = shrm_torch.GgxMultipliers(ORDER, WHOLE)(torch.tensor([ROUGHNESS]).double())[0]
lights = [
    show(torch.as_tensor(each, dtype=torch.float64), seen_by).numpy()
    for each in (shrm.project(probe, ORDER).coefficients, found)
]


def psnr(truth, other, exposure):
    """Return the ratio of peak to error of both as displays show them, in decibels."""
    one, two = (encode_srgb(expose(each, exposure)) / 255 for each in (truth, other))
    return -10 * np.log10(np.mean((one - two) ** 2))


def on_black(values):
    """Return the picture of the view that judges."""
    picture = np.zeros((SIZE, SIZE, 3))
    picture[shown[-1]] = values
    return picture


exposure = suitable_exposure(lights[0].mean(axis=-1))
shiny = suitable_exposure(pictures[-1].mean(axis=-1))
print(f"roughness {roughness.item():.3f} for {ROUGHNESS}")
print(f"PSNR of a new view {psnr(pictures[-1], again, shiny):.1f} dB", end=", ")
print(f"of the light at that roughness {psnr(*lights, exposure):.1f} dB")
rows = [
    np.concatenate([expose(light, exposure), expose(on_black(view), shiny)], axis=1)
    for light, view in zip(lights, (pictures[-1], again), strict=True)
]
write_png(folder / "recovered.png", encode_srgb(np.concatenate(rows)))
