"""Mutants of the modules of tools/mutation.toml, made by Cosmic Ray and judged in forks.

All mutants of the modules under [tests] are judged. Of those of a package under [[package]] a
number is drawn by the hash of what is changed: a change of one module draws no others elsewhere.
Fates are lines of build/mutation/fates.jsonl, which count as long as the module and its tests are
the same: lines from another machine may be added to them.
"""

import argparse
import ast
import difflib
import hashlib
import json
import os
import re
import shutil
import signal
import sys
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import cosmic_ray.plugins
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from forked_tests import ForkedTests, import_libraries

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build" / "mutation"
COPY = BUILD / "copy"
"""What is tested, while those of the repository may be edited."""
FATES = BUILD / "fates.jsonl"


class Mutant(NamedTuple):
    """A changed line: module, function or class around it, and the line before and after."""

    module: str
    where: str
    line: str
    mutant: str


class Change(NamedTuple):
    """Which of its changes an operator of Cosmic Ray makes, and in which line."""

    operator: str
    occurrence: int
    line: int


def digest(paths: Iterable[Path]) -> str:
    """Hash of the names and contents of files of the repository."""
    contents = (f"{path.relative_to(ROOT).as_posix()} {path.read_text()}" for path in sorted(paths))
    return hashlib.sha256("\n".join(contents).encode()).hexdigest()


def untouched(tree: ast.Module) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Both ends, line and column, of what no test can judge.

    Annotations, the stars of `def`, and whether a class has slots or `zip` checks the lengths.
    """
    found = []
    for node in ast.walk(tree):
        parts = [getattr(node, "annotation", None), getattr(node, "returns", None)]
        if isinstance(node, ast.keyword) and node.arg in {"slots", "strict"}:
            parts.append(node.value)
        for part in parts:
            if part is not None:
                ends = (part.lineno, part.col_offset), (part.end_lineno, part.end_col_offset)
                found.append(ends)
        if isinstance(node, ast.FunctionDef) and node.args.kwonlyargs:
            first = node.args.kwonlyargs[0]
            found.append(((node.lineno, node.col_offset), (first.lineno, first.col_offset)))
    return found


def name_at(tree: ast.Module, line: int) -> str:
    """Qualified name of the innermost function or class around a line; '' at the module's level."""

    def inner(body: list[ast.stmt], name: str) -> str:
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                first = min([node.lineno, *(one.lineno for one in node.decorator_list)])
                if first <= line <= node.end_lineno:
                    return inner(node.body, f"{name}.{node.name}".lstrip("."))
        return name

    return inner(tree.body, "")


def changes_of(source: str, skipped: list[str]) -> list[Change]:
    """Changes of a module that tests can judge, in the order of their places."""
    places, left_out = untouched(ast.parse(source)), re.compile("|".join(skipped))
    nodes = list(ast_nodes(get_ast(source)))
    found = []
    for name in cosmic_ray.plugins.operator_names():
        kind = cosmic_ray.plugins.get_operator(name)
        if kind.arguments() or left_out.match(name):
            continue
        operator = kind()
        starts = (start for node in nodes for start, _ in operator.mutation_positions(node))
        found += [
            (start, name, occurrence)
            for occurrence, start in enumerate(starts)
            if not any(begin <= start < end for begin, end in places)
        ]
    return [Change(name, occurrence, start[0]) for start, name, occurrence in sorted(found)]


class Module:
    """A module, its mutants by their names, and the tests that judge them.

    Args:
        path: Path in the repository.
        tests: Test files.
        settings: Contents of tools/mutation.toml.

    """

    def __init__(self, path: str, tests: list[str], settings: dict) -> None:
        self.path, self.tests = path, tests
        self.source = (ROOT / path).read_text()
        self._tree = ast.parse(self.source)
        self.changes = self._name(changes_of(self.source, settings["skipped_operators"]))
        folders = {(ROOT / test).parent for test in tests} | {ROOT / "tests"}
        beside = {one for folder in folders for one in folder.glob("*.py")}
        helpers = {one for one in beside if not one.name.startswith("test_")}
        self.hashes = {
            "code": digest([ROOT / path]),
            "by": digest(helpers | {ROOT / test for test in tests}),
        }

    def make(self, name: str) -> str:
        """Source of a mutant."""
        change = self.changes[name]
        operator = cosmic_ray.plugins.get_operator(change.operator)()
        return mutate_code(self.source, operator, change.occurrence)

    def describe(self, name: str) -> Mutant:
        """What a mutant changes."""
        diff = list(difflib.ndiff(self.source.splitlines(), self.make(name).splitlines()))
        before, after = (
            " ".join(line[2:].strip() for line in diff if line.startswith(sign)).strip()
            for sign in ("- ", "+ ")
        )
        return Mutant(self.path, name_at(self._tree, self.changes[name].line), before, after)

    def _name(self, changes: list[Change]) -> dict[str, Change]:
        lines, seen, found = self.source.splitlines(), Counter(), {}
        for change in changes:
            where, line = name_at(self._tree, change.line), lines[change.line - 1].strip()
            words = f"{self.path} {where} {line} {change.operator} {{}}"
            seen[words] += 1
            found[f"{words} {seen[words]}"] = change
        return found


