"""Picture of the README: a closed-loop run across four rails."""

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from pictures import closed_loop

from adhesion_can.config import load_configuration
from adhesion_can.physics.status import Status
from adhesion_can.service.core import ServiceCore
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name

DURATION_S = 42.0
BLUE, ORANGE, GREY = "#1f5fa8", "#d9731a", "#555555"
SHADES = {"dry": "#f6f0e2", "wet": "#dfeaf5", "greasy": "#e6e3d2"}


def simulate():
    config = load_configuration()
    settings = RunSettings(scenario_by_name("dry-wet-greasy-dry"), DURATION_S, obey=True)
    simulation = Simulation(settings, config.database)
    rows, slips = [], []
    core = ServiceCore(config, on_setpoint=lambda t, out: rows.append((t / 1e6, out)))
    for frames in simulation.run():
        for frame in frames:
            for answer in core.feed(frame):
                simulation.receive(answer)
        slips.append((simulation.now_us / 1e6, float(simulation.plant.slip[0])))
    return simulation.truth()["surfaces"], rows, np.array(slips)


def estimate_panel(axes, rows, value, std, label):
    known = [(t, out) for t, out in rows if value(out) is not None]
    times = np.array([t for t, _ in known])
    middle = np.array([value(out) for _, out in known])
    spread = np.minimum([1.96 * std(out) for _, out in known], 1.0)
    axes.fill_between(times, middle - spread, middle + spread, color=BLUE, alpha=0.25, lw=0)
    axes.plot(times, middle, color=BLUE, lw=1.6, label="estimate, 95 %")
    axes.set_ylabel(label)


def main():
    surfaces, rows, slips = simulate()
    figure, (top, middle, bottom) = plt.subplots(3, 1, figsize=(9, 6.2), sharex=True, dpi=130)
    for surface in surfaces:
        span = (surface["from_s"], surface["to_s"])
        for axes in (top, middle, bottom):
            axes.axvspan(*span, color=SHADES[surface["name"]], lw=0)
        top.text(sum(span) / 2, 0.455, f"{surface['name']} rail", ha="center", color=GREY)
        for axes, name in ((top, "mu_max"), (middle, "lambda_m")):
            axes.plot(span, [surface[name]] * 2, color="black", lw=1.2, ls=(0, (4, 3)))
    top.plot([], [], color="black", lw=1.2, ls=(0, (4, 3)), label="truth")
    estimate_panel(top, rows, lambda o: o.setpoint.mu_max, lambda o: o.mu_max_std, "μ_max")
    estimate_panel(middle, rows, lambda o: o.setpoint.lambda_m, lambda o: o.lambda_m_std, "λ_m")
    bottom.plot(*slips.T, color=ORANGE, lw=0.8, label="slip of axle 1")
    changes = [t for t, out in rows if out.status is Status.SURFACE_CHANGE]
    bottom.plot(changes, [0.215] * len(changes), "|", color="black", ms=5, label="SURFACE_CHANGE")
    bottom.set_ylabel("slip ratio λ")
    bottom.set_xlabel("time, s")
    top.set_ylim(0.05, 0.5)
    middle.set_ylim(0.04, 0.14)
    bottom.set_ylim(0, 0.24)
    bottom.set_xlim(0, DURATION_S)
    for axes in (top, bottom):
        axes.legend(loc="lower right", fontsize=8, framealpha=0.9)
    for axes in (top, middle, bottom):
        axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    target = Path(sys.argv[1])
    figure.savefig(target)
    print(f"wrote {target.name}")
    closed_loop.main(target.with_name("closed_loop.png"))
    print("wrote closed_loop.png")


if __name__ == "__main__":
    main()
