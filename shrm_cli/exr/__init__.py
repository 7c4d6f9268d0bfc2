"""Map <-> EXR file: the only place that knows channel names and attributes."""

from shrm_cli.exr.image import probe_attributes, write_image, write_images
from shrm_cli.exr.read import is_map, read_map
from shrm_cli.exr.write import write_map

__all__ = [
    "is_map",
    "probe_attributes",
    "read_map",
    "write_image",
    "write_images",
    "write_map",
]
