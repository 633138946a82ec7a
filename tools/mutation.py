"""Mutants of the modules of tools/mutation.toml by Cosmic Ray, in a copy below build/mutation."""

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
        settings: Contents of tools/mutation.toml.

    """

    def __init__(self, module: str, settings: dict) -> None:
        self.module = module
        self.tests = settings["tests"][module]
        self._skipped = settings["skipped_operators"]
        self._source = (ROOT / module).read_text()
        self._database = BUILD / f"{Path(module).stem}.sqlite"
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

    def run(self, *, survivors_only: bool) -> None:
        """Judge the mutants that have no result yet."""
        key = self._hash_copy()
        known = self._key.read_text().split() if self._key.exists() else []
        self._config.write_text(self._wanted)
        if known != key:
            if survivors_only and known[:1] == key[:1]:
                self._forget_survivors()
            else:
                self._begin()
            self._cosmic_ray("baseline", self._config)
            self._key.write_text("\n".join(key))
        elif survivors_only:
            self._forget_survivors()
        with use_db(self._database, WorkDB.Mode.open) as work:
            pending = len(list(work.pending_work_items))
        if pending:
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
        skipped, places = re.compile("|".join(self._skipped)), untouched(self._source)
        with use_db(self._database, WorkDB.Mode.open) as work:
            for item in list(work.pending_work_items):
                (mutation,) = item.mutations
                inside = any(begin <= mutation.start_pos < end for begin, end in places)
                if inside or skipped.match(mutation.operator_name):
                    work.set_result(item.job_id, WorkResult(WorkerOutcome.SKIPPED))

    def _forget_survivors(self) -> None:
        # Cosmic Ray has no function that takes a result back.
        with closing(sqlite3.connect(self._database)) as database, database:
            database.execute(
                "DELETE FROM work_results WHERE test_outcome = 'SURVIVED' OR output = 'timeout'"
            )

    def _cosmic_ray(self, *arguments: str | Path) -> None:
        done = subprocess.run(["cosmic-ray", *map(str, arguments)], cwd=COPY, check=False)
        if done.returncode:
            raise SystemExit(f"mutation: {self.module}: cosmic-ray {arguments[0]} failed")


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


def report(sessions: list[Session], known: dict[Mutant, str]) -> int:
    """Print the table and the survivors; the number of survivors that are not known."""
    fates = ("killed", "survived", "timed out")
    survivors = []
    print("| module | mutants | " + " | ".join(fates) + " |\n|---|---|---|---|---|")
    for session in sessions:
        results = list(session.results())
        counts = Counter(fate for _, fate in results)
        cells = [session.module, len(results), *(counts[fate] for fate in fates)]
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


def main() -> int:
    """Run the command; 1 where a mutant survived that is not known."""
    # As Ctrl-C, which ends what it began as well: else mutants would go on without it.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    settings = tomllib.loads((ROOT / "tools" / "mutation.toml").read_text())
    by_name = {Path(module).stem: module for module in settings["tests"]}
    parser = argparse.ArgumentParser(prog="tools/mutation", description=__doc__)
    parser.add_argument("modules", nargs="*", metavar="MODULE", help=", ".join(by_name))
    parser.add_argument(
        "--survivors", action="store_true", help="only what survived or timed out before"
    )
    parser.add_argument("--print", action="store_true", help="what there is, without a run")
    options = parser.parse_args()
    for name in set(options.modules) - set(by_name):
        parser.error(f"no module {name}; there are: {', '.join(by_name)}")
    chosen = [by_name[name] for name in options.modules or by_name]
    sessions = [Session(module, settings) for module in chosen]
    if not options.print:
        copy_sources()
        for session in sessions:
            session.run(survivors_only=options.survivors)
    unknown = report(sessions, known_survivors(settings))
    if unknown:
        print(f"\nmutation: {unknown} survivors are not known", file=sys.stderr)
    return int(unknown > 0)


if __name__ == "__main__":
    sys.exit(main())
