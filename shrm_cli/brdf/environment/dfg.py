"""`dfg`: the environment-BRDF table of a kind, or of a BRDF."""

from typing import cast

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, value_text
from shrm_cli.brdf.environment import environment_brdf as tables
from shrm_cli.brdf.environment.environment_brdf import brushed_table
from shrm_cli.brdf.environment.file import MEANINGS, Kind, Meaning
from shrm_cli.brdf.environment.lobe import check_varies
from shrm_cli.brdf.environment.material_albedo import albedo_table
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.spec import AnyBrdf, as_brdf
from shrm_cli.errors import ArgumentError
from shrm_cli.messages import whole_number
from shrm_cli.records import record

_OF_BRDFS = ("albedo", "brushed")
"""The kinds that are of a BRDF which is named."""


@record(eq=False)
class EnvironmentTable:
    """What a BRDF of each roughness reflects of a uniform environment."""

    texels: Array
    """Indexed [perceptual roughness, N.V, channel]; the channels are those of `meaning`, shape (N,
    N, channels)."""
    kind: Kind
    """One of `shrm_cli.brdf.environment.file.MEANINGS`."""
    brdf: str = "ggx"
    """The specification of the BRDF without its roughness."""

    @property
    def meaning(self) -> Meaning:
        """What the channels hold."""
        return MEANINGS[self.kind]

    @property
    def white_furnace(self) -> Array:
        """What a white metal reflects in a white furnace by single scattering, shape (N, N)."""
        if self.kind == "moments":
            return self.texels[..., 0]
        if self.kind == "albedo":
            return self.texels.max(axis=-1)
        if self.kind in ("multiscatter", "filament"):
            return self.texels[..., 1]
        return self.texels[..., :2].sum(axis=-1)


def dfg(
    brdf: AnyBrdf | None = None, *, kind: str | None = None, size: int = 128
) -> EnvironmentTable:
    """Make the table that goes with split sums or SH exponentials.

    Parameters
    ----------
    brdf : Brdf, str or path-like, optional
        A BRDF with a roughness, whose directional albedo is tabulated; of brushed GGX it is scale
        and bias. By default the table is that of GGX.
    kind : str, optional
        What the table of GGX holds: ``scale-bias``, the default, ``multiscatter``, ``moments``,
        ``fdez-aguera``, ``turquin``, ``gltf`` or ``filament``.
    size : int
        Texels along both edges.

    Returns
    -------
    EnvironmentTable

    Raises
    ------
    BrdfError
        If the BRDF cannot be read, or does not vary with a roughness.
    ArgumentError
        If there is no such kind, or a BRDF besides.

    Examples
    --------
    >>> table = shrm.dfg(size=8)
    >>> table.texels.shape, table.meaning.channels
    ((8, 8, 2), 'R = scale, G = bias')
    """
    size = whole_number("size", size, 2, 1024)
    if kind is not None and (brdf is not None or kind not in MEANINGS or kind in _OF_BRDFS):
        known = ", ".join(each for each in MEANINGS if each not in _OF_BRDFS)
        raise ArgumentError("kind", f"is {kind}; tables of GGX without `brdf` are of {known}")
    if brdf is not None:
        material = as_brdf(brdf)
        own = kind_of(material)
        if own == "brushed":
            return EnvironmentTable(brushed_table(cast(Ggx, material), size), own, _named(material))
        check_varies(material)
        return EnvironmentTable(albedo_table(material, size), own, _named(material))
    if kind == "moments":
        return EnvironmentTable(tables.moments_table(size), kind)
    if kind in (None, "scale-bias", "multiscatter"):
        texels = tables.environment_table(size, kind == "multiscatter")
    else:
        texels = tables.columns_table(kind, size)
    return EnvironmentTable(texels, kind or "scale-bias")


def kind_of(material: Brdf) -> Kind:
    """Return the kind of the table of a BRDF."""
    return "brushed" if isinstance(material, Ggx) and not material.isotropic else "albedo"


def _named(material: Brdf) -> str:
    """Return the specification of a BRDF without its roughness, which varies."""
    values = [
        f"{key}={value_text(value)}"
        for key, value in material.values.items()
        if key not in material.roughness_names
    ]
    return f"{material.name}:{','.join(values)}" if values else material.name