Drawn = list[tuple[Module, list[str]]]
"""Modules, and the names of mutants of each."""


class Fates:
    """Fates of mutants as far as they are known."""

    def __init__(self) -> None:
        lines = FATES.read_text().splitlines() if FATES.exists() else []
        self._found = [json.loads(line) for line in lines]

    def of(self, module: Module) -> dict[str, str]:
        """Fate of each mutant of a module that was judged as it is, by its tests as they are."""
        return {
            one["name"]: one["fate"]
            for one in self._found
            if {word: one[word] for word in module.hashes} == module.hashes
        }

    def killed_before(self, module: Module) -> set[str]:
        """Mutants of a module as it is that tests killed, as these were then."""
        code = module.hashes["code"]
        return {
            one["name"]
            for one in self._found
            if one["code"] == code and one["fate"] == "killed" and one["name"] in module.changes
        }

    def add(self, module: Module, name: str, fate: str, **more: object) -> None:
        """Keep a fate."""
        record = {"name": name, "fate": fate, **more, **module.hashes}
        with FATES.open("a") as file:
            file.write(json.dumps(record) + "\n")
        self._found.append(record)


class Judge:
    """Judges mutants that have no fate yet.

    Args:
        fates: Known fates.
        processes: Number of processes.
        survivors_only: Whether what survived or timed out is judged again, and what was killed is
            not, though its tests be others now.

    """

    def __init__(self, fates: Fates, processes: int, *, survivors_only: bool) -> None:
        self._fates, self._processes, self._survivors_only = fates, processes, survivors_only
        self._runs: dict[tuple[str, ...], ForkedTests] = {}

    def judge(self, module: Module, names: Iterable[str]) -> None:
        """Judge some of the mutants of a module."""
        known = self._fates.of(module)
        if self._survivors_only:
            known = {name: fate for name, fate in known.items() if fate == "killed"}
            for name in (self._fates.killed_before(module) & set(names)) - set(known):
                self._fates.add(module, name, "killed")
                known[name] = "killed"
        pending = [name for name in names if name not in known]
        if not pending:
            return
        runs = self._tests(module)
        print(f"mutation: {module.path}, {len(pending)} to judge", file=sys.stderr, flush=True)
        for run in runs.run(module.path, ((name, module.make(name)) for name in pending)):
            self._fates.add(module, run.name, run.fate, test=run.test, cpu_s=run.cpu_s)

    def _tests(self, module: Module) -> ForkedTests:
        """Tests of a module, which have passed without a mutant."""
        key = tuple(module.tests)
        if key not in self._runs:
            self._runs[key] = ForkedTests(COPY, module.tests, self._processes)
            if not self._runs[key].run_unchanged():
                raise SystemExit(f"mutation: {module.path}: its tests fail without a mutant")
        return self._runs[key]


class Package:
    """Modules of a folder, of whose mutants some are drawn.

    Args:
        described: Table [[package]] of tools/mutation.toml.
        settings: All of it.

    """

    def __init__(self, described: dict, settings: dict) -> None:
        self.name = described["folder"]
        self.least_killed = described["least_killed"]
        own = described.get("tests_of", {})
        paths = sorted(
            path.relative_to(ROOT).as_posix()
            for path in (ROOT / self.name).glob(described.get("files", "*.py"))
        )
        modules = [
            Module(path, own.get(Path(path).name, described["tests"]), settings)
            for path in paths
            if path not in settings["tests"] and Path(path).name != "__init__.py"
        ]
        self.drawn = self._draw(modules, described["drawn"], described["seed"])

    def _draw(self, modules: list[Module], number: int, seed: int) -> Drawn:
        """The mutants with the smallest hashes, by module."""
        names = [name for module in modules for name in module.changes]
        names.sort(key=lambda name: hashlib.sha256(f"{seed} {name}".encode()).hexdigest())
        chosen = set(names[:number])
        return [(one, [name for name in one.changes if name in chosen]) for one in modules]


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


