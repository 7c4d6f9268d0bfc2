"""Light through rough glass, in the forms that hold reflection: a lobe about the refracted ray.

shrm prefilter probe.exr --brdf examples/rough_glass.py:RoughGlass:roughness=0.4 --to principal

Forms expand a lobe about the mirror direction of the view, and here it is to lie about the
refracted direction T. So this BRDF has the lobe in the mirror's place, and the map is looked up
with a normal and a view whose mirror direction is T, `through(normals, views, ior)`:

    found = shrm.open_map("probe.RoughGlass-roughness-0.4.principal.exr")
    light = found.radiance(*through(normals, views, 1.5))

In GLSL, for a normal n, the view v and the index 1.5:

    vec3 t = refract(-v, n, 1.0 / 1.5);
    float c = dot(n, v);
    vec3 across = normalize(v - dot(v, t) * t);
    vec3 view = (2.0 * c * c - 1.0) * t + 2.0 * c * sqrt(1.0 - c * c) * across;
    vec3 light = shrm_radiance(normalize(t + view), view);
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli import Brdf, Parameter

Array = NDArray[np.floating]


class RoughGlass(Brdf):
    """What a rough surface of glass lets through from behind, as by Walter et al. 2007, eq. 21.

    Light comes from all around in the glass, as if it had entered from the probe without a turn:
    what the far side of an object does is left out.
    """

    name = "rough-glass"
    summary = "light refracted by a rough surface, in the place of the mirror's"
    source = "Walter et al. 2007, eq. 21; G: Smith's, of light and view apart"
    parameters = (
        Parameter("roughness", 0.4, 0.05, 1.0, "the root of GGX's alpha"),
        Parameter("ior", 1.5, 1.05, 3.0, "of the glass"),
    )
    includes_cosine = True
    has_horizon = False

    def evaluate(self, light: Array, view: Array) -> Array:
        """Return the lobe, for light that is as far from the mirror direction as from T."""
        cosine = view[..., 2]
        sine = np.maximum(np.hypot(view[..., 0], view[..., 1]), 1e-6)
        # A view along the normal has any azimuth; 0 is taken.
        east = np.where(sine > 1e-6, view[..., 0] / sine, 1.0)
        north = np.where(sine > 1e-6, view[..., 1] / sine, 0.0)
        x, y, z = np.broadcast_arrays(*np.moveaxis(light, -1, 0), cosine)[:3]
        # Light in the frame of the mirror direction, whose x axis points to the view.
        along = east * x + north * y
        ahead = cosine * along + sine * z
        aside = east * y - north * x
        near = cosine * z - sine * along
        # The same numbers in the frame of T, which is (-s, 0, -c) for a view of azimuth 0.
        s = sine / self.number("ior")
        c = np.sqrt(1 - s**2)
        turned = np.stack([c * ahead - s * near, -aside, -s * ahead - c * near], axis=-1)
        zero = np.zeros_like(sine)
        value = self._transmitted(turned, np.stack([sine, zero, cosine], axis=-1))
        return np.broadcast_to(value.astype(light.dtype)[..., None], (*value.shape, 3))

    def _transmitted(self, light: Array, view: Array) -> Array:
        """The BTDF times the cosine of light from below, for a view above."""
        n, a2 = self.number("ior"), self.number("roughness") ** 4
        half = -(n * light + view)
        half = half / np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-6)
        lit, seen = (np.sum(each * half, axis=-1) for each in (light, view))
        up = half[..., 2]
        distribution = 1 / (np.pi * a2 * ((1 - up**2) / a2 + up**2) ** 2)
        masking = 1.0
        for z in (np.abs(light[..., 2]), np.maximum(view[..., 2], 1e-4)):
            masking = masking * 2 * z / (z + np.sqrt(a2 + (1 - a2) * z**2))
        here = np.clip(seen, 0, 1)
        there = np.sqrt(1 - (1 - here**2) / n**2)
        across = (here - n * there) / (here + n * there)
        along = (n * here - there) / (n * here + there)
        passed = 1 - (across**2 + along**2) / 2
        area = n**2 * np.abs(lit) * here / np.maximum((n * lit + seen) ** 2, 1e-6)
        value = passed * masking * distribution * area / np.maximum(view[..., 2], 1e-4)
        return np.where((up > 0) & (lit < 0) & (seen > 0) & (light[..., 2] < 0), value, 0.0)


def through(normals: Array, views: Array, ior: float) -> tuple[Array, Array]:
    """The normals and views with which a map of `RoughGlass` is looked up, shape (..., 3)."""
    cosine = np.sum(normals * views, axis=-1, keepdims=True)
    refracted = (cosine / ior - np.sqrt(1 - (1 - cosine**2) / ior**2)) * normals - views / ior
    across = views - np.sum(views * refracted, axis=-1, keepdims=True) * refracted
    across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-12)
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    view = (2 * cosine**2 - 1) * refracted + 2 * cosine * sine * across
    middle = refracted + view
    return middle / np.linalg.norm(middle, axis=-1, keepdims=True), view
