"""What a diagnosis says, as values: reports, JSON and the extended model are made from it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

from adhesion_can.arrays import Array
from adhesion_can.estimation.extended.estimator import ExtendedModel
from adhesion_can.physics.estimate import Estimate


class Verdict(StrEnum):
    """What came out."""

    NAMED = "named"
    NOTHING = "nothing_found"
    UNEXPLAINED = "unexplained"


@dataclass(frozen=True, slots=True)
class Value:
    """A parameter of a named effect: estimate, standard deviation, unit, meaning."""

    name: str
    value: float
    std: float | None
    unit: str
    meaning: str


@dataclass(frozen=True, slots=True)
class Cause:
    """A named effect.

    Attributes:
        effect: id.
        form: of the mechanism; '' where there is one.
        title: what happens, a clause.
        literature: where it is described.
        parameters: with their values.
        p_value: that chance alone makes it look as strong, all effects counted.
        rivals: ids of effects that the data cannot tell from it.

    """

    effect: str
    form: str
    title: str
    literature: str
    parameters: tuple[Value, ...]
    p_value: float
    rivals: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Gain:
    """What the extension gains on data that were not used to decide.

    Attributes:
        rmse_before: of the adhesion, plain model, held-out data.
        rmse_after: likewise, extended model.
        noise_floor: of the adhesion, what no model can go below.
        percent: 100 (1 − after/before).
        interval: of `percent`, 95 %.
        held_out: what was held out, in words.
        spans: (recording, from, to) of what was held out, s on the recording's clock.

    """

    rmse_before: float
    rmse_after: float
    noise_floor: float
    percent: float
    interval: tuple[float, float]
    held_out: str
    spans: tuple[tuple[str, float, float], ...]


@dataclass(frozen=True, slots=True)
class Evidence:
    """What the data say of one effect.

    Attributes:
        effect: id, and `form`, `axle` (0: none) besides.
        statistic: of the test.
        p_value: with all effects counted.
        absorbed: share of its signature that the curve's own parameters can imitate, 0..1.
        most_alike: effect whose signature is most like it, and the cosine between them.
        gain_percent: by which it alone would lower the RMSE of the data that decided.

    """

    effect: str
    form: str
    axle: int
    statistic: float
    p_value: float
    absorbed: float
    most_alike: tuple[str, float]
    gain_percent: float


class Untested(NamedTuple):
    """Something that the data cannot tell, and why, in words."""

    what: str
    why: str


@dataclass(frozen=True, slots=True)
class ChannelEvidence:
    """Dependence of what is left on one channel: p_value with all channels counted."""

    channel: str
    unit: str
    p_value: float
    gain_percent: float


@dataclass(frozen=True, slots=True)
class Surface:
    """A stretch of one rail: recording, s on its clock, the plain curve and the extended one's."""

    recording: str
    from_s: float
    to_s: float
    base: Estimate
    extended: Estimate


@dataclass(frozen=True, slots=True)
class Profile:
    """Mean residual over bins of a channel: shape (bins,) each.

    Attributes:
        channel: name.
        unit: of it.
        at: middle of each bin.
        before: mean residual of the plain model, adhesion, in the direction of the effort.
        after: of the extended one.
        before_std: standard error of `before`.
        after_std: likewise.
        fitted: by how much the extension changes the prediction there.

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
class Picture:
    """A stretch of one axle for the eye; shape (n,) each.

    Attributes:
        recording: name.
        axle: number.
        time_s: on the recording's clock.
        wheel_speed: measured, rad/s.
        simulated_before: by the plain model from measured effort and vehicle speed, begun anew
            every `restart_s`.
        simulated_after: by the extended one.
        adhesion: measured.
        predicted_before: by the plain model.
        predicted_after: by the extended one.
        restart_s: see `simulated_before`.

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
class CurveData:
    """Data of one surface: |λ| and μ of some of its rows, as they are and corrected."""

    slip: Array
    adhesion: Array
    corrected_slip: Array
    corrected_adhesion: Array


@dataclass(frozen=True)
class Diagnosis:
    """What a diagnosis found.

    Attributes:
        verdict: see there.
        causes: named effects, the strongest first; () where none is named.
        channel: for 'unexplained': what the residual depends on; None: nothing that was found.
        wrong: a plain sentence per finding, with size, unit and where.
        gain: None where the data could not carry a verdict at all.
        evidence: of every effect that was tested, by p-value and gain.
        channels: what is left in every channel when the named effects are in.
        needed: which manoeuvre or signal would separate the rivals; None: nothing is needed.
        untested: what could not be tested, and why.
        surfaces: stretches of one rail each.
        model: the extended model; None where there is no extension.
        profile: residual against the named channel.
        pictures: measured against simulated.
        curves: curve and data of the longest surface; None without data.
        samples: rows of each input that were used, by its name.
        lost: rows that were not, by reason.

    """

    verdict: Verdict
    causes: tuple[Cause, ...]
    channel: str | None
    wrong: tuple[str, ...]
    gain: Gain | None
    evidence: tuple[Evidence, ...]
    channels: tuple[ChannelEvidence, ...]
    needed: str | None
    untested: tuple[Untested, ...]
    surfaces: tuple[Surface, ...]
    model: ExtendedModel | None
    profile: Profile | None
    pictures: tuple[Picture, ...]
    curves: CurveData | None
    samples: Mapping[str, int] = field(default_factory=dict)
    lost: Mapping[str, int] = field(default_factory=dict)
