"""USD: a panorama, which lies as ours do, and a layer with a dome light of it."""

from shrm_cli.arrays import Array
from shrm_cli.export.engine import Light, Package, PanoramaEngine
from shrm_cli.export.latlong import add_exr
from shrm_cli.export.quoting import word
from shrm_cli.lights.light_files import usd_layer
from shrm_cli.vocabulary import LAMP_COUNT


class Usd(PanoramaEngine):
    """Stages of USD, for Houdini, Omniverse and other renderers."""

    name = "usd"
    title = "USD"
    lamps = LAMP_COUNT

    def add_panorama(self, made: Package, image: Array, light: Light) -> None:
        name, layer = f"{light.name}_dome.exr", f"{light.name}.usda"
        if "@" in name or not name.isprintable():
            name = "dome.exr"  # USD has no way to write such names
        add_exr(made, name, image, light, "auto")
        made.add_text(layer, usd_layer("Dome", name, light.discs))
        lamps = ", and a DistantLight for each lamp" if light.discs else ""
        made.told.append(f"a DomeLight_1 whose pole is +Y{lamps}")
        made.loading.append(f"# usdview {word(layer)}, or a sublayer of your stage")
