"""Result of a diagnosis as plain values, from which reports and JSON are made."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from enum import Flag, StrEnum, auto
from html import escape
from pathlib import Path
from typing import Any

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.cause_result import (
    Cause,
    ClosestExplanation,
    EnvironmentSizes,
    NoiseResult,
    Witness,
)
from adhesion_can.diagnosis.effect_grams import EffectGrams
from adhesion_can.diagnosis.evidence import ChannelEvidence, Evidence, ModelScore, Untested
from adhesion_can.diagnosis.next_drive.explanations import Explanation
from adhesion_can.diagnosis.next_drive.remaining import RemainingExplanations
from adhesion_can.diagnosis.next_drive.result import NextDrive
from adhesion_can.diagnosis.plot_result import CurveData, PredictionPlot, Profile, SimulationPlot
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.estimate import Estimate
from adhesion_can.result_text import html_table, plus_minus

MUCH_LEFT = 1.5
"""RMSE over the noise floor from which what the plain curve leaves is not called noise."""


@dataclass(frozen=True, slots=True)
class InputFile:
    """An input file of a diagnosis.

    Attributes:
        path: Path of the file.
        name: Name of the file in the diagnosis.
        sha256: SHA-256 of the file's bytes, hexadecimal.
        held_out: Whether the user gave the file for the gain alone.

    """

    path: Path
    name: str
    sha256: str
    held_out: bool = False


class Verdict(StrEnum):
    """Verdict of a diagnosis."""

    NAMED = "named"
    NOTHING = "nothing_found"
    UNEXPLAINED = "unexplained"


@dataclass(frozen=True, slots=True)
class Comparison:
    """RMSE of the adhesion of a model beside that of the plain curve.

    Attributes:
        rmse: RMSE of the model.
        percent: Gain over the plain curve, %.
        interval: 95 % interval of the gain, %; infinite where there are too few spans.
        plain: RMSE of the plain curve.

    """

    rmse: float
    percent: float
    interval: tuple[float, float]
    plain: float

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {"rmse": self.rmse, "percent": self.percent, "interval": list(self.interval)}


class GainMethod(Flag):
    """How a gain and its interval were computed, where not plainly over the units."""

    PLAIN = 0
    WITHOUT_SPEED_ERRORS = auto()
    WHERE_IT_ACTS = auto()

    @property
    def note(self) -> str:
        """What is said of it behind what was held out; '' for the plain gain."""
        return "".join(_METHOD_NOTES[one] for one in self)

    @property
    def names(self) -> list[str]:
        """As JSON has it."""
        return [str(one.name).lower() for one in self]


_METHOD_NOTES = {
    GainMethod.WITHOUT_SPEED_ERRORS: ("; vehicle-speed errors that all axles share are removed"),
    GainMethod.WHERE_IT_ACTS: (
        "; the interval is that of the gain on these data, where the models differ"
    ),
}


@dataclass(frozen=True, slots=True)
class Gain:
    """Gain of the extended model on held-out data.

    Attributes:
        rmse_before: RMSE of the plain model's adhesion on the held-out data.
        rmse_after: RMSE of the extended model's adhesion on the held-out data.
        noise_floor: RMSE on the deciding data with the effects and a spline in every channel.
        percent: Gain 100 (1 − after/before), %.
        interval: 95 % confidence interval of the gain, %.
        units: Description of the data that were held out, a clause.
        spans: Recording, start and end of each held-out span, s on the recording's clock.
        as_written: The model as written, where whole recordings were held out; there
            `rmse_after` is that with the curve refitted. None elsewhere.
        method: How gain and interval were computed.
        whole: Whether whole recordings were held out.

    """

    rmse_before: float
    rmse_after: float
    noise_floor: float
    percent: float
    interval: tuple[float, float]
    units: str
    spans: tuple[tuple[str, float, float], ...]
    as_written: Comparison | None = None
    method: GainMethod = GainMethod.PLAIN
    whole: bool = False

    @property
    def held_out(self) -> str:
        """Description of the data that were held out and of how they were used, a clause."""
        return self.units + self.method.note

    @property
    def leaves_much(self) -> bool:
        """Whether the plain model leaves far more than noise."""
        return self.rmse_before > MUCH_LEFT * self.noise_floor

    def to_dict(self) -> dict[str, Any]:
        """Fields of `diagnosis.json`."""
        document: dict[str, Any] = {
            "rmse_before": self.rmse_before,
            "rmse_after": self.rmse_after,
            "noise_floor": self.noise_floor,
            "percent": self.percent,
            "interval": list(self.interval),
            "held_out": self.held_out,
            "method": self.method.names,
            "spans": [[begin, end] for _, begin, end in self.spans],
            "recordings": [recording for recording, _, _ in self.spans],
        }
        written = self.as_written
        if written is not None:
            document["as_written"] = {
                "rmse_before": written.plain,
                "rmse_after": written.rmse,
                "noise_floor": self.noise_floor,
                "percent": written.percent,
                "interval": list(written.interval),
            }
        return document


@dataclass(frozen=True, slots=True)
class FamilyResult:
    """Curves of one family without effects, as the data that decided have them.

    Attributes:
        family: Name of the family.
        title: Name of the family in sentences.
        parameters: Number of parameters of a curve.
        held_out_rmse: Cross-validated RMSE of the whitened residuals, in standard deviations of
            the noise.
        rmse: RMSE of the adhesion.
        mu_max: Peak adhesion of the longest segment's curve.
        lambda_m: Slip ratio of that peak; None where the curve has none within the range.
        chosen: Whether the extended model's base curve is of this family.
        slip: Slip ratios at which the curve is drawn, shape (n,).
        adhesion: Adhesion of the longest segment's curve, shape (n,).

    """

    family: str
    title: str
    parameters: int
    held_out_rmse: float
    rmse: float
    mu_max: float
    lambda_m: float | None
    chosen: bool
    slip: Array
    adhesion: Array

    def to_dict(self) -> dict[str, Any]:
        """Fields of `diagnosis.json`."""
        return {
            "family": self.family,
            "held_out_score": self.held_out_rmse,
            "held_out_rmse": self.held_out_rmse,
            "rmse": self.rmse,
            "mu_max": self.mu_max,
            "lambda_m": self.lambda_m,
            "chosen": self.chosen,
        }


@dataclass(frozen=True, slots=True)
class SegmentResult:
    """Adhesion curves of one segment, a span of a recording on one surface.

    Attributes:
        recording: Name of the recording.
        from_s: Start, s on the recording's clock.
        to_s: End, s on the recording's clock.
        base: Estimate of the plain curve.
        extended: Estimate of the extended model's base curve.

    """

    recording: str
    from_s: float
    to_s: float
    base: Estimate
    extended: Estimate

    @property
    def span(self) -> dict[str, Any]:
        """Recording, start and end, as fields of `diagnosis.json`."""
        return {"recording": self.recording, "from_s": self.from_s, "to_s": self.to_s}


@dataclass(frozen=True)
class Diagnosis:
    """Result of a diagnosis.

    Attributes:
        verdict: Verdict: named effects, an unexplained residual, or nothing.
        causes: Named effects, the strongest first; () where none is named.
        channel: Channel that an unexplained residual depends on; None: none was found.
        wrong: Sentence for each finding, with size, unit and place.
        gain: Gain on held-out data; None where the data allow no verdict at all.
        evidence: Evidence for every tested effect, largest gain first.
        channels: Dependence of the selected model's residual on every channel.
        needed: Manoeuvre or signal that would separate the rivals; None: none is needed.
        untested: Effects and quantities that the data do not identify, with the reason.
        surfaces: Adhesion curves of every segment.
        model: Extended model; None where no curve with a peak could be fitted.
        profile: Mean residual over the channel that matters; None: no channel does.
        simulation_plots: Measured against simulated signals; none of a sample table.
        curves: Data of the longest segment; None without data.
        samples: Number of rows by input name.
        lost: Number of unusable rows by input name and reason.
        input_files: Input files; () where the data came from no file.
        families: Curve families side by side, Burckhardt's first; () without a verdict.
        prediction: Measured against predicted adhesion of sample tables; None of recordings.
        effect_grams: Gram matrices of the effects for a diagnosis of many drives; None where they
            were not asked for, or the data allow no verdict at all.
        closest: Effects that help and were refuted as causes, the largest gain first.
        environments: Sizes of the named effects by environment, of each effect the partition with
            the largest spread first; those of the refuted ones where they refute.
        noise: Noise floor beside the sensors' noise; None where the data allow no verdict at all.
        next_drive: Drive that would distinguish the remaining explanations; None where it was not
            asked for, or the data allow no verdict at all.
        explanations: Explanations that the data leave; () where they were not asked for.
        remaining: What a short drive leaves of the explanations of the long ones; None where there
            is none, or nothing to choose from.
        models: Models that were compared, with their errors on blocks that were left out, the best
            first.
        witness: The service's doubt with the plain curve and with the extended model; None where no
            cause is named, or no recording is long enough.

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
    surfaces: tuple[SegmentResult, ...]
    model: ExtendedModel | None
    profile: Profile | None
    simulation_plots: tuple[SimulationPlot, ...]
    curves: CurveData | None
    samples: Mapping[str, int] = field(default_factory=dict)
    lost: Mapping[str, int] = field(default_factory=dict)
    input_files: tuple[InputFile, ...] = ()
    families: tuple[FamilyResult, ...] = ()
    prediction: PredictionPlot | None = None
    effect_grams: EffectGrams | None = None
    closest: tuple[ClosestExplanation, ...] = ()
    environments: tuple[EnvironmentSizes, ...] = ()
    noise: NoiseResult | None = None
    next_drive: NextDrive | None = None
    explanations: tuple[Explanation, ...] = ()
    remaining: RemainingExplanations | None = None
    models: tuple[ModelScore, ...] = ()
    witness: Witness | None = None
    saturated: bool = False
    oscillates: bool = False
    next_step: str = ""
    begins: Mapping[str, int] = field(default_factory=dict)

    @property
    def longest_segment(self) -> SegmentResult | None:
        """Longest segment, the first of several; None without any."""
        return max(self.surfaces, key=lambda s: s.to_s - s.from_s, default=None)

    @property
    def conclusive(self) -> bool:
        """Whether the verdict holds: too much may be left, or too certainly, for 'nothing'."""
        gain = self.gain
        if gain is None:
            return False
        if self.verdict is not Verdict.NOTHING:
            return True
        leaves_more = self.noise is not None and self.noise.leaves_more
        return not (gain.leaves_much or leaves_more or any(one.is_sure for one in self.evidence))

    @property
    def held_out_files(self) -> set[str]:
        """Names of the files that were held out whole, by the user or by the diagnosis."""
        named = {file.name for file in self.input_files if file.held_out}
        if named or self.gain is None or not self.gain.whole:
            return named
        return {recording for recording, _, _ in self.gain.spans}

    def to_dict(self) -> dict[str, Any]:
        """Fields of `diagnosis.json`."""
        held = self.held_out_files
        return {
            "verdict": self.verdict.value,
            "conclusive": self.conclusive,
            "causes": [cause.to_dict() for cause in self.causes],
            "channel": self.channel,
            "wrong": list(self.wrong),
            "gain": None if self.gain is None else self.gain.to_dict(),
            "evidence": [asdict(e) | {"most_alike": list(e.most_alike)} for e in self.evidence],
            "models": [one._asdict() for one in self.models],
            "needed": self.needed,
            "next": self.next_step,
            "closest": [one.to_dict() for one in self.closest],
            "environments": [one.to_dict() for one in self.environments],
            "noise": None if self.noise is None else self.noise.to_dict(),
            "witness": None if self.witness is None else self.witness.to_dict(),
            "untested": [untested._asdict() for untested in self.untested],
            "channels": [asdict(channel) for channel in self.channels],
            "surfaces": [
                s.span | {"base": s.base.to_dict(), "extended": s.extended.to_dict()}
                for s in self.surfaces
            ],
            "families": [family.to_dict() for family in self.families],
            "base": self._curves(lambda segment: segment.base),
            "extended": self._curves(lambda segment: segment.extended),
            "inputs": [
                {
                    "path": str(file.path),
                    "sha256": file.sha256,
                    "samples": self.samples.get(file.name, 0),
                    "held_out": file.name in held,
                }
                for file in self.input_files
            ],
            "left_out": dict(self.lost),
            **({} if self.remaining is None else {"remaining": self.remaining.to_dict()}),
            **({} if self.next_drive is None else {"next_drive": self.next_drive.to_dict()}),
        }

    def _curves(self, curve: Callable[[SegmentResult], Estimate]) -> dict[str, Any] | None:
        """Fields of `identify`: longest segment, and each one in `segments`; None without any."""
        longest = self.longest_segment
        if longest is None:
            return None
        segments = [s.span | curve(s).to_dict() for s in self.surfaces]
        return curve(longest).to_dict() | {"segments": segments}

    def _repr_html_(self) -> str:
        rows = [
            (cause.effect, value.name, plus_minus(value.value, value.std), value.unit)
            for cause in self.causes
            for value in cause.parameters
        ]
        columns = ("effect", "parameter", "value", "unit")
        sentences = "".join(f"<li>{escape(sentence)}</li>" for sentence in self.wrong)
        gain = "" if self.gain is None else f", gain {self.gain.percent:.1f} %"
        table = html_table(f"Verdict: {self.verdict.value}{gain}", columns, rows)
        return f"{table}<ul>{sentences}</ul>"
