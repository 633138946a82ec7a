"""The workers: of this machine, or of any scheduler of dask.distributed."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from math import inf
from uuid import uuid4

import dask
from dask.system import CPU_COUNT
from distributed import Client, LocalCluster, Status
from distributed.comm.core import CommClosedError
from distributed.system import MEMORY_LIMIT
from distributed.versions import VersionMismatchWarning

from adhesion_can.errors import InputError
from adhesion_can.fleet.places import open_place
from adhesion_can.version import __version__

OURS = {
    # A unit whose worker died comes back to us at once: we know how often, and try it alone.
    "distributed.scheduler.allowed-failures": 0,
    # Nothing is kept in a worker's memory that could be spilled: what it holds is its work.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    # A worker that dies is started again. Dask looks for it 15 s after each death, and gives it up
    # for good where it is not back: where the machine is busy, or it died once more just then.
    "distributed.deploy.lost-worker-timeout": "365 days",
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    "distributed.admin.low-level-log-length": 100,
    "distributed.worker.profile.enabled": False,
    # Else freed memory goes back to the system at once and is mapped anew for each array, which
    # takes as long as all the work of a unit.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None,
}
"""Settings of dask for a cluster of our own."""
_WARM = ("adhesion_can.fleet.work", "scipy.optimize", "adhesion_can.estimation.registry")
CONNECT = "10s"
"""Time to wait for a scheduler."""


@contextmanager
def open_cluster(
    address: str | None, workers: int | None = None, memory: int | None = None
) -> Iterator[Client]:
    """Client of a cluster, whose workers are ready.

    Args:
        address: Address of a scheduler; None: processes of this machine, one thread each.
        workers: Number of processes of this machine; None: one a core.
        memory: Memory of each of them, bytes; a process beyond it is ended. None: its share.

    Raises:
        InputError: There is no scheduler at that address.

    """
    with ExitStack() as stack:
        stack.enter_context(warnings.catch_warnings())
        # What differs is told by `require_workers`, and only where it matters.
        warnings.simplefilter("ignore", VersionMismatchWarning)
        if address is None:
            stack.enter_context(dask.config.set(OURS))
            count = workers or int(CPU_COUNT)  # cores that this process may use
            cluster = LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                processes=True,
                # Nine tenths of the machine's, divided.
                memory_limit=memory or int(0.9 * MEMORY_LIMIT / count),
                host="127.0.0.1",
                # Without a dashboard there is a server of pages all the same: with none.
                scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
                silence_logs=logging.CRITICAL,
            )
            stack.callback(_close, cluster)
            client = Client(cluster, set_as_default=False)
        else:
            try:
                client = Client(address, timeout=CONNECT, set_as_default=False)
            except (OSError, ValueError, CommClosedError) as error:
                reason = " ".join(str(error).split())[:150]
                fix = "start one with 'dask scheduler', and name its address as tcp://HOST:8786"
                raise InputError(f"--scheduler {address}", f"no answer ({reason})", fix) from error
        stack.callback(client.close)
        yield client


def _close(cluster: LocalCluster) -> None:
    """Close a cluster; all work is done, and a worker that is slow to end is left to end alone."""
    try:
        cluster.close()
    except TimeoutError:
        # A worker that was killed takes more than dask's 5 s to end where the machine is busy.
        cluster.status = Status.closed


def require_workers(client: Client, address: str | None, out: str, seen: str | None) -> None:
    """Make the workers ready: the package is imported, and the folder of the data set is shared.

    Args:
        client: Client of the cluster.
        address: Address of the scheduler; None: our own.
        out: Path or URL of the data set.
        seen: Path or URL of one of the inputs; None: there is none.

    Raises:
        InputError: A worker lacks the package or has another version, or does not see the files.

    """
    where = f"--scheduler {address}" if address else "fleet"
    if not client.nthreads():
        fix = f"start some with 'dask worker {address}'" if address else "see the lines above"
        raise InputError(where, "the scheduler has no workers", fix)
    install = f"pip install 'adhesion-can[fleet]=={__version__}' where its workers run"
    token = uuid4().hex[:12]
    place = open_place(f"{out.rstrip('/')}/.probe-{token}")
    try:
        if place.is_local:
            place.system.makedirs(place.system._parent(place.inner), exist_ok=True)  # noqa: SLF001
        place.system.pipe_file(place.inner, token.encode())
    # Each file system has errors of its own.
    except Exception as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        fix = "name a folder that can be written to"
        raise InputError(f"--out {out}", f"cannot be written ({reason})", fix) from error
    try:
        answers = client.run(probe, place.name, token, seen, on_error="return")
    finally:
        place.system.rm_file(place.inner)
    for worker, answer in sorted(answers.items()):
        if isinstance(answer, ModuleNotFoundError | ImportError | AttributeError):
            what = f"worker {worker} lacks the package or has another version ({answer})"
            raise InputError(where, what, install)
        if isinstance(answer, BaseException):
            raise InputError(where, f"worker {worker} cannot start ({answer})", install)
        version, problem = answer
        if version != __version__:
            what = f"worker {worker} has adhesion-can {version}, this is {__version__}"
            raise InputError(where, what, install)
        if problem:
            fix = "mount it there under the same path, or give URLs, such as s3://BUCKET/.."
            raise InputError(where, f"worker {worker} {problem}", fix)


def probe(out: str, token: str, seen: str | None) -> tuple[str, str]:
    """Version of a worker's package, and what it does not see; '' where it sees all.

    It imports what units need, so that the first one does not wait for it.
    """
    for name in _WARM:
        import_module(name)
    place = open_place(out)
    try:
        text = place.system.cat_file(place.inner).decode()
    # Each file system has errors of its own.
    except Exception as error:  # noqa: BLE001
        reason = " ".join(str(error).split())[:150] or type(error).__name__
        return __version__, f"cannot access the folder of --out ({reason})"
    if text != token:
        return __version__, "has a different folder under the name of --out"
    if seen is not None:
        try:
            info = open_place(seen).info()
        except InputError as error:
            return __version__, str(error)
        if info is None:
            return __version__, f"cannot access {seen}"
    return __version__, ""


def count_threads(client: Client) -> int:
    """Number of units that the workers can work on at the same time; at least 1."""
    return max(sum(map(int, client.nthreads().values())), 1)


def gigabytes(text: str) -> int:
    """Bytes of a number of GB as an option has it.

    Raises:
        ValueError: It is no positive number.

    """
    value = float(text)
    if not 0.0 < value < inf:
        raise ValueError(text)
    return round(value * 1e9)
