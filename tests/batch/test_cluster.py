"""A cluster of two workers on this machine, as dask starts it."""

import asyncio
import contextlib
import json
import operator
import os
import signal
import socket
import ssl
import subprocess
import sys
import time
from concurrent.futures import wait
from importlib.util import find_spec

import numpy as np
import pytest

from shrm_cli.batch import cluster
from shrm_cli.batch.cluster import cluster_executor
from shrm_cli.errors import ClusterError

pytestmark = [
    pytest.mark.skipif(find_spec("distributed") is None, reason="distributed is not installed"),
    pytest.mark.filterwarnings("ignore"),  # of dask's own, which are none of ours
]


@pytest.fixture(scope="module")
def two():
    """Return two workers of a scheduler that gives a task up when its second worker dies."""
    dask = pytest.importorskip("dask")
    import distributed  # noqa: F401  (adds its settings, which would go with ours at the end)

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        cluster_executor("local", 2) as workers,
    ):
        yield workers


def die_first(marker):
    """End the worker at once the first time, and return a number the second time."""
    if not os.path.exists(marker):
        with open(marker, "x"):
            os.kill(os.getpid(), signal.SIGKILL)
    return 42


def die(_=None):
    os.kill(os.getpid(), signal.SIGKILL)


def threads(_=None):
    """Return the threads of each library with a pool, after a product of matrices."""
    from threadpoolctl import threadpool_info

    a = np.ones((500, 500))
    assert (a @ a)[0, 0] == 500
    return [pool["num_threads"] for pool in threadpool_info()], os.environ["OPENIMAGEIO_THREADS"]


@pytest.mark.slow
def test_results_and_exceptions_come_back(two):
    assert two.workers == 2
    futures = [two.submit(operator.mul, 6, each) for each in range(200)]
    assert [future.result(60) for future in futures] == list(range(0, 1200, 6))
    failed = two.submit(operator.truediv, 1, 0)
    assert isinstance(failed.exception(60), ZeroDivisionError)
    assert not two.is_lost(failed.exception())


@pytest.mark.slow
def test_workers_are_processes_with_one_thread(two):
    found = [two.submit(threads, each) for each in range(8)]
    for future in found:
        pools, images = future.result(60)
        assert pools, "numpy has a library with a pool"
        assert set(pools) == {1}
        assert images == "1"
    processes = {future.result(60) for future in [two.submit(os.getpid) for _ in range(50)]}
    assert os.getpid() not in processes
    assert 1 <= len(processes) <= 2


@pytest.mark.slow
def test_a_killed_worker_loses_nothing(two, tmp_path, capfd):
    others = [two.submit(operator.add, 1, each) for each in range(50)]
    dying = two.submit(die_first, str(tmp_path / "died"))
    others += [two.submit(operator.add, 1, each) for each in range(50, 100)]
    assert dying.result(60) == 42
    assert (tmp_path / "died").exists()
    assert [future.result(60) for future in others] == list(range(1, 101))
    # New workers are limited too.
    assert set(two.submit(threads).result(60)[0]) == {1}
    assert capfd.readouterr().err == ""


@pytest.mark.slow
def test_a_worker_that_dies_after_its_result_has_come_loses_nothing(two, monkeypatch):
    """Dask's own executor made an error of the result, as the state of its task was not known."""
    from distributed import Client

    gather = Client._gather

    async def gathered_before_a_death(self, futures, *given, **named):
        results = await gather(self, futures, *given, **named)
        for future in futures:
            future._state.lose()
        return results

    monkeypatch.setattr(Client, "_gather", gathered_before_a_death)
    assert two.submit(operator.add, 1, 1).result(60) == 2


@pytest.mark.slow
def test_a_cancelled_future_cancels_its_task(two, tmp_path):
    waiting = [two.submit(time.sleep, 0.3) for _ in range(4)]
    last = two.submit(os.mkdir, str(tmp_path / "done"))
    assert last.cancel()
    assert last.cancelled()
    assert not wait(waiting, 30).not_done
    assert two.submit(operator.add, 1, 2).result(60) == 3
    assert not (tmp_path / "done").exists()


