"""Runs of pytest in forks of a process that has imported what all of them need.

A run starts with the libraries, and without a module of `adhesion_can`: one module may be read from
a text instead of its file, and no file is changed for it.
"""

import contextlib
import gc
import importlib
import json
import os
import resource
import signal
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path
from typing import NamedTuple, NoReturn

import pytest

IMPORTED = (
    *("numpy", "scipy.linalg", "scipy.optimize", "scipy.signal", "scipy.special", "scipy.stats"),
    *("can", "cantools", "tomlkit", "rich", "coverage", "hypothesis.extra.numpy"),
)
"""Libraries that the tests of most modules import."""
OPTIONS = (
    *("-q", "-x", "--tb=no", "-p", "no:cacheprovider", "-p", "pytest_timeout"),
    *("-p", "_hypothesis_pytestplugin", "--hypothesis-profile", "mutation", "-m", "not slow"),
)
"""Examples of hypothesis are the same in each run: what was killed once is killed again."""
QUICK_S = 0.3
"""Longest time of a test that goes before the others."""
SLOWER = 5
"""A run is ended after so many times the processor time without a mutant, and `MORE_S`."""
MORE_S = 10.0
WAITING = 50
"""A run that waits instead of computing is ended after so many times that limit."""
LOOK_S = 0.01
"""Time from one look at the runs to the next. Looks are counted, not time: a machine too busy for
the runs has none for this process either, and both may be stopped."""


def import_libraries() -> None:
    """Import what the runs need, once for all forks."""
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    for name in IMPORTED:
        importlib.import_module(name)
    gc.collect()
    gc.freeze()


class Run(NamedTuple):
    """How the tests ended.

    Attributes:
        name: Name of the mutant, '' without one.
        fate: 'survived', 'killed' or 'timed out'.
        test: Test that failed, '' if none did.
        cpu_s: Processor time, s.

    """

    name: str
    fate: str
    test: str
    cpu_s: float


@dataclass
class Order:
    """Plug-in that runs those tests first that have failed last, then the quick ones.

    Attributes:
        times: Duration of each test, s.
        failed: Tests that failed, the last one at the end.

    """

    times: dict[str, float] = field(default_factory=dict)
    failed: list[str] = field(default_factory=list)

    def pytest_collection_modifyitems(self, items):
        ranks = {name: rank for rank, name in enumerate(reversed(self.failed))}
        items.sort(key=lambda one: (ranks.get(one.nodeid, len(ranks)), self._is_slow(one.nodeid)))
        self.failed = []

    def pytest_runtest_logreport(self, report):
        self.times[report.nodeid] = self.times.get(report.nodeid, 0.0) + report.duration
        if report.failed:
            self.failed.append(report.nodeid)

    def _is_slow(self, name: str) -> bool:
        return self.times.get(name, 0.0) > QUICK_S


@dataclass(eq=False)
class Replaced(SourceFileLoader):
    """Finder and loader of a module whose source is a text."""

    name: str
    path: str
    source: str

    def find_spec(self, name: str, *_: object) -> ModuleSpec | None:
        return spec_from_file_location(name, self.path, loader=self) if name == self.name else None

    def get_code(self, _: str):
        return compile(self.source, self.path, "exec", dont_inherit=True)


class _Fork(NamedTuple):
    name: str
    outcome: Path
    last_look: int


