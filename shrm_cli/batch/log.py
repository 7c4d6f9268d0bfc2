"""The log of a batch, a line of JSON for each job, and the totals of a run."""

import json
import os
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from shrm_cli import __version__
from shrm_cli.batch.made import NOT_THERE
from shrm_cli.batch.work import Record, Result
from shrm_cli.errors import OutputError
from shrm_cli.messages import shown_values

_BEGINNING = b'{"time": "'
"""How the first line of a log begins."""
_MOST_REASONS = 100
"""The most reasons that are counted; they name options, which could all differ."""
_MOST_FAILURES = 1000
"""The most failures that the totals name; the log has all of them."""


@dataclass
class Totals:
    """What has become of the jobs of a run so far."""

    jobs: int
    """All that are to be done."""
    made: int = 0
    skipped: int = 0
    failed: int = 0
    waiting: int = 0
    """`made`, `skipped`, `failed` and `waiting`: waiting are those of a run that only looks."""
    warned: int = 0
    """Outputs that have warnings."""
    bytes: int = 0
    """The size of the outputs that were made."""
    failures: list[Record] = field(default_factory=list)
    """The first records of what failed."""
    anew: Counter[str] = field(default_factory=Counter)
    """How many outputs that were there are made anew, or would be, for each reason."""

    @property
    def done(self) -> int:
        """Jobs of which is known what has become of them."""
        return self.made + self.skipped + self.failed + self.waiting

    def add(self, record: Record) -> None:
        """Count a record."""
        status = record["status"]
        setattr(self, status, getattr(self, status) + 1)
        self.bytes += record.get("bytes", 0)
        self.warned += bool(record.get("warnings"))
        why = record.get("why", NOT_THERE)
        if why != NOT_THERE and (why in self.anew or len(self.anew) < _MOST_REASONS):
            self.anew[why] += 1
        if status == "failed" and len(self.failures) < _MOST_FAILURES:
            self.failures.append(record)

    def add_result(self, result: Result) -> None:
        """Count the records of a probe, and the failure to gather its coefficients."""
        for record in result.records:
            self.add(record)
        if result.error and not result.records:
            self.jobs += 1
            self.add({"status": "failed", "probe": result.probe, "error": result.error})

    def as_json(self) -> dict[str, Any]:
        """Return the totals by the names used in JSON."""
        names = ("jobs", "made", "skipped", "failed", "waiting", "warned", "bytes")
        numbers = {name: getattr(self, name) for name in names}
        return {**numbers, "not_done": self.jobs - self.done, "anew": dict(self.anew)}


Log = Callable[[Record], None]
"""Appends a line of JSON for a record, with the time, to a file; readers find whole lines."""


@contextmanager
def opened_log(path: str | os.PathLike[str], jobs: int) -> Iterator[Log]:
    """Append to a log, which is made if there is none."""
    try:
        if os.path.exists(path) and not os.path.isfile(path):
            raise OutputError(f"{path}: not a regular file; name another `log`")
        if os.path.exists(path) and not _is_log(path):
            raise OutputError(f"{path}: exists, and is no log of a batch; name another `log`")
        with open(path, "a", encoding="utf-8", errors="backslashreplace") as stream:
            if _lacks_line_end(path):
                stream.write("\n")

            def write(record: Record) -> None:
                now = datetime.now(UTC).isoformat(timespec="milliseconds")
                stream.write(json.dumps(shown_values({"time": now, **record})) + "\n")
                stream.flush()

            write({"status": "begun", "jobs": jobs, "shrm": __version__})
            yield write
    except OSError as error:
        raise OutputError(
            f"{path}: cannot be written ({error.strerror}); make room or name another `log`"
        ) from error


def _is_log(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins as logs do, as far as it goes."""
    with open(path, "rb") as stream:
        return _BEGINNING.startswith(stream.read(len(_BEGINNING)))


def _lacks_line_end(path: str | os.PathLike[str]) -> bool:
    """Whether a file ends in the middle of a line, as after a run that was killed."""
    with open(path, "rb") as stream:
        if stream.seek(0, os.SEEK_END) == 0:
            return False
        stream.seek(-1, os.SEEK_END)
        return stream.read(1) != b"\n"
