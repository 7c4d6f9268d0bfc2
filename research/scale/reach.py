"""How much of the cost model is measured: everything, or a short form that takes seconds."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Reach:
    """Which cases are timed.

    Attributes
    ----------
    rows : tuple of int
        The heights of the probes.
    probe_orders : tuple of int
        Orders F of the SHRMs that are made of each of them, beside the default.
    form_rows : int
        The height of the one that all forms are made of, and that the whole process reads.
    forms : tuple of (str, str or None)
        Forms and their BRDFs.
    orders_f, orders_p, sizes : tuple of int
        F, P and S of the sweep.
    most_values : int
        The most values in a map of it.
    repeats : int
        How often each case is timed; a third as often in the sweep, which has many.
    tasks : int
        The probes of a batch that the scheduler hands out.
    groups : tuple of int
        How many of them a task has.
    workers : tuple of int
        How many workers the scheduler has.
    processes : int
        How often whole processes are timed.
    """

    rows: tuple[int, ...] = (128, 256, 512, 1024, 2048)
    probe_orders: tuple[int, ...] = (8, 64)
    form_rows: int = 512
    forms: tuple[tuple[str, str | None], ...] = (
        ("shrm", "microfacet:sigma=0.2"), ("shrm", "microfacet:sigma=0.1"),
        ("shrm", "phong:exponent=32"), ("principal", "microfacet:sigma=0.2"),
        ("cabral", "phong:exponent=16"), ("irradiance", None), ("splitsum", None), ("she", None),
    )  # fmt: skip
    orders_f: tuple[int, ...] = (8, 16, 32, 64, 128)
    orders_p: tuple[int, ...] = (0, 1, 2, 4, 8)
    sizes: tuple[int, ...] = (16, 32, 64, 128, 256)
    most_values: int = 2**24
    repeats: int = 7
    tasks: int = 100_000
    groups: tuple[int, ...] = (1, 10, 100)
    workers: tuple[int, ...] = (16, 200)
    processes: int = 15


FULL = Reach()
SHORT = Reach(
    rows=(16, 32),
    probe_orders=(4, 8),
    form_rows=32,
    forms=(("shrm", "microfacet:sigma=0.5"), ("irradiance", None)),
    orders_f=(4, 8),
    orders_p=(0, 1),
    sizes=(8, 16),
    repeats=1,
    tasks=10,
    groups=(1, 10),
    workers=(2,),
    processes=1,
)
