"""Mutants of the modules of tools/mutation.toml by Cosmic Ray, in a copy below build/mutation.

All mutants of the modules under [tests] are judged. Of those of a package under [[package]] a
number is drawn by the hash of what is changed: a change of one module draws no others elsewhere.
"""

import argparse
import ast
import hashlib
import re
import shlex
import shutil
import signal
import sqlite3
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from cosmic_ray.config import serialize_config
from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import TestOutcome, WorkerOutcome, WorkItem, WorkResult

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build" / "mutation"
COPY = BUILD / "copy"
"""Cosmic Ray changes files where they lie: never those of the repository."""

PYTEST = (
    "env PYTEST_DISABLE_PLUGIN_AUTOLOAD=1 python -m pytest -q -x --tb=no -p no:cacheprovider "
    "-p pytest_timeout -p _hypothesis_pytestplugin --hypothesis-profile mutation"
)
"""Examples of hypothesis are the same in each run: what was killed once is killed again."""


def test_command(tests: list[str]) -> str:
    """Tests that judge a mutant, those first that need no examples: most mutants end there."""
    plain, drawn = (
        f"{PYTEST} -m 'not slow and {mark}' {' '.join(tests)}"
        for mark in ("not hypothesis", "hypothesis")
    )
    # 5: no test of the kind.
    return shlex.join(["sh", "-c", f"{{ {plain} || [ $? = 5 ]; }} && {{ {drawn} || [ $? = 5 ]; }}"])


class Mutant(NamedTuple):
    """A changed line: module, function or class around it, and the line before and after."""

    module: str
    where: str
    line: str
    mutant: str


def digest(paths: list[Path]) -> str:
    """Hash of the contents of files."""
    contents = (f"{path} {path.read_text()}" for path in sorted(paths))
    return hashlib.sha256("\n".join(contents).encode()).hexdigest()


