"""Fuzzing of the parsers: a table of targets with executions, coverage and findings."""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from subprocess import DEVNULL, PIPE, STDOUT

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.fuzz.mutants import DRIVES, KINDS, mutant, play
from tests.fuzz.rule import MOST_MIB
from tests.fuzz.targets import TARGETS

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build" / "fuzz"
SEEDS = ROOT / "tests" / "fuzz" / "corpus"
FINDINGS = ("crash-", "timeout-", "oom-", "leak-")
"""First letters of the names that libFuzzer gives to inputs that it found."""
WANTED = 10_000_000
"""Inputs that each target is to have had, in all runs."""
STANDSTILL_S = 600
"""Time after which an input that does not even come back to Python counts as a hang, s."""
_EXECUTIONS = re.compile(rb"stat::number_of_executed_units:\s*(\d+)")
_PROGRESS = re.compile(rb"^#(\d+)\s", re.MULTILINE)
_COVERAGE = re.compile(rb"cov: (\d+) ft: ")


@dataclass(frozen=True)
class Outcome:
    """Outcome of a target.

    Attributes:
        executions: Number of inputs that were tried.
        total: Number of inputs in all runs whose files are still there.
        coverage: Number of branches of the followed packages that were seen; None where unknown.
        per_s: Number of inputs a second.
        findings: Inputs that broke the rule.
        failed: Whether the fuzzer ended with an error and without an input.

    """

    executions: int
    total: int
    coverage: int | None
    per_s: float
    findings: tuple[Path, ...]
    failed: bool


def fuzz(name: str, options: argparse.Namespace) -> Outcome:
    """Fuzz a target in a process of its own; what it says goes into a file beside its inputs."""
    found = BUILD / name
    (found / "corpus").mkdir(parents=True, exist_ok=True)
    before = set(found.iterdir())
    command = [sys.executable, str(ROOT / "tools" / "fuzzing" / "one_target.py"), name]
    command += [",".join(TARGETS[name].followed), str(int(not TARGETS[name].has_arrays))]
    command += [str(found / "corpus"), str(SEEDS / name)]
    command += [f"-artifact_prefix={found}/", f"-max_len={TARGETS[name].longest}"]
    command += [f"-rss_limit_mb={MOST_MIB}", f"-timeout={STANDSTILL_S}", f"-seed={options.seed}"]
    command += ["-print_final_stats=1", f"-runs={options.runs}"]
    command += [f"-max_total_time={max(round(options.minutes * 60), 1)}"]
    began = time.monotonic()
    with tempfile.TemporaryDirectory(dir=_memory_folder()) as scratch:
        environment = {**os.environ, "TMPDIR": scratch}
        done = subprocess.run(
            command, stdout=PIPE, stderr=STDOUT, stdin=DEVNULL, env=environment, check=False
        )
    took_s = max(time.monotonic() - began, 1e-3)
    (found / "fuzzer.txt").write_bytes(done.stdout)
    # One that was interrupted says how far it was, but not how many there were.
    counts = _EXECUTIONS.findall(done.stdout) or _PROGRESS.findall(done.stdout)
    executions = max(map(int, counts), default=0)
    branches = max(map(int, _COVERAGE.findall(done.stdout)), default=None)
    new = sorted(set(found.iterdir()) - before)
    findings = tuple(path for path in new if path.name.startswith(FINDINGS))
    failed = done.returncode != 0 and not findings
    total = _add_up(found / "executions.txt", executions)
    return Outcome(executions, total, branches, executions / took_s, findings, failed)


def _add_up(path: Path, executions: int) -> int:
    """Sum of the executions of all runs, kept in a file."""
    total = executions + (int(path.read_text()) if path.exists() else 0)
    path.write_text(f"{total}\n")
    return total


def _memory_folder() -> str | None:
    """A folder that is in memory: targets write a file for each input. None: the usual one."""
    shared = "/dev/shm"  # noqa: S108  a folder is made below it
    return shared if os.access(shared, os.W_OK) else None


