"""What a batch takes on many cores, and what limits it, from what one map was measured to take."""

from dataclasses import dataclass

from research.scale.parts import Measured

_READING = "read", "hash"
_PACKING = "encode", "write"


@dataclass(frozen=True)
class Load:
    """What one probe and one map of it take.

    Attributes
    ----------
    label : str
    reading, mathematics, packing : float
        Processor seconds.
    read, written : int
        Bytes.
    """

    label: str
    reading: float
    mathematics: float
    packing: float
    read: int
    written: int

    @classmethod
    def of(cls, found: Measured) -> "Load":
        reading = sum(found.seconds[part] for part in _READING)
        packing = sum(found.seconds[part] for part in _PACKING)
        mathematics = found.total - reading - packing
        return cls(found.label, reading, mathematics, packing, found.read, found.written)

    @property
    def seconds(self) -> float:
        return self.reading + self.mathematics + self.packing

    @property
    def bytes(self) -> int:
        return self.read + self.written


@dataclass(frozen=True)
class Farm:
    """What a batch runs on.

    Attributes
    ----------
    cores : int
    disk : float
        Bytes a second that the disk gives to all cores together.
    task : float
        Seconds of the scheduler for each task; 0 for a pool on one machine.
    group : int
        Probes of a task.
    """

    cores: int
    disk: float
    task: float
    group: int


@dataclass(frozen=True)
class Forecast:
    """How long a batch takes.

    Attributes
    ----------
    seconds : float
    limit : str
        What takes that long: ``disk``, ``scheduler``, or that of ``reading``, ``mathematics`` and
        ``packing`` that keeps the cores busy for longest.
    """

    seconds: float
    limit: str


def forecast(load: Load, probes: int, farm: Farm) -> Forecast:
    """Tell how long a batch takes whose cores, disk and scheduler all work at the same time.

    Parameters
    ----------
    load : Load
    probes : int
    farm : Farm
    """
    busy = {name: getattr(load, name) for name in ("reading", "mathematics", "packing")}
    cores = max(busy, key=lambda name: busy[name])
    limits = {
        cores: probes * load.seconds / farm.cores,
        "disk": probes * load.bytes / farm.disk,
        "scheduler": -(-probes // farm.group) * farm.task,
    }
    limit = max(limits, key=lambda name: limits[name])
    return Forecast(limits[limit], limit)


def cores_of_disk(load: Load, disk: float) -> float:
    """Return the number of cores beyond which the disk is the limit."""
    return load.seconds * disk / load.bytes


def cores_of_scheduler(seconds: float, task: float) -> float:
    """Return the number of cores beyond which the scheduler is the limit.

    Parameters
    ----------
    seconds : float
        What a task takes.
    task : float
        What the scheduler takes for it.
    """
    return seconds / task


def task_seconds(cores: int, task: float, share: float) -> float:
    """Return how long tasks must take so that the scheduler is busy for a share of the time.

    Parameters
    ----------
    cores : int
    task : float
        Seconds of the scheduler for each task.
    share : float
        In (0, 1].
    """
    return cores * task / share
