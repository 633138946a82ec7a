"""A calibration as sentences, as a table and as JSON."""

from collections.abc import Collection
from math import inf

from adhesion_can.calibration.agreement import differs
from adhesion_can.calibration.coasting import SOFTEST_CONTACT, CalibrationSettings
from adhesion_can.calibration.fit import AxleRadius, CalibratedQuantity, Calibration
from adhesion_can.result_text import plus_minus

IMPLAUSIBLE = 0.1
"""Relative change of a radius beyond which it is no wear."""


def calibration_notes(
    result: Calibration, settings: CalibrationSettings, rim: Collection[int], reference: str
) -> list[str]:
    """Limits and assumptions of the figures, one sentence each."""
    notes = [
        f"Radii are relative to {reference}: its scale error is the same share of all of them."
    ]
    if result.effort_known:
        share = 100 * settings.adhesion_max / SOFTEST_CONTACT
        notes.append(
            f"An axle coasts if its adhesion is below {settings.adhesion_max:g}. The remaining "
            f"creep is up to {share:.2f} % of a radius on a greasy rail and is not in the "
            "standard errors. Brakes without a signal would add to it."
        )
    else:
        notes.append(
            "No role gives tractive effort, so coasting cannot be detected. The radii come from "
            f"spans of steady speed (within {settings.acceleration_max:g} m/s²) and contain the "
            "slip of traction."
        )
    notes += [
        f"Axle {axle.axle} keeps its radius: it coasts for {axle.coasting_s:.1f} s in "
        f"{axle.blocks} blocks of {settings.block_s:g} s; {settings.coasting_min_s:g} s in "
        f"{settings.blocks_min} blocks are needed."
        for axle in result.axles
        if axle.estimate is None
    ]
    notes += _not_identifiable(result, settings)
    if rim:
        axles = ", ".join(map(str, sorted(rim)))
        notes.append(
            f"Wheel speeds of axles {axles} are rim speeds, which their sender computes with its "
            "own radius. The radius given here would make them right; in the configuration, "
            "their factor is corrected."
        )
    notes += [
        f"Axle {axle.axle}: {100 * (axle.ratio - 1):+.1f} % is more than wear explains; check "
        "unit and wheel_radius_m."
        for axle in result.axles
        if abs(axle.ratio - 1) > IMPLAUSIBLE
    ]
    return notes


def agreement_line(result: Calibration) -> str:
    """Whether the radii agree with the configuration, in one or two sentences."""
    tested = [axle for axle in result.axles if axle.estimate is not None]
    other = [axle for axle in tested if differs(axle, result)]
    untested = [axle.axle for axle in result.axles if axle.estimate is None]
    if other:
        changes = ", ".join(f"axle {axle.axle} by {_change(axle)} %" for axle in other)
        line = f"The radii differ from the configuration: {changes}."
        if len(other) < len(tested):
            line += " The others agree within their uncertainty."
    else:
        largest = max(tested, key=lambda axle: abs(axle.ratio - 1))
        line = (
            "The radii agree with the configuration within their uncertainty: the largest change "
            f"is {_change(largest)} % at axle {largest.axle}."
        )
    return line + (
        f" Not tested: axle{'s' if len(untested) > 1 else ''} {', '.join(map(str, untested))}."
        if untested
        else ""
    )


def _change(axle: AxleRadius) -> str:
    """Change of a radius with its standard error, %."""
    std = axle.estimate.std if axle.estimate else inf
    return f"{100 * (axle.ratio - 1):+.3f} ± {100 * std / axle.configured:.3f}"


def _not_identifiable(result: Calibration, settings: CalibrationSettings) -> list[str]:
    """Sentences on an offset and a delay that were not estimated, with their effect."""
    speed = result.mean_speed
    low, high = result.speed_range
    notes = []
    if result.offset is None:
        notes.append(
            f"An offset of the vehicle speed is not identifiable (speeds {low:.1f} to {high:.1f} "
            f"m/s, {_would_be(result.offset_std, 'm/s')}) and is set to 0; an offset of 0.1 m/s "
            f"would change the radii by {100 * 0.1 / speed:.2f} %."
        )
    if result.delay is None and settings.delay_s is None:
        notes.append(
            "A delay of the vehicle speed is not identifiable "
            f"({_would_be(result.delay_std, 's')}) and is set to 0; a delay of 0.1 s would "
            f"change the radii by {abs(100 * 0.1 * result.mean_acceleration / speed):.2f} %."
        )
    return notes


def _would_be(std: float, unit: str) -> str:
    return "no bound" if std == inf else f"standard error would be {std:.2g} {unit}"


def radius_columns(result: Calibration) -> tuple[str, ...]:
    """Headings of the table of the radii."""
    kind = "coasting" if result.effort_known else "steady speed"
    return ("axle", "configured m", "radius m", "change %", f"{kind} s", "corrects")


def radius_rows(result: Calibration, rim: Collection[int]) -> list[tuple[str, ...]]:
    """Cells of the radii, a row per axle; `rim` has the axles with the speed of the rim."""
    return [
        (
            str(axle.axle),
            f"{axle.configured:.4f}",
            f"{axle.configured:.4f} ± ?"
            if axle.estimate is None
            else plus_minus(axle.estimate.value, axle.estimate.std, 5),
            "-" if axle.estimate is None else _change(axle),
            f"{axle.coasting_s:.1f}",
            "factor" if axle.axle in rim else "radius",
        )
        for axle in result.axles
    ]


def speed_lines(result: Calibration, settings: CalibrationSettings) -> list[str]:
    """Lines with the offset and the delay of the vehicle speed."""
    delay = _quantity_text(result.delay, "s")
    if settings.delay_s is not None:
        delay = f"{settings.delay_s:g} s, as given"
    return [
        f"offset of the vehicle speed: {_quantity_text(result.offset, 'm/s')}",
        f"delay of the vehicle speed: {delay}",
    ]


def _quantity_text(quantity: CalibratedQuantity | None, unit: str) -> str:
    if quantity is None:
        return "not identifiable"
    return f"{plus_minus(quantity.value, quantity.std)} {unit}"