def play_files(kinds: Iterable[str], count: int, first: int) -> int:
    """Play mutants of files through the command line; 1 where one breaks the rule."""
    status = 0
    for kind in kinds:
        began, statuses, longest_s, findings = time.monotonic(), Counter(), 0.0, []
        for number in range(first, first + count):
            try:
                outcome = play(kind, mutant(kind, number), number)
            except Exception as error:  # noqa: BLE001  whatever it is, it is a finding
                path = BUILD / f"mutant-{number}-{kind}"
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(mutant(kind, number))
                findings.append(f"    {path.relative_to(ROOT)}: {type(error).__name__}: {error}")
                continue
            statuses[outcome.status] += 1
            longest_s = max(longest_s, outcome.seconds)
        counts = ", ".join(f"{n} of status {one}" for one, n in sorted(statuses.items()))
        took_s = time.monotonic() - began
        print(
            f"{kind:5} {count} mutants from {first} on in {took_s:.0f} s: {counts}; "
            f"longest {longest_s:.1f} s of the processor, {len(findings)} findings",
            flush=True,
        )
        print(*findings, sep="\n", end="\n" if findings else "", flush=True)
        status |= bool(findings)
    return status


def repeat(name: str, path: Path) -> int:
    """Run one input without the fuzzer; an exception shows where it ends."""
    TARGETS[name].run(path.read_bytes())
    print(f"{name}: {path} keeps the rule")
    return 0


def main() -> int:
    """Run the command; 1 where something was found."""
    parser = argparse.ArgumentParser(prog="tools/fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"of {', '.join(TARGETS)}")
    parser.add_argument("--minutes", type=float, default=1.0, metavar="M", help="for each target")
    parser.add_argument("--runs", type=int, default=-1, metavar="N", help="most executions of each")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="of the mutations")
    parser.add_argument(
        "--files",
        type=int,
        metavar="N",
        help="instead: N mutants of MF4, SQLite, CSV and models each, "
        "through commands, from number --seed on",
    )
    parser.add_argument(
        "--drives",
        type=int,
        metavar="N",
        help="instead: N odd drives as logs and as tables each, through commands",
    )
    parser.add_argument("--repeat", type=Path, metavar="FILE", help="run this input alone")
    options = parser.parse_args()
    unknown = [name for name in options.targets if name not in TARGETS]
    if unknown:
        parser.error(f"no target {unknown[0]}: write some of {', '.join(TARGETS)}")
    if options.files is not None or options.drives is not None:
        is_files = options.files is not None
        return play_files(
            KINDS if is_files else DRIVES, options.files or options.drives, options.seed
        )
    if options.repeat:
        if len(options.targets) != 1:
            parser.error("--repeat wants one target")
        return repeat(options.targets[0], options.repeat)
    status, fewer = 0, []
    print(
        f"{'target':16}{'executions':>12}{'a second':>10}{'in all runs':>13}{'branches':>10}"
        f"{'findings':>10}"
    )
    for name in options.targets or TARGETS:
        outcome = fuzz(name, options)
        branches = "-" if outcome.coverage is None else outcome.coverage
        print(
            f"{name:16}{outcome.executions:>12}{outcome.per_s:>10.0f}{outcome.total:>13}"
            f"{branches:>10}{len(outcome.findings):>10}",
            flush=True,
        )
        for path in outcome.findings:
            print(f"    tools/fuzz {name} --repeat {path.relative_to(ROOT)}")
        if outcome.failed:
            print(f"    the fuzzer failed: see {(BUILD / name / 'fuzzer.txt').relative_to(ROOT)}")
        if outcome.findings or outcome.failed:
            status = 1
        if outcome.total < WANTED:
            fewer.append(name)
    print(f"fewer than the {WANTED:,} inputs required in all runs: {', '.join(fewer) or 'none'}")
    return status


if __name__ == "__main__":
    sys.exit(main())