@pytest.mark.proof
@pytest.mark.slow
def test_a_task_that_always_kills_its_worker_is_told_as_lost(two, capfd):
    fatal = two.submit(die)
    assert two.is_lost(fatal.exception(120))
    assert two.submit(operator.add, 1, 1).result(60) == 2
    assert capfd.readouterr().err == ""


@pytest.mark.slow
def test_an_existing_cluster_is_used_and_refused_for_other_versions(monkeypatch):
    from distributed import LocalCluster

    with (
        cluster._quiet(),
        LocalCluster(
            n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
        ) as existing,
    ):
        address = existing.scheduler_address
        with cluster_executor(address) as workers:
            assert workers.workers == 1
            assert workers.submit(operator.add, 1, 1).result(60) == 2
            assert set(workers.submit(threads).result(60)[0]) == {1}
            waiting = [workers.submit(time.sleep, 0.5) for _ in range(3)]
        assert not wait(waiting, 30).not_done
        assert all(future.cancelled() for future in waiting)  # with the end of the block
        monkeypatch.setattr(cluster, "__version__", "9.9")
        with (
            pytest.raises(ClusterError, match=rf"{address}: its worker tcp.* has shrm .* 9\.9;"),
            cluster_executor(address),
        ):
            pass
        monkeypatch.setattr(cluster.pkgutil, "resolve_name", cluster.pkgutil.get_data)
        with pytest.raises(ClusterError, match=r"has no shrm \("), cluster_executor(address):
            pass


def listening(process):
    """Return the addresses at which a process and its children listen."""
    return {
        connection.laddr
        for each in (process, *process.children(recursive=True))
        for connection in each.net_connections("inet")
        if connection.status == "LISTEN"
    }


def answered(place, context):
    """Return what a server answers to something that is told to it in TLS."""
    with (
        socket.create_connection(tuple(place), timeout=10) as plain,
        context.wrap_socket(plain) as secret,
    ):
        secret.sendall(b"x" * 64)
        return secret.recv(10)


@pytest.mark.slow
def test_nobody_without_the_certificate_reaches_a_local_cluster(two):
    """Every port, of the scheduler, of the workers and of what watches them."""
    from distributed import Security
    from distributed.comm import connect

    own = two.client
    address = own.scheduler.address
    assert address.startswith("tls://127.0.0.1:")

    async def asked(at, security):  # as a client does first; whole ones hang where they fail
        talk = await connect(at, timeout=5, **security.get_connection_args("client"))
        await talk.write({"op": "identity"})
        return await talk.read()

    assert "workers" in asyncio.run(asked(address, own.security))
    with cluster._quiet():
        for security in (Security(), Security.temporary()):
            for form in (address, address.replace("tls:", "tcp:")):
                with pytest.raises((OSError, TypeError, RuntimeError)):
                    asyncio.run(asked(form, security))
    psutil = pytest.importorskip("psutil")
    two.submit(abs, -1).result(60)
    ports = listening(psutil.Process())
    assert len(ports) >= 3
    assert int(address.rpartition(":")[2]) in {each.port for each in ports}
    assert {each.ip for each in ports} == {"127.0.0.1"}
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    for place in ports:  # no page of a dashboard's answers, and nobody answers without certificate
        with socket.create_connection(tuple(place), timeout=10) as plain:
            plain.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
            with contextlib.suppress(ConnectionResetError):
                assert b"HTTP" not in plain.recv(100)
        with pytest.raises((ssl.SSLError, ConnectionResetError)):
            answered(place, context)


def test_a_missing_package_for_certificates_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "cryptography", None)
    with (
        pytest.raises(ClusterError, match=r"certificates need the package cryptography; pip in"),
        cluster_executor("local", 1),
    ):
        pass


