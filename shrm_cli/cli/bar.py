"""The bar by which scripts and notebooks show how far work is; `terminal` has that of commands."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from shrm_cli.progress import Progress, using


def bar_options(label: str) -> dict[str, Any]:
    """Return how tqdm draws a bar: without counts, whose units mean nothing to a reader."""
    shown = "{l_bar}{bar}| {elapsed}<{remaining}"
    # Reports come unevenly: the mean rate tells best how much time is left.
    evenly = {"smoothing": 0, "miniters": 0}
    return {"desc": label, "total": 1, "bar_format": shown, "leave": False, **evenly}


@contextmanager
def progress_bar(label: str = "") -> Iterator[Progress]:
    """Show how far work is: a bar of the notebook that it runs in, or else on stderr.

    Parameters
    ----------
    label : str
        What stands before the bar.

    Yields
    ------
    callable
        It takes the work done and the work in all, as arguments called ``progress`` do. What asks
        for no such argument, as `split_lamps`, tells it by itself.

    Examples
    --------
    >>> with shrm.progress_bar("lacquer") as progress:
    ...     made = shrm.prefilter("probes/studio.exr", "phong", to="shrm", progress=progress)
    >>> made.representation
    'shrm'
    """
    from tqdm.auto import tqdm

    with tqdm(**bar_options(label)) as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        with using(show):
            yield show
