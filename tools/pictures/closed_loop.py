"""Picture of creep control: force and slip on five rails in a minute, ours beside three others."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
from _pulling_cases import CASES
from _pulling_runs import OURS, Task, pull

CASE = "5 changes a minute"
LINES = {
    "threshold": ("#8a8a8a", 0.9, "creep threshold"),
    "fixed slip": ("#3a7d44", 0.9, "fixed slip of 5 %"),
    "perturb and observe": ("#d9731a", 0.9, "perturb and observe"),
    OURS: ("#1f5fa8", 1.8, "ours"),
}
RAILS = ("dry", "wet", "(0.40, 200, 0.30)", "greasy", "(0.10, 15, 0.02)")
SHADES = ("#f6f0e2", "#dfeaf5", "#eeeeee", "#e6e3d2", "#f4e6e6")
SECTION_S = 12.0


def main(target: Path) -> None:
    """Run the controllers, and draw the picture.

    Args:
        target: File to write.

    """
    number = [case.name for case in CASES].index(CASE)
    draw({name: pull(Task(number, name, traced=True)) for name in LINES}, target)


def draw(rows: Mapping[str, Mapping[str, Any]], target: Path) -> None:
    """Draw the picture.

    Args:
        rows: Rows of the bench with their traces, by controller.
        target: File to write.

    """
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(9, 5.2), sharex=True, dpi=110)
    for section, (rail, shade) in enumerate(zip(RAILS, SHADES, strict=True)):
        begin = section * SECTION_S
        for axes in (top, bottom):
            axes.axvspan(begin, begin + SECTION_S, color=shade, lw=0)
        top.text(begin + SECTION_S / 2, 1.04, rail, ha="center", color="#555555", fontsize=9)
    for name, (colour, width, label) in LINES.items():
        trace = rows[name]["trace"]
        share = f"{label}: {100 * rows[name]['utilisation']:.0f} %"
        for axes, column in ((top, "force_share"), (bottom, "slip")):
            axes.plot(trace["time_s"], trace[column], color=colour, lw=width, label=share)
    peak = rows[OURS]["trace"]
    bottom.plot(
        peak["time_s"], peak["lambda_m"], color="black", lw=1.2, ls=(0, (4, 3)), label="peak"
    )
    top.set(ylabel="force over available", ylim=(0.0, 1.12), xlim=(0, SECTION_S * len(RAILS)))
    bottom.set(ylabel="median slip ratio λ", xlabel="time, s", yscale="log", ylim=(0.004, 0.6))
    bottom.set_yticks(
        [0.005, 0.02, 0.05, 0.1, 0.2, 0.5], ["0.005", "0.02", "0.05", "0.1", "0.2", "0.5"]
    )
    bottom.set_yticks(np.array([]), minor=True)
    top.legend(
        loc="lower left",
        bbox_to_anchor=(0.195, 0.01),
        fontsize=8,
        framealpha=0.9,
        title="share of the force, mean",
        title_fontsize=8,
    )
    handles, labels = bottom.get_legend_handles_labels()
    bottom.legend(handles[-1:], labels[-1:], loc="lower left", fontsize=8, framealpha=0.9)
    for axes in (top, bottom):
        axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(target)
    plt.close(figure)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