LEFT = """
import os, signal, sys, time
from shrm_cli.batch.cluster import ClusterError, cluster_executor
if __name__ == "__main__":
    with cluster_executor(sys.argv[1]) as workers:
        print(workers.submit(abs, -3).result(60), flush=True)
        waiting = workers.submit(time.sleep, 60)
        os.kill(int(sys.argv[2]), signal.SIGKILL)
        waiting.result(60)
"""


@pytest.mark.proof
@pytest.mark.slow
def test_a_scheduler_that_goes_away_is_told_in_one_line(tmp_path):
    script, address = tmp_path / "run.py", tmp_path / "address"
    script.write_text(LEFT)
    dask = [sys.executable, "-W", "ignore", "-m", "dask"]
    common = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    at = ["--scheduler-file", str(address)]
    here = ["--host", "127.0.0.1", "--no-dashboard"]
    started = [subprocess.Popen([*dask, "scheduler", *at, "--port", "0", *here], **common)]
    try:
        started.append(subprocess.Popen([*dask, "worker", *at, "--nthreads", "1", *here], **common))
        place = awaited(address)["address"]
        command = [sys.executable, "-W", "ignore", str(script), place, str(started[0].pid)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait()
    assert done.stdout == "3\n"
    last = done.stderr.splitlines()[-1]
    assert last.startswith(
        f"shrm_cli.errors.ClusterError: scheduler {place}: the cluster went away"
    )
    assert "distributed.client - ERROR" not in done.stderr


def awaited(path):
    """Return the JSON that another process writes into a file soon."""
    for _ in range(300):
        time.sleep(0.1)
        with contextlib.suppress(OSError, ValueError):
            return json.loads(path.read_text())
    raise TimeoutError(path)


def test_a_scheduler_that_does_not_answer_is_told_in_one_line(monkeypatch):
    monkeypatch.setattr(cluster, "_PATIENCE", 0.5)
    for address in ("tcp://127.0.0.1:9", "nowhere", "http://127.0.0.1:9", "tcp://127.0.0.1:x"):
        with (
            pytest.raises(ClusterError, match="nobody answers there") as caught,
            cluster_executor(address),
        ):
            pass
        assert str(caught.value).startswith(f"scheduler {address}: ")
        assert "\n" not in str(caught.value)


COLLECTED = """
import gc
from distributed import utils
from shrm_cli.batch import cluster

class Thread(utils._CollectErrorThread):
    def __init__(self, *given, **named):
        if gc.isenabled():  # as Python does now and then
            gc.collect()
        super().__init__(*given, **named)

utils._CollectErrorThread = Thread
cluster._PATIENCE = 0.2
for address in ("nowhere", "http://127.0.0.1:9", "tcp://127.0.0.1:x", "tcp://127.0.0.1:9"):
    try:
        with cluster.cluster_executor(address):
            pass
    except cluster.ClusterError as error:
        print(error)
        error.own = error  # so that it lives until garbage is collected
"""


def test_a_client_that_failed_does_not_hold_up_the_next():
    """It was collected where the next one starts, and both waited for each other."""
    done = subprocess.run(
        [sys.executable, "-c", COLLECTED], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout.count("nobody answers there")) == (0, 4), done.stderr


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(ClusterError, match="pip install distributed threadpoolctl cryptography"),
        cluster_executor("local"),
    ):
        pass


INTERRUPTED = """
import sys, time
from shrm_cli.batch.cluster import cluster_executor
if __name__ == "__main__":
    try:
        with cluster_executor("local", 2) as workers:
            tasks = [workers.submit(time.sleep, 1.5) for _ in range(2)]
            time.sleep(0.5)
            print("ready", flush=True)
            time.sleep(60)
    except KeyboardInterrupt:
        print("interrupted")
"""


@pytest.mark.proof
@pytest.mark.slow
def test_ctrl_c_ends_a_local_cluster_without_a_word(tmp_path):
    """A terminal sends it to all processes of the group."""
    script = tmp_path / "run.py"
    script.write_text(INTERRUPTED)
    process = subprocess.Popen(
        [sys.executable, "-W", "ignore", str(script)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    assert process.stdout.readline() == "ready\n"
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (out, err) == ("interrupted\n", "")
