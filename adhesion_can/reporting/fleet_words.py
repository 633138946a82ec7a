"""Words of the page of a fleet: whose finding it is, its size, what is not shown."""

from typing import TYPE_CHECKING

import numpy as np

from adhesion_can.physics.effects.speed_scale import SpeedScale
from adhesion_can.physics.effects.wheel_radius import WheelRadius
from adhesion_can.plurals import counted

if TYPE_CHECKING:
    from adhesion_can.fleet.findings import Finding

MOST_ROWS = 60
"""Largest number of rows of a table, that of the vehicles aside."""
RELATIVE = frozenset({WheelRadius().id, SpeedScale().id})
"""Effects whose size is a relative error, shown in percent."""
UNITS = {"1": "", "1/%": "per %", "1/K": "per K", "1/s": "per s"}
"""Units that are written otherwise."""


def owner(finding: "Finding") -> str:
    """Whose a finding is: all vehicles, a line, else by its name."""
    kind = f" ({finding.where})" if finding.where else ""
    names = {"fleet": f"All vehicles{kind}", "line": f"Line {finding.where}"}
    return names.get(str(finding.scope), finding.where)


def format_size(finding: "Finding") -> str:
    """Size with its standard error to two digits, and unit; an error of a ratio in percent."""
    relative = finding.effect in RELATIVE
    factor = 100.0 if relative else 1.0
    unit = "%" if relative else UNITS.get(finding.unit, finding.unit)
    value, std = factor * finding.value, factor * finding.std
    if not (np.isfinite(std) and std > 0.0):
        return f"{value:.3g} {unit}".strip()
    digits = int(np.floor(np.log10(std))) - 1
    if -6 <= digits <= 2:
        decimals = max(-digits, 0)
        return f"{value:.{decimals}f} ± {std:.{decimals}f} {unit}".strip()
    return f"{value:.3g} ± {std:.2g} {unit}".strip()


def format_gain(finding: "Finding") -> str:
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
