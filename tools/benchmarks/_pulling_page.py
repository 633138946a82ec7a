"""Page of the controllers' runs: figures, goals and the traces of every case."""

from _pulling_cases import CASES
from _pulling_runs import MAKERS, OURS
from _rival_controllers import Oracle

from adhesion_can.reporting.charts import DARK, panel_layout, place
from adhesion_can.reporting.page import Figure, Page, Table
from adhesion_can.version import __version__

COLOURS = dict(
    zip(MAKERS, (DARK, "#009e73", "#cc79a7", "#8a95a3", "#d55e00", "#b8860b", "#0b5fa5"),
        strict=True)
)  # fmt: skip
DASHES = {Oracle.name: "dot", OURS: "solid"}
SHOWN = (Oracle.name, OURS)
"""Controllers whose lines are drawn from the start; the others wait in the legend."""
HEIGHT = 560
PANELS = (
    ("force_share", "force share", [0.5, 1.05]),
    ("slip", "slip ratio", None),
    ("largest_over_peak", "largest / peak", [0.0, 4.0]),
)


def make_page(numbers, found, report, seed):
    """The page.

    Args:
        numbers: Numbers of the cases.
        found: Rows with traces by (case, controller).
        report: Report that has judged them.
        seed: Seed of the sensors.

    """
    names = [CASES[number].name for number in numbers]
    met = sum(check["met"] for check in report.checks)
    verdict = [f"{met} of {len(report.checks)} goals met."]
    verdict += [f"Missed: {check['what']}, {check['value']}." for check in report.checks
                if not check["met"]]  # fmt: skip
    sections = {
        "Figures": [_table(names, found)],
        "Goals": [_goals(report)],
        **{name[0].upper() + name[1:]: [_figure(name, found)] for name in names},
    }
    return Page(
        "Creep control in closed loop",
        "The reference creep controller beside others on the same rails, by the frames of one bus.",
        verdict,
        sections,
        {"version": __version__, "command": f"tools/bench closed-loop --seed {seed}"},
    )


def _table(names, found):
    rows = []
    for name in names:
        cells = [found[name, controller] for controller in MAKERS]
        texts = [f"{100 * x['utilisation']:.1f} / {100 * x['slip_energy']:.1f}" for x in cells]
        rows.append([name, *texts])
    note = (
        "Utilisation is the mean force over the mean of the smaller of the available adhesion and "
        "the motors' limit, from the start on. Slip energy is that of all axles over the work of "
        "their forces."
    )
    caption = "Utilisation, % / energy lost in slip, % of the work."
    return Table(caption, ["case", *MAKERS], rows, note)


def _goals(report):
    rows = [
        [check["what"], check["value"], check["target"], "met" if check["met"] else "MISSED"]
        for check in report.checks
    ]
    return Table("Figures beside the goals.", ["figure", "value", "goal", "result"], rows)


def _figure(case, found):
    data = []
    for row, (column, _, _) in enumerate(PANELS):
        for name in MAKERS:
            trace = found[case, name]["trace"]
            data.append({
                "type": "scatter", "mode": "lines", "name": name, "legendgroup": name,
                "showlegend": row == 0, "x": trace["time_s"], "y": trace[column], **place(row),
                "line": {"color": COLOURS[name], "dash": DASHES.get(name, "solid"), "width": 1.4},
                "visible": True if name in SHOWN else "legendonly",
            })  # fmt: skip
    trace = found[case, OURS]["trace"]
    for column, dash in (("lambda_m", "dash"), ("setpoint", "dot")):
        data.append({
            "type": "scatter", "mode": "lines", "x": trace["time_s"], "y": trace[column],
            "name": {"lambda_m": "peak", "setpoint": "setpoint of ours"}[column], **place(1),
            "line": {"color": COLOURS[OURS] if column == "setpoint" else "#8a95a3", "dash": dash,
                     "width": 1.2},
        })  # fmt: skip
    axes = [
        {"title": {"text": title}} | ({"range": limits} if limits else {"rangemode": "tozero"})
        for _, title, limits in PANELS
    ]
    layout = panel_layout(axes, "time, s", HEIGHT)
    caption = (
        "Force of all axles over what is available; median slip of the axles beside that of the "
        "peak; largest slip of an axle over that of its peak. Means over 0.2 s, of the last the "
        "largest. The legend shows and hides a controller."
    )
    return Figure(caption, data, layout, HEIGHT)
