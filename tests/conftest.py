"""What many tests share: the drawn tests, branch coverage, real data, hypothesis' settings."""

import gc
import hashlib
import os
import signal
from pathlib import Path

import pytest
from coverage import Coverage
from hypothesis import HealthCheck, Phase, settings

settings.register_profile(
    "quiet", deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True
)
settings.load_profile("quiet")
# For tools/mutation: the same examples in each run, and no search for the smallest one that fails.
settings.register_profile(
    "mutation",
    settings.get_profile("quiet"),
    derandomize=True,
    phases=(Phase.explicit, Phase.generate),
    report_multiple_bugs=False,
)

ROOT = Path(__file__).resolve().parent.parent
DRAWN = {"long": 64, "slow": 8, "costly": 8}
"""One test of so many is drawn of those with a mark; of several marks the first here counts."""
COVERING = {
    *(f"bus/test_{name}.py" for name in ("acceptance", "e2e", "j1939", "receiver", "stuck_signal")),
    *(f"service/test_{name}.py" for name in ("core", "output_messages", "outputs", "schedule")),
    "service/test_states.py",
}
"""Test files that by themselves have to cover each branch of the modules in pyproject.toml: none of
their tests is marked 'costly'."""


def pytest_addoption(parser):
    group = parser.getgroup("adhesion-can")
    group.addoption(
        "--drawn",
        metavar="WORD",
        help="some of the tests that take time, drawn by this word: "
        + ", ".join(f"one in {of} marked '{mark}'" for mark, of in DRAWN.items()),
    )
    group.addoption(
        "--branch-coverage", action="store_true", help="coverage of what must not be wrong"
    )


def pytest_configure(config):
    if config.getoption("branch_coverage") and not config.getoption("numprocesses", None):
        config.pluginmanager.register(CoverageOfSome())


def pytest_collection_finish():
    """Spare the garbage collector half a million objects of the collected tests, at each pass."""
    gc.collect()
    gc.freeze()


def draw(word, names, of):
    """One in `of` of these tests, spread evenly over their files, drawn by a word.

    What is drawn of many tests takes nearly the same time for every word: a systematic sample.
    """

    def order(name):
        return name.partition("::")[0], hashlib.sha256(f"{word} {name}".encode()).digest()

    first = hashlib.sha256(word.encode()).digest()[0] % of
    return set(sorted(names, key=order)[first::of])


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config, items):
    word = config.getoption("drawn")
    if word is None:
        return
    marked = {mark: [] for mark in DRAWN}
    for item in items:
        marks = [mark for mark in DRAWN if item.get_closest_marker(mark)]
        if marks:
            marked[marks[0]].append(item.nodeid)
    left = {name for names in marked.values() for name in names}
    for mark, names in marked.items():
        left -= draw(word, names, DRAWN[mark])
    config.hook.pytest_deselected(items=[item for item in items if item.nodeid in left])
    items[:] = [item for item in items if item.nodeid not in left]


class CoverageOfSome:
    """Branch coverage while modules are imported, and in the tests of `COVERING`.

    In the others it would cost time, and count what is not looked at.
    """

    def __init__(self):
        self._coverage = Coverage(data_suffix=True)
        self._coverage.start()

    def pytest_collection_finish(self):
        self._coverage.stop()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        if item.path.relative_to(ROOT / "tests").as_posix() not in COVERING:
            return (yield)
        self._coverage.start()
        try:
            return (yield)
        finally:
            self._coverage.stop()

    def pytest_sessionfinish(self):
        self._coverage.save()


@pytest.fixture(scope="session")
def realdata():
    """Folder of the real measurements; skips where it is absent."""
    named = os.environ.get("ADHESION_CAN_REALDATA")
    folder = Path(named) if named else ROOT.parent / "shared" / "realdata"
    if not folder.is_dir():
        pytest.skip(f"no real data: neither $ADHESION_CAN_REALDATA nor {folder.name} beside us")
    return folder


@pytest.fixture
def restored_signals():
    """Handlers of the signals that `run` takes over, put back after a run in this process."""
    numbers = (
        *(signal.SIGINT, signal.SIGTERM, signal.SIGHUP),
        *(signal.SIGQUIT, signal.SIGUSR1, signal.SIGUSR2),
    )
    handlers = {number: signal.getsignal(number) for number in numbers}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)
