"""Conversion of reflectance spectra to linear sRGB."""

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.errors import BrdfError

# The package colour-science has these numbers too, but importing it takes longer than all that is
# done with a measured file. The tests compare them.
_TABLE = Path(__file__).with_name("cie_1931_d65.csv")
_XYZ_TO_SRGB = ((3.2406, -1.5372, -0.4986), (-0.9689, 1.8758, 0.0415), (0.0557, -0.2040, 1.0570))


def to_linear_srgb(wavelengths_nm: ArrayLike, values: ArrayLike) -> Array:
    """Convert reflectance spectra to linear sRGB, as the CIE 1931 2-degree observer under D65.

    A spectrum is linear between the given wavelengths, and constant beyond them. A reflectance of
    1 gives (1, 1, 1). Spectra outside of sRGB's gamut give negative channels, which are kept, so
    that the conversion is linear.

    `wavelengths_nm`, of shape (n,), holds the wavelengths in nanometers, in any order. `values`, of
    shape (..., n), are the reflectance or BRDF (1/sr) at these wavelengths; float32 stays float32.

    Returns an array of shape (..., 3).

    References: CIE 015:2018, section 7.1 (the sums); ISO/CIE 11664-1 and 11664-2 (the observer in
    steps of 1 nm from 360 to 830 nm, and D65 in steps of 5 nm, linear between them and constant
    beyond 780 nm); IEC 61966-2-1, section 5.2 (the matrix).
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
    at, *observer, daylight = np.loadtxt(_TABLE, delimiter=",", unpack=True)
    seen = np.stack(observer, axis=-1) * daylight[:, None] @ np.transpose(_XYZ_TO_SRGB)
    return at, seen / seen.sum(axis=0)
