"""Picture of sizes by environment: an inertia that only imitates friction falling with heat."""

import sys
import tempfile
from pathlib import Path

import matplotlib as mpl
import numpy as np

from adhesion_can.api.configuration import as_configuration
from adhesion_can.api.diagnosis import list_input_files, load_inputs
from adhesion_can.diagnosis.drive.thinning import thin_drive
from adhesion_can.diagnosis.inference.split_hold_out import split_hold_out
from adhesion_can.diagnosis.refutation.environments import build_partitions
from adhesion_can.diagnosis.refutation.invariance import compute_sizes
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.find_surface_changes import (
    build_regression_data,
    fit_start_curves,
)
from adhesion_can.diagnosis.regression.prepare_regression import (
    choose_block_length,
    prepare_regression,
)
from adhesion_can.diagnosis.regression.whitened_regression import fit_model
from adhesion_can.physics.effects import effect_by_id
from tests.worlds import make_world

mpl.use("Agg")
from matplotlib import pyplot as plt

KIND, SEED = "mech:contact_heating", 1
IMITATES = "wheelset_inertia"
SHOWN = 5
"""Partitions that are drawn, those with the largest spread."""


def main(target):
    sizes, size, unit = compute()
    figure, axes = plt.subplots(figsize=(8.6, 4.6), layout="constrained")
    row, ticks, labels = 0, [], []
    for one in sizes[:SHOWN]:
        colour = "#d55e00" if one.refutes else "#0b5fa5"
        for label, value, std in zip(one.labels, one.sizes, one.stds, strict=True):
            axes.errorbar(value, row, xerr=1.96 * std, fmt="o", color=colour, capsize=3, ms=5)
            ticks.append(row)
            labels.append(label)
            row += 1
        row += 0.7
    axes.axvline(size, color="#1b2430", lw=1.1, ls=":")
    axes.set_yticks(ticks, labels, fontsize=8)
    axes.invert_yaxis()
    axes.set_xlabel(f"error of the wheelset's inertia, {unit} (95 % intervals; dotted: all rows)")
    figure.savefig(target, dpi=110)
    print(f"wrote {Path(target).name}")


def compute():
    """Sizes of the imitation by environment, its size in all rows, and the unit."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drive.log"
        make_world(KIND, SEED, path)
        files = list_input_files([path])
        loaded = load_inputs(files, as_configuration(None), lambda _work, _share: None)
    drives = (thin_drive(loaded[0].drive),)
    candidates = (Candidate(effect_by_id(IMITATES)),)
    length_s = choose_block_length(drives)
    data = build_regression_data(drives, [[]])
    block = split_hold_out(drives, [False], length_s)
    start = fit_start_curves(data)
    regression = prepare_regression(data, start, block, candidates, length_s)
    plain = regression.plain.model
    rows = regression.regression.last_fit
    model = fit_model(rows, plain.with_effect(candidates[0])).model
    slip = rows.evaluate_corrected(model).slip
    sizes = compute_sizes(rows, model, 0, build_partitions(data, slip))
    (value,), parameter = model.values[0], candidates[0].free_parameters[0]
    return sizes, float(np.asarray(value)), parameter.unit.replace("^2", "²")


if __name__ == "__main__":
    main(sys.argv[1])
