"""Kautz and McCool's 3D texture, which depends on the view by its angle from the center only."""

from typing import Any

import numpy as np

from shrm_cli.arrays import Array, Indices
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.sphere.directions import from_angles
from shrm_cli.sphere.quadrature import colatitude_weights


class KautzMcCool(ExplicitMap):
    """Slices ``B(alpha, beta, theta_o)`` of the part of the light without azimuth, q = 0.

    The slice with index k of T belongs to the angle ``theta_o = pi k / (T - 1)`` between the view
    and the central direction, so that both ends of the range are slices.

    References: Kautz and McCool 2000, Approximation of glossy reflection with prefiltered
    environment maps: the BRDF is approximated by ``u(theta_i', theta_o')``. The slices are those of
    eq. 5.25 of chapter 5 of Ramamoorthi's thesis.
    """

    representation = "kautz-mccool"
    frame = "local"

    @classmethod
    def image_count(cls, view_count: int) -> int:
        return view_count

    @classmethod
    def view_angles(cls, count: int) -> Array:
        """Return the angles theta_o of the slices, radians, shape (count,).

        The angle of a single slice does not matter, and is 0.
        """
        return np.linspace(0.0, np.pi, count) if count > 1 else np.zeros(1)

    @classmethod
    def part_names(cls, count: int) -> list[str]:
        return [f"slice{k:02d}" for k in range(count)]

    @classmethod
    def view_attributes(cls, count: int) -> list[dict[str, Any]]:
        return [{"shrm:theta_o": float(theta)} for theta in cls.view_angles(count)]

    @classmethod
    def view_count(cls, slices: int | None = None, views: int | None = None) -> int | None:
        super().view_count(views=views)
        return slices

    @classmethod
    def sample_views(cls, count: int) -> Array:
        return from_angles(cls.view_angles(count), 0.0)

    @classmethod
    def view_weights(cls, count: int) -> Array:
        if count == 1:
            return np.full(1, 4 * np.pi)
        return 2 * np.pi * colatitude_weights(count, "border")

    @classmethod
    def basis(cls, order_p: int, count: int) -> Array:
        zonal = [q == 0 for p in range(order_p + 1) for q in range(-p, p + 1)]
        return super().basis(order_p, count) * np.array(zonal)

    @classmethod
    def blend(cls, centers: Array, views: Array, count: int) -> tuple[Indices, Array]:
        """Return the slices on both sides of the view's angle, and their linear weights."""
        sine = np.linalg.norm(np.cross(centers, views), axis=-1)
        theta = np.arctan2(sine, np.sum(centers * views, axis=-1))
        position = theta * ((count - 1) / np.pi)
        first = np.clip(np.floor(position).astype(np.intp), 0, max(count - 2, 0))
        rest = position - first
        indices = np.stack([first, np.minimum(first + 1, count - 1)], axis=-1)
        return indices, np.stack([1 - rest, rest], axis=-1)
