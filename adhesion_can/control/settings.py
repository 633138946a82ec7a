"""Settings of the reference creep controller."""

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class LoopSettings:
    """Gains and limits of the creep speed control of an axle.

    Attributes:
        cycle_s: Time between two steps, s.
        bandwidth: Crossover frequency at the peak of the curve, where the wheelset is an
            integrator, rad/s. Larger: quicker; above 80 the dead time of a cycle makes it swing.
        integral_rate: Zero of the PI controller, 1/s.
        stable_rate: Bandwidth on the stable side, where the contact is stiff, 1/s.
        effort_max: Largest effort of an axle, N.
        rise_max: Largest rate of a rising effort, N/s.
        fall_max: Largest rate of a falling effort, N/s.

    """

    cycle_s: float = 0.01
    bandwidth: float = 58.0
    integral_rate: float = 20.0
    stable_rate: float = 6.0
    effort_max: float = 120e3
    rise_max: float = 300e3
    fall_max: float = 1e6


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """Search of the peak by pairs of axles at two slips at once.

    Attributes:
        spread: Relative distance of both slips from their mean. Larger: surer, at a larger loss of
            force, which grows with its square.
        near_spread: The same near the peak.
        dwell_s: Time for which a pair keeps its two slips, s.
        gain: Relative change of the slip per unit of elasticity.
        goal: Elasticity d ln μ/d ln λ to search for at small slips. Larger: less slip, less force.
        slip_price: What is added to it as a multiple of the slip ratio λ. With 1, force times 1 − λ
            is greatest: the share of the wheels' power that moves the train. Less: more force.
        step_max: Largest relative change of the slip in a step, logarithm.
        step_min: Largest change of the slip near the peak, logarithm.
        slip_min: Smallest slip ratio.
        slip_max: Largest slip ratio.

    """

    spread: float = 0.15
    near_spread: float = 0.09
    dwell_s: float = 0.2
    gain: float = 2.0
    goal: float = 0.012
    slip_price: float = 0.25
    step_max: float = 0.6
    step_min: float = 0.12
    slip_min: float = 0.004
    slip_max: float = 0.4


@dataclass(frozen=True, slots=True)
class ExcursionSettings:
    """Excursions that keep the curve known while it is held.

    Attributes:
        duration_s: Duration of an excursion of one axle, s.
        period_s: Time from one excursion to the next while the service knows the peak, s.
        busy_period_s: The same while it does not, s.
        low: Slip of the lower plateau over λ_m.
        high: Slip of the upper plateau over λ_m; λ_m is identifiable only from slips beyond it.
        contradiction: Difference between measured and expected contrast of the plateaus, over
            μ_max, from which the curve counts as contradicted, where it is significant.
        contradictions: Number of excursions in a row that contradict the curve before it is given
            up.

    """

    duration_s: float = 1.2
    period_s: float = 3.0
    busy_period_s: float = 1.6
    low: float = 0.6
    high: float = 1.2
    contradiction: float = 0.05
    contradictions: int = 2


@dataclass(frozen=True, slots=True)
class ReliefSettings:
    """Reliefs that show the vehicle speed where no radar does.

    Attributes:
        enabled: Whether axles are relieved.
        period_s: Time from the end of a relief to the next one, s; each axle has its turn.
        free_s: Time without effort, s; the filter of the speed needs 0.5.
        ramp_s: Time in which the effort is given up, and taken back, s. Below 0.4: the filter takes
            what lasts longer for another effort. 120 kN within 0.35 s are 340 kN/s.
        pause_s: Least time between two reliefs, s, whatever asks for them.
        change_wait_s: Time after a change of the surface until the next relief, s: the change has
            to pass under all axles.

    """

    enabled: bool = False
    period_s: float = 20.0
    free_s: float = 0.7
    ramp_s: float = 0.35
    pause_s: float = 3.0
    change_wait_s: float = 1.0


@dataclass(frozen=True, slots=True)
class SwingSettings:
    """What is done where the creep speeds swing about their setpoints.

    Attributes:
        time_constant_s: Time constant of the mean error, s.
        error_max: Largest mean of |error|/setpoint over time and axles, each limited to 1. A change
            of the rail brings 0.2 for a moment.
        hold_s: Time for which one slip is held then, s; twice as long each time, and half as long
            again after as much time without swings.
        bandwidth_first: Factor of the loop's bandwidth from then on.
        back_off: Factor of the slip and of the bandwidth where it swings all the same.
        bandwidth_min: Smallest factor of the bandwidth.
        climb_s: Time between two steps of the slip, s.
        climb: Size of these steps, logarithm.
        slip_min: Smallest slip ratio.
        slip_max: Largest slip ratio.

    """

    time_constant_s: float = 0.7
    error_max: float = 0.35
    hold_s: float = 60.0
    bandwidth_first: float = 0.4
    back_off: float = 0.7
    bandwidth_min: float = 0.3
    climb_s: float = 1.0
    climb: float = 0.08
    slip_min: float = 0.004
    slip_max: float = 0.4


@dataclass(frozen=True, slots=True)
class ControlSettings:
    """Settings of the reference creep controller.

    Attributes:
        target_share: Share of μ_max that the held slip aims at.
        caution: Share of the standard deviation of λ_m by which the held slip stays below.
        trusted_std: Largest relative standard deviation of a λ_m that is held.
        agreement: Largest logarithm of the ratio of the service's slip to the one that the search
            found, up to which the service's is held.
        distrust_s: Time for which a curve that excursions contradicted is not held again, s.
        first_slip: Slip ratio at which the search starts.
        first_rate: Rate at which the slip rises to it, 1/s.
        slow_speed: Vehicle speed below which a small slip is held and nothing is searched, m/s:
            speeds are too inexact there.
        slow_slip: That slip ratio.
        slow_floor: Smallest speed in the creep of that slip, m/s.
        speed_timeout_s: Time for which a missing vehicle speed is extrapolated, s.
        loop: Creep speed control of an axle.
        search: Search of the peak.
        excursions: Excursions while the service's slip is held.
        reliefs: Reliefs of one axle at a time, off by default.
        swing: Reaction to creep speeds that swing.

    """

    target_share: float = 0.998
    caution: float = 0.15
    trusted_std: float = 0.3
    agreement: float = 0.4
    distrust_s: float = 20.0
    first_slip: float = 0.03
    first_rate: float = 0.25
    slow_speed: float = 1.5
    slow_slip: float = 0.04
    slow_floor: float = 0.4
    speed_timeout_s: float = 1.0
    loop: LoopSettings = field(default_factory=LoopSettings)
    search: SearchSettings = field(default_factory=SearchSettings)
    excursions: ExcursionSettings = field(default_factory=ExcursionSettings)
    reliefs: ReliefSettings = field(default_factory=ReliefSettings)
    swing: SwingSettings = field(default_factory=SwingSettings)
