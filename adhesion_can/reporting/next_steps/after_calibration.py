"""What to do after a calibration."""

from collections.abc import Collection

from adhesion_can.calibration.agreement import differs
from adhesion_can.calibration.fit import AxleRadius, Calibration
from adhesion_can.reporting.next_steps.next_step import NextStep, Typed

CALIBRATED = "calibrated.toml"
"""Name of the configuration that the user has not named."""


def after_calibration(calibration: Calibration, typed: Typed, rim: Collection[int]) -> NextStep:
    """Whether the radii agree with the configuration, and what to do next.

    Args:
        calibration: Result of the calibration.
        typed: What the user typed.
        rim: Axles whose wheel speed is given as speed of the rim.

    """
    differing = [axle for axle in calibration.axles if differs(axle, calibration)]
    target = typed.outputs.get("--out")
    if not differing:
        return NextStep("The radii agree with the configuration.", typed.on_inputs("diagnose"))
    finding = " ".join(_describe(axle, rim) for axle in differing)
    if target is None:
        return NextStep(finding, typed.on_inputs("calibrate", "--out", CALIBRATED))
    # The database is in the new configuration.
    renewed = typed.with_configuration(target)
    return NextStep(finding, renewed.on_inputs("diagnose"))


def _describe(axle: AxleRadius, rim: Collection[int]) -> str:
    percent = 100.0 * (axle.ratio - 1.0)
    share = f"{abs(percent):.2f} % {'smaller' if percent < 0 else 'larger'} than configured"
    if axle.axle in rim:
        return f"Axle {axle.axle}'s wheel is {share} (its signal is a rim speed)."
    return (
        f"Axle {axle.axle}'s wheel is {share}: {axle.configured * axle.ratio:.4f} m, not "
        f"{axle.configured:.4f}."
    )
