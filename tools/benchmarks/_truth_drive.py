"""One drive: make it, run the service over it, diagnose it, and run the service with its model."""

import io
import json
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from _truth_figures import Setpoints, judge

from tests.worlds import make_world

EVERY = 5
"""Each fifth setpoint is judged, 10 a second."""


def run_drive(task):
    """Record of a drive, fit for JSON; `task` has kind and seed, and perhaps a duration in s."""
    kind, seed, duration_s = task
    record = {"kind": kind, "seed": seed, "holdout": False, "duration_s": duration_s}
    began = time.perf_counter()
    with TemporaryDirectory(prefix="truth-") as folder:
        log, model = Path(folder) / "drive.log", Path(folder) / "model.toml"
        try:
            truth = make_world(kind, seed, log, duration_s=duration_s)
            record["truth"] = truth.to_dict()
            record["plain"] = measure(truth, log, None).to_dict()
            record["causes"] = diagnose(log, model)
            written = model if model.exists() else None
            record["model"] = measure(truth, log, written).to_dict()
        except Exception as error:  # noqa: BLE001  whatever it was: it is the finding
            record["error"] = repr(error)[:500]
    record["seconds"] = round(time.perf_counter() - began, 1)
    return record


def measure(truth, log, model, from_s=0.0, table=None):
    """Figures of the service over a drive from a time on, with an extended model or without.

    `table` has the setpoints where they are known already.
    """
    from adhesion_can import replay

    table = replay(log, model=model, from_s=from_s) if table is None else table
    columns = {name: column[::EVERY] for name, column in table.items()}
    there = truth.true_contact.at(columns["time_s"])
    return judge(
        Setpoints(
            t=columns["time_s"] - from_s,
            tracking=columns["status"] == "TRACKING",
            mu_max=columns["mu_max"],
            mu_max_std=columns["mu_max_std"],
            lambda_m=columns["lambda_m"],
            lambda_m_std=columns["lambda_m_std"],
            true_mu_max=there.mu_max,
            true_lambda_m=there.lambda_m,
            interior=there.interior,
            reached=there.reached(np.nan_to_num(columns["lambda_m"])),
        )
    )


def diagnose(log, model):
    """What `diagnose --extended` names."""
    from adhesion_can.cli.main import main

    answer = model.with_suffix(".json")
    words = ["diagnose", str(log), "--extended", str(model), "--json", str(answer)]
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(out):
        status = main(words)
    if status:
        raise RuntimeError(f"diagnose ended with {status}: {out.getvalue()[-300:]}")
    found = json.loads(answer.read_text())
    names = [cause["effect"] for cause in found["causes"]]
    if found["verdict"] == "unexplained":
        names.append(f"[{found['channel']}]")
    return names
