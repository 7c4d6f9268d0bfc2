"""Conversion of reflectance spectra to linear sRGB."""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.brdf.base import Array
from shrm_cli.errors import BrdfError


def to_linear_srgb(wavelengths_nm: ArrayLike, values: ArrayLike) -> Array:
    """Convert reflectance spectra to linear sRGB, as the CIE 1931 2-degree observer under D65.

    A spectrum is linear between the given wavelengths, and constant beyond them. A reflectance of
    1 gives (1, 1, 1). Spectra outside of sRGB's gamut give negative channels, which are kept, so
    that the conversion is linear.

    Parameters
    ----------
    wavelengths_nm : array_like, shape (n,)
        The wavelengths in nanometers, in any order.
    values : array_like, shape (..., n)
        The reflectance or BRDF (1/sr) at these wavelengths; float32 stays float32.

    Returns
    -------
    ndarray, shape (..., 3)

    Raises
    ------
    BrdfError
        If wavelengths are not positive and different, or colour-science is not installed.

    References
    ----------
    CIE 015:2018, section 7.1; IEC 61966-2-1. The tables are colour-science's: the observer in
    steps of 1 nm from 360 to 830 nm.
    """
    wavelengths = np.asarray(wavelengths_nm, dtype=float)
    values = np.asarray(values)
    if not np.issubdtype(values.dtype, np.floating):
        values = values.astype(float)
    if wavelengths.ndim != 1 or values.shape[-1:] != wavelengths.shape:
        raise ValueError(f"spectra of shape {values.shape} at {wavelengths.shape} wavelengths")
    if not (len(wavelengths) and np.isfinite(wavelengths).all() and (wavelengths > 0).all()):
        raise BrdfError("wavelengths must be positive numbers of nanometres")
    order = np.argsort(wavelengths)
    wavelengths = wavelengths[order]
    if (np.diff(wavelengths) <= 0).any():
        raise BrdfError("two samples of a spectrum have the same wavelength")
    weights = np.empty((len(wavelengths), 3))
    weights[order] = _weights(tuple(wavelengths))
    return values @ weights.astype(values.dtype)


@lru_cache(maxsize=16)
def _weights(wavelengths: tuple[float, ...]) -> Array:
    """Linear sRGB of the hat function about each wavelength, shape (n, 3); they increase."""
    at, seen = _observed_light()
    left = np.searchsorted(wavelengths, at, side="right") - 1
    known = np.asarray(wavelengths)
    low, high = np.clip(left, 0, len(known) - 1), np.clip(left + 1, 0, len(known) - 1)
    width = np.where(high > low, known[high] - known[low], 1.0)
    share = np.clip((at - known[low]) / width, 0.0, 1.0)[:, None]
    weights = np.zeros((len(known), 3))
    np.add.at(weights, low, seen * (1 - share))
    np.add.at(weights, high, seen * share)
    return weights


@lru_cache(maxsize=1)
def _observed_light() -> tuple[Array, Array]:
    """Wavelengths in nm, shape (n,), and what reflectance 1 there adds to linear sRGB, (n, 3)."""
    try:
        with np.printoptions():  # the import changes numpy's, and this restores them
            import colour
    except ImportError as error:
        raise BrdfError(
            "spectra need the package colour-science; pip install 'shrm[measured]'"
        ) from error
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    daylight = colour.SDS_ILLUMINANTS["D65"]
    at = np.asarray(observer.wavelengths, dtype=float)
    light = np.interp(at, daylight.wavelengths, daylight.values)
    seen = observer.values * light[:, None] @ colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB.T
    return at, seen / seen.sum(axis=0)
