"""What a diagnosis draws, as plain arrays."""

from dataclasses import dataclass

from adhesion_can.arrays import Array


@dataclass(frozen=True, slots=True)
class Profile:
    """Mean residual over bins of a channel: shape (bins,) each.

    Attributes:
        channel: Name of the channel.
        unit: Unit of the channel.
        at: Mean of the channel in each bin, in the channel's unit.
        before: Mean residual of the plain model, adhesion in the direction of the effort.
        after: Mean residual of the extended model, adhesion in the direction of the effort.
        before_std: Standard error of `before`, adhesion.
        after_std: Standard error of `after`, adhesion.
        fitted: Mean change of the prediction by the extension, adhesion.

    """

    channel: str
    unit: str
    at: Array
    before: Array
    after: Array
    before_std: Array
    after_std: Array
    fitted: Array


@dataclass(frozen=True, slots=True)
class SimulationPlot:
    """Measured against simulated signals of one axle, for plots; shape (n,) each.

    Attributes:
        recording: Name of the recording.
        axle: Axle number.
        time_s: Time on the recording's clock, s.
        wheel_speed: Measured wheel speed, rad/s.
        simulated_before: Wheel speed that the plain model gives from measured effort and vehicle
            speed, rad/s; the simulation restarts at the measurement every `restart_s`.
        simulated_after: Wheel speed that the extended model gives from measured effort and vehicle
            speed, rad/s.
        adhesion: Measured adhesion.
        predicted_before: Adhesion that the plain model predicts from the measured slip.
        predicted_after: Adhesion that the extended model predicts from the measured slip.
        restart_s: Time between restarts of the simulation, s.

    """

    recording: str
    axle: int
    time_s: Array
    wheel_speed: Array
    simulated_before: Array
    simulated_after: Array
    adhesion: Array
    predicted_before: Array
    predicted_after: Array
    restart_s: float


@dataclass(frozen=True, slots=True)
class PredictionPlot:
    """Measured against predicted adhesion of a sample table: some of its rows; shape (n,) each.

    Attributes:
        measured: Measured adhesion.
        before: Adhesion that the plain model predicts.
        after: Adhesion that the extended model predicts.
        rows: Number of rows of which these are a part.

    """

    measured: Array
    before: Array
    after: Array
    rows: int


@dataclass(frozen=True, slots=True)
class CurveData:
    """Data of one surface for plots: some of its rows; shape (n,) each.

    Attributes:
        slip: Magnitude of the measured slip ratio.
        adhesion: Measured adhesion in the direction of the slip.
        corrected_slip: Magnitude of the slip ratio with the effects removed.
        corrected_adhesion: Adhesion in the direction of the slip with the effects removed.
        shape: Slip ratios and adhesions of the extended model's base curve where it is of another
            family than Burckhardt's, shape (2, k); None where it is his.

    """

    slip: Array
    adhesion: Array
    corrected_slip: Array
    corrected_adhesion: Array
    shape: Array | None = None


@dataclass(frozen=True, slots=True)
class PlotData:
    """What the page of a diagnosis draws, beside its figures.

    Attributes:
        simulations: Measured against simulated signals; none of a sample table.
        prediction: Measured against predicted adhesion of sample tables; None of recordings.
        curves: Data of the longest segment; None without data.

    """

    simulations: tuple[SimulationPlot, ...] = ()
    prediction: PredictionPlot | None = None
    curves: CurveData | None = None
