"""Words of the page of a fleet: whose finding it is, its size, what is not shown."""

from adhesion_can.diagnosis.formatting import axis_scale, measured
from adhesion_can.fleet.findings import FleetFinding
from adhesion_can.fleet.pooled_size import PooledSize
from adhesion_can.physics.effects.instrument_errors import SPEED_SCALE, WHEEL_RADIUS
from adhesion_can.plurals import counted

MOST_ROWS = 60
"""Largest number of rows of a table, that of the vehicles aside."""
RELATIVE = frozenset({WHEEL_RADIUS, SPEED_SCALE})
"""Effects whose size is a relative error, shown in percent."""
UNITS = {"1/%": "per %", "1/K": "per K", "1/s": "per s"}
"""Units that are written otherwise."""


def owner(finding: FleetFinding) -> str:
    """Whose a finding is: all vehicles, a line, else by its name."""
    kind = f" ({finding.where})" if finding.where else ""
    names = {"fleet": f"All vehicles{kind}", "line": f"Line {finding.where}"}
    return names.get(str(finding.scope), finding.where)


def format_size(finding: FleetFinding) -> str:
    """Size of a finding with standard error and unit; to first order where no unit has another."""
    if finding.pooled is not None:
        return format_pooled(finding.pooled)
    factor, unit = _scale(finding.effect, finding.unit)
    return f"about {factor * finding.value:.2g} {unit}".strip() + " (first order)"


def format_pooled(size: PooledSize) -> str:
    """Mean size with standard error and unit."""
    return format_value(size, size.value, size.std)


def format_value(size: PooledSize, value: float, std: float) -> str:
    """A size with standard error and unit; an error of a ratio in percent."""
    factor, unit = _scale(size.effect, size.unit)
    return measured(factor * value, factor * std, unit)


def size_axis(size: PooledSize) -> tuple[float, str]:
    """Factor of the numbers on an axis, and its title: parameter, power of ten and unit."""
    factor, unit = _scale(size.effect, size.unit)
    power, text = axis_scale(factor * size.value, unit)
    return factor * power, f"{size.parameter}, {text}" if text else size.parameter


def _scale(effect: str, unit: str) -> tuple[float, str]:
    if effect in RELATIVE:
        return 100.0, "%"
    return 1.0, UNITS.get(unit, unit)


def format_gain(finding: FleetFinding) -> str:
    """Gain of a finding, %; '-' where there is none."""
    if finding.gain_percent is None:
        return "-"
    return f"{finding.gain_percent:.1f}{'' if finding.held_out else ' (same rows)'}"


def left_out(count: int, shown: int, noun: str, where: str = "fleet.json") -> str:
    """Sentence on the rows that a table does not show; '' where it shows all.

    Args:
        count: Number of rows that there are.
        shown: Largest number of rows that the table shows.
        noun: What a row is, in singular.
        where: Where all of them are.

    """
    if count <= shown:
        return ""
    more = counted(count - shown, f"further {noun}")
    return f"{more} {'is' if count - shown == 1 else 'are'} not shown; all are in {where}."