def find_survivors(
    chosen: Drawn, fates: Fates, known: dict[Mutant, str]
) -> Iterator[tuple[Mutant, str | None]]:
    """Each mutant that survived, with the reason if it is known."""
    for module, names in chosen:
        found = fates.of(module)
        alive = [module.describe(name) for name in names if found.get(name) == "survived"]
        yield from ((mutant, known.get(mutant)) for mutant in alive)
        if all(name in found for name in names):
            for mutant in sorted({one for one in known if one.module == module.path} - set(alive)):
                print(f"no longer survives: {mutant}", file=sys.stderr)


def count_fates(chosen: Drawn, fates: Fates) -> Counter:
    """How many mutants have each fate."""
    known = ((fates.of(module), names) for module, names in chosen)
    return Counter(found[name] for found, names in known for name in names if name in found)


def print_survivors(survivors: list[tuple[Mutant, str | None]]) -> None:
    for mutant, reason in survivors:
        print(f"\n{mutant.module}, {mutant.where or 'module'}: {reason or 'NOT KNOWN'}")
        print(f"  - {mutant.line}\n  + {mutant.mutant}")


def report_modules(chosen: Drawn, fates: Fates, known: dict[Mutant, str]) -> int:
    """Print a table and the survivors; the number of survivors that are not known."""
    kinds = ("killed", "survived", "timed out")
    print("| module | mutants | " + " | ".join(kinds) + " |\n|---|---|---|---|---|")
    for module, names in chosen:
        counts = count_fates([(module, names)], fates)
        cells = [module.path, counts.total(), *(counts[kind] for kind in kinds)]
        print("| " + " | ".join(map(str, cells)) + " |")
    survivors = list(find_survivors(chosen, fates, known))
    print_survivors(survivors)
    return sum(reason is None for _, reason in survivors)


def report_package(package: Package, fates: Fates, known: dict[Mutant, str]) -> bool:
    """Print a package's share of killed mutants and its survivors; whether the share is too small.

    A mutant that survives for a known reason counts neither way: no test can or need notice it.
    """
    counts = count_fates(package.drawn, fates)
    survivors = list(find_survivors(package.drawn, fates, known))
    excused = sum(reason is not None for _, reason in survivors)
    judged, alive = counts.total() - excused, len(survivors) - excused
    share = (judged - alive) / judged if judged else 0.0
    met = "met" if share >= package.least_killed else "MISSED"
    print(
        f"{package.name}: {counts.total()} drawn, {judged - alive} killed, {excused} survive for a "
        f"known reason, {alive} for none: {share:.1%} killed (target "
        f"{package.least_killed:.0%}: {met})"
    )
    print_survivors(survivors)
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
    parser.add_argument(
        "--processes", type=int, default=os.cpu_count(), help="how many mutants at a time"
    )
    parser.add_argument("--drawn", type=int, metavar="N", help="N mutants of each package")
    options = parser.parse_args()
    for name in set(options.names) - {*modules, *packages}:
        parser.error(f"no module or package {name}; there are: {', '.join([*modules, *packages])}")
    chosen = options.names or [*modules, *packages]
    whole = [
        Module(modules[name], settings["tests"][modules[name]], settings)
        for name in chosen
        if name in modules
    ]
    alone = [(module, list(module.changes)) for module in whole]
    fewer = {"drawn": options.drawn} if options.drawn else {}
    drawn = [Package(packages[name] | fewer, settings) for name in chosen if name in packages]
    fates = Fates()
    if not options.print:
        copy_sources()
        import_libraries()
        judge = Judge(fates, options.processes, survivors_only=options.survivors)
        for module, names in (*alone, *(pair for package in drawn for pair in package.drawn)):
            judge.judge(module, names)
    known = known_survivors(settings)
    unknown = report_modules(alone, fates, known) if alone else 0
    missed = [package.name for package in drawn if report_package(package, fates, known)]
    if unknown:
        print(f"\nmutation: {unknown} survivors are not known", file=sys.stderr)
    return int(unknown > 0 or bool(missed))


if __name__ == "__main__":
    sys.exit(main())
