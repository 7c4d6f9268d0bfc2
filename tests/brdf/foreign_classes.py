"""Classes as users write them, most of them with a mistake; named by this file, and as objects."""

import sys

import numpy as np

from shrm_cli import Brdf, Parameter

ROUGHNESS = Parameter("roughness", 0.5, 0.0, 1.0, "width")


def colored(value):
    return np.repeat(value[..., None], 3, axis=-1)


def halfway(light, view):
    half = light + view
    return half / np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-6)


class Blinn(Brdf):
    """A sound lobe about the half vector, of whatever precision it gets."""

    parameters = (ROUGHNESS,)

    def evaluate(self, light, view):
        power = 2 / max(self.number("roughness") ** 4, 1e-6)
        shape = np.clip(halfway(light, view)[..., 2], 0, 1) ** power
        return colored(np.where(light[..., 2] > 0, (power + 2) / (8 * np.pi) * shape, 0))


class Tinted(Blinn):
    """The same in part."""

    parameters = (ROUGHNESS, Parameter("part", 1.0, 0.0, 1.0, "of the light"))

    def evaluate(self, light, view):
        return super().evaluate(light, view) * self.number("part")


class Brushed(Brdf):
    """A lobe that is wider along x, and does not say so."""

    parameters = (Parameter("along", 0.1, 0.001, 1.0), Parameter("across", 0.05, 0.001, 1.0))

    def evaluate(self, light, view):
        x, y, z = np.moveaxis(halfway(light, view), -1, 0)
        steep = (x / self.number("along")) ** 2 + (y / self.number("across")) ** 2
        return colored(np.where(light[..., 2] > 0, np.exp(-steep / np.maximum(z, 1e-3) ** 2), 0))


class Told(Brushed):
    """The same, told."""

    isotropic = False


class Lit(Brdf):
    """Brighter where the light is towards x."""

    center = "normal"

    def evaluate(self, light, view):
        return np.where(light[..., 2:] > 0, 0.3 * (1 + light[..., :1]), 0) * np.ones_like(view)


class Cosine(Brdf):
    """Phong's lobe of the mirror direction, which has no horizon."""

    includes_cosine = True
    has_horizon = False
    zonal = True
    power = 20.0

    def evaluate(self, light, view):
        mirrored = light[..., 2] * view[..., 2]
        mirrored = mirrored - light[..., 0] * view[..., 0] - light[..., 1] * view[..., 1]
        return colored(np.maximum(mirrored, 0) ** self.power)


class InFloats(Cosine):
    """The same in single precision, which is not much for a lobe so sharp, whatever it gets."""

    power = 1e5

    def evaluate(self, light, view):
        found = super().evaluate(light.astype(np.float32), view.astype(np.float32))
        return found.astype(light.dtype)


class CutCosine(Cosine):
    """The same, cut at the horizon, so that it depends on the view."""

    has_horizon = True


class ZonalNormal(Brdf):
    """White and diffuse."""

    center = "normal"
    zonal = True

    def evaluate(self, light, view):
        return colored(np.full(np.broadcast_shapes(light.shape, view.shape)[:-1], 0.3))


class ZonalMinnaert(ZonalNormal):
    """It depends on the view."""

    def evaluate(self, light, view):
        return colored(np.abs(light[..., 2] * view[..., 2]) ** 0.5)


class ZonalBlinn(Blinn):
    """A lobe about the half vector is none about the mirror direction."""

    zonal = True


class NoNumber(Brdf):
    """Never a number."""

    parameters = (ROUGHNESS,)

    def evaluate(self, light, view):
        return colored(np.full(np.broadcast_shapes(light.shape, view.shape)[:-1], np.nan))


class Band(Brdf):
    """No number for the light of a narrow band."""

    center = "normal"
    parameters = (ROUGHNESS,)

    def evaluate(self, light, view):
        z = light[..., 2] + 0 * view[..., 2]
        return colored(np.where((z > 0.7) & (z < 0.7005), np.nan, np.where(z > 0, 0.3, 0)))


class AtZero(Blinn):
    """No number where its roughness is least."""

    def evaluate(self, light, view):
        return super().evaluate(light, view) * (np.nan if self.number("roughness") < 0.1 else 1)


class Negative(Brdf):
    """Less than nothing."""

    parameters = (ROUGHNESS,)

    def evaluate(self, light, view):
        return colored(np.full(np.broadcast_shapes(light.shape, view.shape)[:-1], -1.0))


class NegativeRed(Brdf):
    """Less than nothing in one channel."""

    center = "normal"
    parameters = (ROUGHNESS,)

    def evaluate(self, light, view):
        return np.where(light[..., 2:] > 0, np.array([-0.125, 0.1, 0.2]), 0) * np.ones_like(view)


class NegativeRough(Blinn):
    """Less than nothing where it is rougher than by default."""

    def evaluate(self, light, view):
        return super().evaluate(light, view) * (-1 if self.number("roughness") > 0.6 else 1)


class NoChannels(Brdf):
    """One number for each pair."""

    def evaluate(self, light, view):
        return light[..., 2] * view[..., 2]


class Scalar(Brdf):
    """One number."""

    def evaluate(self, light, view):
        return 0.3


class NoSuper(Brdf):
    """Without what a Brdf has."""

    def __init__(self):
        pass

    def evaluate(self, light, view):
        return light * view


class Divides(Blinn):
    """It cannot be made of the roughness 0."""

    def __init__(self, **values):
        super().__init__(**values)
        self.inverse = 1 / self.number("roughness")


class Exits(Brdf):
    """It ends the program."""

    def evaluate(self, light, view):
        sys.exit()


class ExitsLater(Blinn):
    """It ends the program where it is asked for many pairs."""

    def evaluate(self, light, view):
        value = super().evaluate(light, view)
        if value.size > 2000:
            sys.exit("too many")
        return value


class Writes(Brdf):
    """It writes into what it gets."""

    center = "normal"

    def evaluate(self, light, view):
        light[..., 2] = np.maximum(light[..., 2], 0)
        return np.broadcast_to(light[..., 2:], np.broadcast_shapes(light.shape, view.shape)) * 0.3
