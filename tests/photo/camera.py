"""A camera: what it photographs of a mirror ball, and the numbers that it makes of light.

Nothing here shares code with the package: rays are sent from the camera and reflected.
"""

import numpy as np
import OpenImageIO as oiio


def direction(azimuth, elevation=0.0):
    azimuth, elevation = np.radians([azimuth, elevation])
    flat = np.cos(elevation)
    return np.array([flat * np.sin(azimuth), np.sin(elevation), flat * np.cos(azimuth)])


def photograph(radiance, view, size, distance=np.inf, fine=3):
    """Photograph a mirror ball, of radius 1, that fills the picture.

    Parameters
    ----------
    radiance : callable
        From directions, (n, 3), to radiance, (n, 3).
    view : ndarray, shape (3,)
        Towards the camera.
    """
    right = np.cross([0.0, 1.0, 0.0], view)
    right /= np.linalg.norm(right)
    up = np.cross(view, right)
    steps = (np.arange(size * fine) + 0.5) / (size * fine) * 2 - 1
    x, y = (each[..., None] for each in np.meshgrid(steps, -steps))
    if np.isinf(distance):
        origin, ray = x * right + y * up + 2 * view, np.broadcast_to(-view, (*x.shape[:2], 3))
    else:
        ray = (x * right + y * up) / np.sqrt(distance**2 - 1) - view
        ray = ray / np.linalg.norm(ray, axis=-1, keepdims=True)
        origin = np.broadcast_to(view * distance, ray.shape)
    along = np.sum(origin * ray, axis=-1)
    root = along**2 - np.sum(origin**2, axis=-1) + 1
    normal = origin + (-along - np.sqrt(np.maximum(root, 0)))[..., None] * ray
    mirrored = ray - 2 * np.sum(ray * normal, axis=-1, keepdims=True) * normal
    seen = np.zeros((*root.shape, 3))
    seen[root > 0] = radiance(mirrored[root > 0])
    return seen.reshape(size, fine, size, fine, 3).mean(axis=(1, 3)).astype(np.float32)


def srgb(light):
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def contrasty(light):
    """An s over sRGB's curve, as cameras have it."""
    half = srgb(light)
    return (half + half**2 * (3 - 2 * half)) / 2


def write_exposure(path, light, time, curve, seed, bits=8, aperture=8.0, sensitivity=100, stuck=0):
    """Write what a camera makes of light, with noise of a 255th, and Exif.

    No number is less than those in `stuck`, whatever the light is.
    """
    numbers = np.maximum(curve(np.clip(light * time * sensitivity / aperture**2, 0, 1)), stuck)
    numbers = numbers + np.random.default_rng(seed).normal(size=light.shape) / 255
    most = 2**bits - 1
    pixels = np.clip(np.rint(numbers * most), 0, most).astype(f"uint{bits}")
    spec = oiio.ImageSpec(light.shape[1], light.shape[0], 3, f"uint{bits}")
    spec.attribute("ExposureTime", float(time))
    spec.attribute("FNumber", aperture)
    spec.attribute("Exif:PhotographicSensitivity", sensitivity)
    target = oiio.ImageOutput.create(str(path))
    assert target.open(str(path), spec)
    assert target.write_image(np.ascontiguousarray(pixels))
    target.close()
