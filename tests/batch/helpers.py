"""Probes in a folder, and workers of this process, for tests of batches."""

import json
from concurrent.futures import BrokenExecutor, Future
from importlib import import_module

import OpenEXR

from shrm_cli.batch.entry import Entry, checked
from shrm_cli.batch.job import by_probe
from shrm_cli.batch.run import run as run_chunks
from shrm_cli.batch.work import Terms
from tests.cli.helpers import noise, write_exr


def write_probes(folder, count, height=16):
    """Write probes that all differ, and return their names."""
    folder.mkdir(parents=True, exist_ok=True)
    for k in range(count):
        write_exr(folder / f"p{k}.exr", noise(height, 2 * height) + k)
    return [str(folder / f"p{k}.exr") for k in range(count)]


class Here:
    """Workers that do each task when it is handed out, in this process."""

    workers = 2

    def __init__(self):
        self.tasks = []
        self.renewed = 0

    def submit(self, function, *arguments):
        self.tasks.append(arguments[0])
        future = Future()
        try:
            future.set_result(function(*arguments))
        except BrokenExecutor as error:
            future.set_exception(error)
        return future

    def is_lost(self, error):
        return isinstance(error, BrokenExecutor)

    def renew(self):
        self.renewed += 1


def work_here(monkeypatch):
    """Have `shrm batch` work in this process, which takes no time to start."""

    class Pool(Here):
        def __init__(self, count):
            super().__init__()

        def stop(self, at_once=False):
            pass

    monkeypatch.setattr(import_module("shrm_cli.batch.batch"), "ProcessWorkers", Pool)
    monkeypatch.setattr("shrm_cli.cli.batch.limit_libraries", lambda count: None)


def edit(path):
    """Change a map as an image editor does, which keeps the attributes that it does not know."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        parts = file.parts
        for plane in parts[0].channels.values():
            plane.pixels *= 0.5
        with OpenEXR.File(parts) as edited:
            edited.write(str(path))


def forget(path):
    """Make a map one of an earlier version, which recorded less."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        parts = file.parts
        for part in parts:
            for name in ("shrm:digest", "shrm:sources"):
                part.header.pop(name, None)
            options = json.loads(part.header["shrm:options"])
            part.header["shrm:options"] = json.dumps({"reading": options["reading"]})
        with OpenEXR.File(parts) as old:
            old.write(str(path))


def results_of(entry, workers=None, **terms):
    """Run an entry in this process, and return the results in the order of their probes."""
    found = []
    chunks = by_probe(checked(entry.jobs()))
    run_chunks(chunks, workers or Here(), Terms(**terms), found.append)
    return sorted(found, key=lambda each: each.probe)


def records_of(entry, **options):
    """Run an entry in this process, and return the records of its jobs."""
    return [record for result in results_of(entry, **options) for record in result.records]


def statuses(records):
    """Return what became of each output."""
    return {record["output"]: record["status"] for record in records}


def log_lines(path):
    """Return the records of a log that are of jobs."""
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    return [line for line in lines if "output" in line]


__all__ = ["Entry", "Here", "log_lines", "records_of", "results_of", "statuses", "write_probes"]
