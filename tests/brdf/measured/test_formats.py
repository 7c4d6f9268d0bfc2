"""One BRDF in every measured format: it prefilters to the same map, within each resolution."""

import numpy as np
import pytest

from shrm_cli.brdf.measured.merl import write_merl
from shrm_cli.brdf.measured.table import sample_table, write_table
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.maps.request import Request
from shrm_cli.maps.shrm.make import prefilter_shrm
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.open import open_probe
from tests.brdf.measured.goniometer_files import write_goniometer
from tests.cli.helpers import write_exr
from tests.maps.shrm.test_predicted_error import reduced

SPEC = "ggx:roughness=0.63,f0=0.9/0.6/0.3"


def write(path, brdf):
    if path.suffix == ".binary":
        write_merl(path, brdf)
    elif path.suffix == ".brdf":
        write_goniometer(path, brdf)
    else:
        write_table(path, sample_table(brdf))


@pytest.mark.parametrize(
    ("suffix", "bound"), [(".binary", 2e-3), (".exr", 2e-3), (".npz", 2e-3), (".brdf", 0.05)]
)
def test_the_same_map(real_probes, tmp_path, suffix, bound):
    """Relative RMS over texels and views.

    A goniometer ends at 80 degrees: beyond, where this lobe is at its brightest, is a guess.
    """
    pixels = reduced(real_probes / "interior.exr").astype(np.float32)
    probe = open_probe(write_exr(tmp_path / "probe.exr", pixels))
    brdf = parse_spec(SPEC)
    write(tmp_path / f"ggx{suffix}", brdf)
    stored = parse_spec(str(tmp_path / f"ggx{suffix}"))
    orders = {"order_f": 12, "order_p": 4, "size": 24}
    one, other = (
        prefilter_shrm(Projection(probe), Request("shrm", each, 0.2, **orders)).map
        for each in (brdf, stored)
    )
    difference = np.sum((one.coefficients - other.coefficients) ** 2)
    error = np.sqrt(difference / np.sum(one.coefficients**2))
    print(f"{suffix}: {error:.4f}")
    assert error < bound
    assert other.info.brdf["parameters"]["file"] == f"ggx{suffix}"