@dataclass
class ForkedTests:
    """Test files, run in a folder with sources and tests.

    Args:
        folder: Folder with the sources.
        tests: Paths of the test files in it.
        processes: Number of runs side by side.

    """

    folder: Path
    tests: Sequence[str]
    processes: int
    _order: Order = field(default_factory=Order, init=False)
    _cpu_limit_s: float = field(default=600.0, init=False)
    _forks: dict[int, _Fork] = field(default_factory=dict, init=False)
    _looks: int = field(default=0, init=False)

    def run_unchanged(self) -> bool:
        """Whether the tests pass; how long they take limits and orders the later runs."""
        self._start("", None)
        while self._forks:
            for run in self._wait():
                self._cpu_limit_s = MORE_S + SLOWER * run.cpu_s
        return run.fate == "survived"

    def run(self, module: str, mutants: Iterable[tuple[str, str]]) -> Iterator[Run]:
        """Runs with each mutant of a module, as they end.

        Args:
            module: Path of the module.
            mutants: Name and source of each mutant.

        """
        try:
            for name, source in mutants:
                while len(self._forks) >= self.processes:
                    yield from self._wait()
                self._start(name, self._replaced(module, source))
            while self._forks:
                yield from self._wait()
        finally:
            for number in self._forks:
                os.killpg(number, signal.SIGKILL)

    def _replaced(self, module: str, source: str) -> Replaced:
        name = module.removesuffix(".py").replace("/", ".")
        return Replaced(name, str(self.folder / module), source)

    def _start(self, name: str, replaced: Replaced | None) -> None:
        used = {fork.outcome for fork in self._forks.values()}
        places = (self.folder.parent / f"run-{k}.json" for k in range(self.processes))
        outcome = next(place for place in places if place not in used)
        outcome.unlink(missing_ok=True)
        number = os.fork()
        if not number:
            self._test(replaced, outcome)
        # Of both processes the first to come here makes the group.
        with contextlib.suppress(PermissionError, ProcessLookupError):
            os.setpgid(number, number)
        last = self._looks + int(WAITING * self._cpu_limit_s / LOOK_S)
        self._forks[number] = _Fork(name, outcome, last)

    def _wait(self) -> Iterator[Run]:
        """Runs that have ended by now; those that wait for too long are ended."""
        time.sleep(LOOK_S)
        self._looks += 1
        for number, fork in list(self._forks.items()):
            if self._looks > fork.last_look:
                os.killpg(number, signal.SIGKILL)
            ended, status, usage = os.wait4(number, os.WNOHANG)
            if ended:
                del self._forks[number]
                # What a test has started ends with it.
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(number, signal.SIGKILL)
                yield self._judge(fork, status, usage.ru_utime + usage.ru_stime)

    def _judge(self, fork: _Fork, status: int, cpu_s: float) -> Run:
        outcome = json.loads(fork.outcome.read_text()) if fork.outcome.exists() else {}
        self._order.times.update(outcome.get("times", {}))
        failed = outcome.get("failed", [])
        others = [test for test in self._order.failed if test not in failed]
        self._order.failed = [*others, *failed]
        if os.WIFSIGNALED(status) and os.WTERMSIG(status) in {signal.SIGXCPU, signal.SIGKILL}:
            fate = "timed out"
        else:
            fate = "survived" if status == 0 else "killed"
        return Run(fork.name, fate, failed[-1] if failed else "", round(cpu_s, 2))

    def _test(self, replaced: Replaced | None, outcome: Path) -> NoReturn:
        """Run pytest in this process, a fork, and end it."""
        status = 3
        try:
            self._prepare()
            if replaced:
                sys.meta_path.insert(0, replaced)
                sys.dont_write_bytecode = True
            order = Order(dict(self._order.times), list(self._order.failed))
            scratch = f"--basetemp={outcome.with_suffix('')}"
            status = int(pytest.main([*OPTIONS, scratch, *self.tests], plugins=[order]))
            times = {} if replaced else order.times
            outcome.write_text(json.dumps({"times": times, "failed": order.failed}))
        finally:
            os._exit(status)

    def _prepare(self) -> None:
        """Limit this process, silence it, and let it import from the folder."""
        os.setpgid(0, 0)
        limit_s = int(self._cpu_limit_s) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s + 5))
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        null = os.open(os.devnull, os.O_RDWR)
        for stream in range(3):
            os.dup2(null, stream)
        os.chdir(self.folder)
        sys.path.insert(0, str(self.folder))