def untouched(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Both ends, line and column, of what no test can judge: annotations and the stars of `def`."""
    found = []
    for node in ast.walk(ast.parse(source)):
        for part in (getattr(node, "annotation", None), getattr(node, "returns", None)):
            if part is not None:
                ends = (part.lineno, part.col_offset), (part.end_lineno, part.end_col_offset)
                found.append(ends)
        if isinstance(node, ast.FunctionDef) and node.args.kwonlyargs:
            first = node.args.kwonlyargs[0]
            found.append(((node.lineno, node.col_offset), (first.lineno, first.col_offset)))
    return found


def name_at(source: str, line: int) -> str:
    """Qualified name of the innermost function or class around a line; '' at the module's level."""

    def inner(body: list[ast.stmt], name: str) -> str:
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                first = min([node.lineno, *(one.lineno for one in node.decorator_list)])
                if first <= line <= node.end_lineno:
                    return inner(node.body, f"{name}.{node.name}".lstrip("."))
        return name

    return inner(ast.parse(source).body, "")


class Session:
    """Mutants of one module and their fates, kept below build/ as long as the code is the same.

    Args:
        module: Path of the module in the repository.
        tests: Test files that judge its mutants.
        settings: Contents of tools/mutation.toml.

    """

    def __init__(self, module: str, tests: list[str], settings: dict) -> None:
        self.module = module
        self.tests = tests
        self._skipped = settings["skipped_operators"]
        self._source = (ROOT / module).read_text()
        self._places, self._operators = untouched(self._source), re.compile("|".join(self._skipped))
        name = "-".join(Path(module).with_suffix("").parts[1:])
        self._database = BUILD / f"{name}.sqlite"
        self._config = self._database.with_suffix(".toml")
        self._key = self._database.with_suffix(".key")
        config = {
            "module-path": module,
            "timeout": float(settings["timeout_s"]),
            "excluded-modules": [],
            "test-command": test_command(self.tests),
            "distributor": {"name": "local"},
        }
        self._wanted = serialize_config(config)

    def prepare(self, *, survivors_only: bool) -> None:
        """Forget what was judged of other code or by other tests."""
        key = self._hash_copy()
        known = self._key.read_text().splitlines()[:2] if self._key.exists() else []
        self._config.write_text(self._wanted)
        if known != key:
            if survivors_only and known[:1] == key[:1]:
                self._forget_survivors()
            else:
                self._begin()
            self._key.write_text("\n".join([*key, "baseline to be run"]))
        elif survivors_only:
            self._forget_survivors()

    def draws(self, seed: int) -> dict[str, str]:
        """Hash of each mutant's place and kind, by its job: the smallest ones are drawn."""
        lines, seen, found = self._source.splitlines(), Counter(), {}
        with use_db(self._database, WorkDB.Mode.open) as work:
            items = [item for item in work.work_items if not self._is_left_out(item)]
        for item in sorted(items, key=_place):
            (mutation,) = item.mutations
            where, line = mutation.start_pos[0], lines[mutation.start_pos[0] - 1].strip()
            words = f"{seed} {self.module} {name_at(self._source, where)} {line}"
            words += f" {mutation.operator_name} {mutation.operator_args}"
            seen[words] += 1
            found[item.job_id] = hashlib.sha256(f"{words} {seen[words]}".encode()).hexdigest()
        return found

    def keep(self, jobs: set[str]) -> None:
        """Judge these mutants alone."""
        with use_db(self._database, WorkDB.Mode.open) as work:
            others = [one.job_id for one in work.pending_work_items if one.job_id not in jobs]
            work.set_multiple_results(others, WorkResult(WorkerOutcome.SKIPPED))
        # Cosmic Ray has no function that takes a result back.
        with closing(sqlite3.connect(self._database)) as database, database:
            for job in jobs:
                database.execute(
                    "DELETE FROM work_results WHERE job_id = ? AND worker_outcome = 'SKIPPED'",
                    (job,),
                )

    def run(self) -> None:
        """Judge the mutants that have no result yet."""
        with use_db(self._database, WorkDB.Mode.open) as work:
            pending = len(list(work.pending_work_items))
        if pending:
            self._check_baseline()
            print(
                f"mutation: {self.module}, {pending} mutants to judge", file=sys.stderr, flush=True
            )
            self._cosmic_ray("exec", self._config, self._database)

    def results(self) -> Iterator[tuple[Mutant, str]]:
        """Each mutant that was judged, and its fate."""
        if not self._database.exists():
            return
        with use_db(self._database, WorkDB.Mode.open) as work:
            done = work.completed_work_items
        for item, result in done:
            if result.worker_outcome is WorkerOutcome.SKIPPED:
                continue
            if result.worker_outcome is not WorkerOutcome.NORMAL:
                raise RuntimeError(f"{self.module}: {result.worker_outcome}: {result.output}")
            if result.test_outcome is TestOutcome.SURVIVED:
                fate = "survived"
            else:
                fate = "timed out" if result.output == "timeout" else "killed"
            yield self._describe(item, result), fate

    def _hash_copy(self) -> list[str]:
        """Hashes of package and settings, which make the mutants, and of the tests."""
        code = digest([*(COPY / "adhesion_can").rglob("*.py"), *(COPY / "dbc").iterdir()])
        settings = hashlib.sha256(repr((self._wanted, self._skipped)).encode()).hexdigest()
        shared = [p for p in (COPY / "tests").glob("*.py") if not p.name.startswith("test_")]
        folders = {(COPY / test).parent for test in self.tests}
        beside = [path for folder in folders for path in folder.glob("*.py")]
        return [code + settings, digest(shared + beside)]

    def _check_baseline(self) -> None:
        """Whether the tests pass without a mutant, once for a state of code and tests."""
        key = self._key.read_text().splitlines()
        if len(key) > 2:
            self._cosmic_ray("baseline", self._config)
            self._key.write_text("\n".join(key[:2]))

    def _describe(self, item: WorkItem, result: WorkResult) -> Mutant:
        lines = result.diff.splitlines()[3:]
        before, after = (
            " ".join(line[1:].strip() for line in lines if line.startswith(sign)).strip()
            for sign in "-+"
        )
        where = name_at(self._source, item.mutations[0].start_pos[0])
        return Mutant(self.module, where, before, after)

    def _begin(self) -> None:
        self._database.unlink(missing_ok=True)
        self._cosmic_ray("init", self._config, self._database)
        with use_db(self._database, WorkDB.Mode.open) as work:
            left_out = [one.job_id for one in work.pending_work_items if self._is_left_out(one)]
            work.set_multiple_results(left_out, WorkResult(WorkerOutcome.SKIPPED))

    def _is_left_out(self, item: WorkItem) -> bool:
        """Whether no test can judge a mutant, or its operator is skipped."""
        (mutation,) = item.mutations
        inside = any(begin <= mutation.start_pos < end for begin, end in self._places)
        return inside or bool(self._operators.match(mutation.operator_name))

    def _forget_survivors(self) -> None:
        with closing(sqlite3.connect(self._database)) as database, database:
            database.execute(
                "DELETE FROM work_results WHERE test_outcome = 'SURVIVED' OR output = 'timeout'"
            )

    def _cosmic_ray(self, *arguments: str | Path) -> None:
        done = subprocess.run(["cosmic-ray", *map(str, arguments)], cwd=COPY, check=False)
        if done.returncode:
            raise SystemExit(f"mutation: {self.module}: cosmic-ray {arguments[0]} failed")


def _place(item: WorkItem) -> tuple[object, ...]:
    """Order of mutants in a module."""
    (mutation,) = item.mutations
    return mutation.start_pos, mutation.operator_name, mutation.occurrence


class Package:
    """Modules of a folder, of whose mutants some are drawn.

    Args:
        described: Table [[package]] of tools/mutation.toml.
        settings: All of it.

    """

    def __init__(self, described: dict, settings: dict) -> None:
        self.name = described["folder"]
        self._drawn, self._seed = described["drawn"], described["seed"]
        self.least_killed = described["least_killed"]
        own = described.get("tests_of", {})
        paths = sorted(
            path.relative_to(ROOT).as_posix()
            for path in (ROOT / self.name).glob(described.get("files", "*.py"))
        )
        self.sessions = [
            Session(path, own.get(Path(path).name, described["tests"]), settings)
            for path in paths
            if path not in settings["tests"] and Path(path).name != "__init__.py"
        ]

    def run(self, *, survivors_only: bool) -> None:
        """Judge the mutants that are drawn."""
        draws = []
        for session in self.sessions:
            session.prepare(survivors_only=survivors_only)
            draws += [(rank, session, job) for job, rank in session.draws(self._seed).items()]
        chosen = sorted(draws, key=lambda one: one[0])[: self._drawn]
        for session in self.sessions:
            session.keep({job for _, owner, job in chosen if owner is session})
        for session in self.sessions:
            session.run()


def copy_sources() -> None:
    """What the tests need, as it is now, into the copy."""
    shutil.rmtree(COPY, ignore_errors=True)
    for name in ("adhesion_can", "dbc", "tests"):
        shutil.copytree(ROOT / name, COPY / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", COPY)


def known_survivors(settings: dict) -> dict[Mutant, str]:
    """Reason of each known survivor."""
    return {
        Mutant(one["module"], one["where"], one["line"], mutant): one["reason"]
        for one in settings.get("known", [])
        for mutant in one["mutants"]
    }


def report(sessions: list[Session], known: dict[Mutant, str], *, by_module: bool = True) -> int:
    """Print the table and the survivors; the number of survivors that are not known."""
    fates = ("killed", "survived", "timed out")
    survivors = []
    if by_module:
        print("| module | mutants | " + " | ".join(fates) + " |\n|---|---|---|---|---|")
    for session in sessions:
        results = list(session.results())
        counts = Counter(fate for _, fate in results)
        cells = [session.module, len(results), *(counts[fate] for fate in fates)]
        if by_module:
            print("| " + " | ".join(map(str, cells)) + " |")
        survivors += [mutant for mutant, fate in results if fate == "survived"]
        modules = {mutant for mutant in known if mutant.module == session.module}
        for mutant in sorted(modules - set(survivors)):
            print(f"no longer survives: {mutant}", file=sys.stderr)
    unknown = 0
    for mutant in survivors:
        reason = known.get(mutant)
        unknown += reason is None
        print(f"\n{mutant.module}, {mutant.where or 'module'}: {reason or 'NOT KNOWN'}")
        print(f"  - {mutant.line}\n  + {mutant.mutant}")
    return unknown


def report_package(package: Package, known: dict[Mutant, str]) -> bool:
    """Print a package's share of killed mutants and its survivors; whether the share is too small.

    A mutant that survives for a known reason counts neither way: no test can or need notice it.
    """
    results = [one for session in package.sessions for one in session.results()]
    excused = [mutant for mutant, fate in results if fate == "survived" and mutant in known]
    judged = len(results) - len(excused)
    killed = sum(fate != "survived" for _, fate in results)
    share = killed / judged if judged else 0.0
    met = "met" if share >= package.least_killed else "MISSED"
    print(
        f"{package.name}: {len(results)} drawn, {killed} killed, {len(excused)} survive for a "
        f"known reason, {judged - killed} for none: {share:.1%} killed (target "
        f"{package.least_killed:.0%}: {met})"
    )
    report(package.sessions, known, by_module=False)
    return share < package.least_killed


def main() -> int:
    """Run the command; 1 where a survivor of [tests] is not known, or a share is too small."""
    # As Ctrl-C, which ends what it began as well: else mutants would go on without it.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    settings = tomllib.loads((ROOT / "tools" / "mutation.toml").read_text())
    modules = {Path(module).stem: module for module in settings["tests"]}
    packages = {one["name"]: one for one in settings.get("package", [])}
    parser = argparse.ArgumentParser(prog="tools/mutation", description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join([*modules, *packages]))
    parser.add_argument(
        "--survivors", action="store_true", help="only what survived or timed out before"
    )
    parser.add_argument("--print", action="store_true", help="what there is, without a run")
    options = parser.parse_args()
    for name in set(options.names) - {*modules, *packages}:
        parser.error(f"no module or package {name}; there are: {', '.join([*modules, *packages])}")
    chosen = options.names or [*modules, *packages]
    sessions = [
        Session(modules[name], settings["tests"][modules[name]], settings)
        for name in chosen
        if name in modules
    ]
    drawn = [Package(packages[name], settings) for name in chosen if name in packages]
    if not options.print:
        copy_sources()
        for session in sessions:
            session.prepare(survivors_only=options.survivors)
            session.run()
        for package in drawn:
            package.run(survivors_only=options.survivors)
    known = known_survivors(settings)
    unknown = report(sessions, known) if sessions else 0
    missed = [package.name for package in drawn if report_package(package, known)]
    if unknown:
        print(f"\nmutation: {unknown} survivors are not known", file=sys.stderr)
    return int(unknown > 0 or bool(missed))


if __name__ == "__main__":
    sys.exit(main())
