"""What `shrm` is told of ambient cubes; it is read for ``--help``, and so imports no numpy."""

from shrm_cli.maps.options import SHADER, Option, Representation

AMBIENT_CUBE = Representation(
    "ambient-cube",
    "ambient cube",
    frozenset(),
    (
        Option(
            "fit",
            "ambient-cube: irradiance along the axes, or the colors of the least error.  "
            "[default: axes]",
            "choice",
            choices=("axes", "least"),
            default="axes",
            converts=True,
        ),
        SHADER,
    ),
    is_offered=True,
    why_no_brdf="an ambient cube is of a white Lambertian surface",
    home="shrm_moon.ambient_cube",
)
