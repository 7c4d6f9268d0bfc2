"""Files of goniometer samples of any isotropic BRDF about a normal, at directions as Cornell's."""

import numpy as np

from shrm_cli.brdf.measured.reading.spectrum import to_linear_srgb
from shrm_cli.sphere.directions import from_angles

_WAVELENGTHS = np.arange(400, 701, 10)


def write_goniometer(path, brdf, incidences=8, rings=10):
    """Write a BRDF at `incidences` angles of the light and on half of `rings` rings of the viewer.

    The light is at equal steps between the normal and the horizon, by default 10, 20 .. 80 degrees.
    The rings are at equal distances on the equal-area disk. Colors become spectra of three blocks
    of equal height.
    """
    theta_s = [0.0] + [
        2 * np.arcsin(k / rings / np.sqrt(2)) for k in range(1, rings) for _ in range(4 * k + 1)
    ]
    phi_s = [0.0] + [-np.pi * j / (4 * k) for k in range(1, rings) for j in range(4 * k + 1)]
    theta_i = np.linspace(0, np.pi / 2, incidences + 2)[1:-1]
    angles = np.array([(t, 0.0, *s) for t in theta_i for s in zip(theta_s, phi_s, strict=True)])
    light = from_angles(angles[:, 0], angles[:, 1])
    colors = np.asarray(brdf.evaluate(light, from_angles(angles[:, 2], angles[:, 3])))
    if brdf.includes_cosine:
        colors = colors / light[:, 2:]
    blocks = np.stack([_WAVELENGTHS >= 600, abs(_WAVELENGTHS - 545) < 50, _WAVELENGTHS < 500])
    spectra = colors @ np.linalg.inv(to_linear_srgb(_WAVELENGTHS, blocks.astype(float))) @ blocks
    with open(path, "w", encoding="ascii") as stream:
        stream.write(f"# num wls\n{len(_WAVELENGTHS)}\n\n# wls\n")
        stream.write(" ".join(map(str, _WAVELENGTHS)) + "\n\n")
        stream.write("# theta i, phi i, theta s, phi_s, spectral sample values\n\n")
        np.savetxt(stream, np.column_stack([angles, spectra]), fmt="%.9g")
