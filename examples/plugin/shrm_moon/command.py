"""``shrm mean probe.exr``."""

import click


@click.command()
@click.argument("probe", type=click.Path())
def mean(probe: str) -> None:
    """Print the mean radiance of a probe."""
    import numpy as np  # here, so that `shrm --help` stays fast

    import shrm_cli as shrm

    constant = shrm.project(shrm.open_probe(probe), order=0).coefficients[0]
    click.echo(" ".join(f"{value:.6g}" for value in constant / np.sqrt(4 * np.pi)))
