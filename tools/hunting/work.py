"""One drive: make it, have it diagnosed in a process of its own, note what is needed to judge."""

import importlib
import json
import os
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from plan import Task, split_form

from tests.worlds import Truth, make_world

CURVE = ("c1", "c2", "c3", "mu_max", "lambda_m")
DURATIONS_S = {"": 240.0, "short": 30.0, "table": 240.0, "drives": 120.0}
"""Duration of each drive by its form, s."""
NO_WORLD = "no world"
"""Status of a drive that could not be made: no fault of the diagnosis."""


@dataclass(frozen=True)
class DiagnosisOptions:
    """How to diagnose.

    Attributes:
        entry: MODULE:FUNCTION that takes the command line.
        holdout: Whether a fresh drive is made and held out.
        timeout_s: Time after which a diagnosis is ended, s.
        keep: Folder in which drives and diagnoses are kept; None: nowhere.

    """

    entry: str = "adhesion_can.cli.main:main"
    holdout: bool = False
    timeout_s: float = 300.0
    keep: Path | None = None


def work(task: Task, diagnosis_options: DiagnosisOptions) -> dict[str, Any]:
    """Record of a drive, fit for JSON."""
    with TemporaryDirectory(prefix="hunt-") as folder:
        name = f"{task.kind}-{task.seed}".replace(":", "_").replace("+", "-")
        where = Path(folder) if diagnosis_options.keep is None else diagnosis_options.keep
        form, kind = split_form(task.kind)
        is_table = form == "table" or kind == "out:table" or kind.startswith(("points:", "car:"))
        path = where / (name + (".csv" if is_table else ".log"))
        record: dict[str, Any] = {
            "kind": task.kind,
            "seed": task.seed,
            "holdout": diagnosis_options.holdout,
        }
        try:
            fresh = diagnosis_options.holdout and not kind.startswith(("points:", "car:"))
            truth = make_world(
                kind,
                task.seed,
                path,
                duration_s=DURATIONS_S[form],
                fresh=fresh or form == "drives",
            )
        except RuntimeError as error:
            return record | {"status": NO_WORLD, "error": str(error), "seconds": 0, "rss_mb": None}
        answer = path.with_name(f"{name}.json")
        answer.unlink(missing_ok=True)
        arguments = ["diagnose", str(path), "--json", str(answer)]
        if truth.fresh:
            arguments[2:2] = [truth.fresh.path] if form == "drives" else []
            arguments += [] if form == "drives" else ["--holdout", truth.fresh.path]
        record["truth"] = truth.to_dict()
        record |= run_diagnosis(arguments, diagnosis_options, path.with_name(f"{name}.txt"))
        if record["status"] == 0:
            try:
                record["diagnosis"] = shorten_diagnosis(json.loads(answer.read_text()))
                # The spans held out of two drives are not those of one.
                if form != "drives":
                    record |= compare_with_truth(truth, record["diagnosis"])
            except (OSError, ValueError, KeyError, TypeError) as error:
                record |= {"status": "unreadable", "error": repr(error)}
    return record


def run_diagnosis(
    arguments: list[str], diagnosis_options: DiagnosisOptions, output: Path
) -> dict[str, Any]:
    """Run the command in a process of its own: exit status, seconds, peak memory."""
    # The imports are made once, in a server from which each diagnosis is forked.
    context = get_context("forkserver")
    context.set_forkserver_preload(["adhesion_can.cli.main", "adhesion_can.diagnosis.diagnose"])
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(
        target=_call, args=(diagnosis_options.entry, arguments, str(output), theirs)
    )
    process.start()
    theirs.close()
    found: dict[str, Any] = {
        "status": "timeout",
        "seconds": diagnosis_options.timeout_s,
        "rss_mb": None,
    }
    if ours.poll(diagnosis_options.timeout_s):
        try:
            found = ours.recv()
        except EOFError:
            found |= {"status": "died"}
    else:
        process.kill()
    process.join()
    if found["status"] != 0:
        with suppress(OSError):
            found["error"] = output.read_text(errors="replace")[-2000:]
    return found


def _call(entry: str, arguments: list[str], output: str, pipe: Any) -> None:
    """In the new process: all output of the command goes to a file."""
    out = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(out, 1)
    os.dup2(out, 2)
    began = time.perf_counter()
    try:
        module, _, function = entry.partition(":")
        status = getattr(importlib.import_module(module), function)(arguments)
    except SystemExit as left:
        status = left.code if isinstance(left.code, int) else 1
    except Exception:  # noqa: BLE001  whatever it was: it is the finding
        import traceback

        traceback.print_exc()
        status = "crashed"
    seconds = time.perf_counter() - began
    sys.stdout.flush()
    sys.stderr.flush()
    pipe.send({"status": status or 0, "seconds": round(seconds, 3), "rss_mb": _peak_mb()})


def _peak_mb() -> float:
    """Peak of this process alone: what getrusage says may be its parent's."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024
    raise OSError("no VmHWM in /proc/self/status")


def shorten_diagnosis(diagnosis: dict[str, Any]) -> dict[str, Any]:
    """What of a diagnosis is needed to judge it."""
    gain = diagnosis.get("gain") or {}
    extended = diagnosis.get("extended")
    return {
        "verdict": diagnosis["verdict"],
        "channel": diagnosis.get("channel"),
        "causes": [
            {key: cause.get(key) for key in ("effect", "form", "parameters", "p_value", "rivals")}
            for cause in diagnosis["causes"]
        ],
        "gain": {
            key: gain.get(key)
            for key in ("percent", "interval", "rmse_before", "rmse_after", "spans")
        },
        "extended": extended and {name: extended[name] for name in CURVE},
        # Keys that a diagnosis may have.
        **{key: diagnosis[key] for key in ("conclusive", "closest", "noise") if key in diagnosis},
    }


def compare_with_truth(truth: Truth, diagnosis: dict[str, Any]) -> dict[str, Any]:
    """Gain and noise floor as the world knows them, on what the diagnosis held out."""
    if truth.fresh:
        return {
            "true_gain": truth.fresh_gain_percent(),
            "floor": truth.fresh.noise_floor,
        }
    spans = diagnosis["gain"]["spans"]
    # Independent points have no times.
    if not spans or truth.kind.startswith(("points:", "car:")):
        return {"true_gain": None, "floor": None}
    held = [(float(begin), float(end)) for begin, end in spans]
    return {"true_gain": truth.true_gain_percent(held), "floor": truth.floor_on(held)}
