"""Settings of the observed speed, with the physics that each of them follows from."""

from dataclasses import dataclass
from typing import Annotated

from adhesion_can.ranges import Within, require_ranges
from adhesion_can.values import Value

Positive = Within(1e-9, 1e9)


@dataclass(frozen=True, slots=True, kw_only=True)
class ObservedSpeedSettings(Value):
    """Uncertainties that the filter assumes, and its conditions for a known slip.

    Attributes:
        block_s: Time over which readings are averaged before an update, s. Shorter than the ramp of
            a relief (0.1 to 0.2 s).
        wheel_std: Noise of a wheel speed, rad/s: quantisation and the encoder's jitter.
        effort_std: Noise of an effort relative to the axle load, 1: an inverter's estimate of the
            torque is specified as 1 to 2 % of the rated one.
        adhesion_bias: Lasting error of an adhesion, 1: a zero error of 0.5 kN to 1 kN at 245 kN.
        radius_std: Relative error of a wheel radius after calibration, 1: 0.2 % is 1.2 mm.
        level_std: Spread of the adhesion of axles at one slip, 1: contact and load.
        radius_wander: Change of a radius' error as a random walk, 1/√s: an equivalent conicity of
            0.1 makes 0.0005 of a lateral shift of 3 mm, which lasts for a curve or a minute.
        initial_slip: Slip expected before the first relief, 1.
        initial_slip_std: Standard deviation of that slip, 1. Common to all axles.
        axle_slip_std: Spread of the slips of axles before the first relief, 1.
        jump_std: Change of the slip of an axle at a change of the surface, 1; wheels may spin.
        excited_wander: Random walk of the slips just after a change of the surface, 1/√s, while the
            drive finds its new effort.
        settling_s: Time for which an axle is left out after the surface changed under it, s.
        gate: Number of standard deviations by which an axle deviates from the others where the
            surface has changed under it.
        half_slip: Slip a at which the curve's hyperbola μ = m λ/(a + λ) reaches half of m, 1,
            before a ramp has shown it: 0.0016 to 0.004 for Polach's dry, greasy and wet rails.
        half_std: Standard deviation of its logarithm.
        ramp_std: The same for what a ramp shows, by the form of the curve alone.
        half_wander: Change of that logarithm along ln μ as a random walk, 1.
        form_std: Error of a change of the slip along the hyperbola, as a share of it.
        apart_std: The same for the axles beside each other.
        beyond: d ln λ/d ln μ that is possible above the largest effort at which an axle was
            relieved, where no ramp has shown the curve.
        level_wander: Change of the adhesion of the rail along 100 m as a random walk, 1. Common to
            all axles; drives over wet rails scatter by several percent.
        axle_wander: Like `level_wander`, of one axle against the others, 1.
        free_compliance: dλ/dμ of an axle that hardly pulls, 1: Kalker's clean contact has 0.004,
            contaminated rails up to 0.05.
        free_compliance_std: Standard deviation of that compliance, 1.
        free_adhesion: Adhesion below which an axle counts as free, 1.
        acceleration_std: Disturbance acceleration before anything is known, m/s²: 10 ‰ of gradient.
        acceleration_wander: Change of the disturbance acceleration along 100 m as a random walk,
            m/s²: gradients change by some ‰ over several hundred metres, and the length of the
            train smooths them.
        speed_wander: Random walk of the speed beside all forces, m/s/√s: couplers.
        mass_std: Relative error of the mass of the train, 1.
        surge_share: Speed that a change of the effort gives the locomotive until the couplers hold
            it, as a share of Δforce/(m ω), with the mass m of the locomotive.
        coupler_frequency: Angular frequency ω of the locomotive on its coupler, rad/s.
        gnss_std: Noise of a GNSS speed, m/s.
        accelerometer_std: Noise of an acceleration over a block, m/s².
        relief_s: Time for which an axle must have been free, s.
        relief_valid_s: Time after which a relief is too old, s.
        effort_change: Largest ln μ above the last relief's, 1. Beyond it the curve is not known;
            below, the ramps have shown it.
        slip_std: Largest standard deviation of the slip that counts as known, 1.

    """

    block_s: Annotated[float, Within(0.001, 1)] = 0.05
    wheel_std: Annotated[float, Positive] = 0.003
    effort_std: Annotated[float, Positive] = 0.012
    adhesion_bias: Annotated[float, Positive] = 0.003
    radius_std: Annotated[float, Positive] = 0.002
    level_std: Annotated[float, Positive] = 0.055
    radius_wander: Annotated[float, Positive] = 5e-5
    initial_slip: Annotated[float, Positive] = 0.010
    initial_slip_std: Annotated[float, Positive] = 0.015
    axle_slip_std: Annotated[float, Positive] = 0.006
    jump_std: Annotated[float, Positive] = 0.1
    excited_wander: Annotated[float, Positive] = 0.003
    settling_s: Annotated[float, Within(0, 10)] = 0.3
    gate: Annotated[float, Within(1, 100)] = 5.0
    half_slip: Annotated[float, Positive] = 0.0027
    half_std: Annotated[float, Positive] = 0.5
    ramp_std: Annotated[float, Positive] = 0.3
    half_wander: Annotated[float, Positive] = 0.6
    form_std: Annotated[float, Positive] = 0.5
    apart_std: Annotated[float, Positive] = 2.0
    beyond: Annotated[float, Positive] = 3.0
    level_wander: Annotated[float, Positive] = 0.026
    axle_wander: Annotated[float, Positive] = 0.015
    free_compliance: Annotated[float, Positive] = 0.02
    free_compliance_std: Annotated[float, Positive] = 0.015
    free_adhesion: Annotated[float, Within(0, 0.1)] = 0.015
    acceleration_std: Annotated[float, Positive] = 0.1
    acceleration_wander: Annotated[float, Positive] = 0.025
    speed_wander: Annotated[float, Positive] = 0.004
    mass_std: Annotated[float, Positive] = 0.08
    surge_share: Annotated[float, Within(0, 10)] = 0.7
    coupler_frequency: Annotated[float, Positive] = 10.0
    gnss_std: Annotated[float, Positive] = 0.05
    accelerometer_std: Annotated[float, Positive] = 0.05
    relief_s: Annotated[float, Within(0.01, 10)] = 0.5
    relief_valid_s: Annotated[float, Positive] = 25.0
    effort_change: Annotated[float, Positive] = 0.1
    slip_std: Annotated[float, Positive] = 0.002

    def __post_init__(self) -> None:
        require_ranges(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class ObservedSpeedSwitch(Value):
    """Vehicle speed that wheels and efforts show, in place of a measured one.

    Attributes:
        enabled: Whether the vehicle speed is observed. The driver or the drive has to relieve an
            axle now and then, unless the role `gnss_speed` shows the speed; roles `vehicle_speed`
            and `vehicle_speed_source` are not used.
        gnss_std: Standard deviation of the role `gnss_speed`, m/s. A delay counts as well: 0.2 s at
            0.3 m/s² are 0.06 m/s.
        accelerometer_std: Standard deviation of the role `acceleration` in means of a second, m/s².

    """

    enabled: bool = False
    gnss_std: Annotated[float, Within(0.001, 10)] = 0.05
    accelerometer_std: Annotated[float, Within(0.001, 10)] = 0.05

    def __post_init__(self) -> None:
        require_ranges(self)

    @property
    def settings(self) -> ObservedSpeedSettings:
        """Settings of the filter."""
        return ObservedSpeedSettings(
            gnss_std=self.gnss_std, accelerometer_std=self.accelerometer_std
        )
