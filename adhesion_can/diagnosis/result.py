"""Result of a diagnosis as plain values, from which reports and JSON are made."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.cause_result import (
    Cause,
    ClosestExplanation,
    EnvironmentSizes,
    Witness,
)
from adhesion_can.diagnosis.effect_grams import EffectGrams
from adhesion_can.diagnosis.evidence import ChannelEvidence, EffectEvidence, ModelScore, Untested
from adhesion_can.diagnosis.gain_result import Gain
from adhesion_can.diagnosis.inference.sensor_noise import NoiseComparison
from adhesion_can.diagnosis.next_drive.explanations import Explanation
from adhesion_can.diagnosis.next_drive.remaining import RemainingExplanations
from adhesion_can.diagnosis.next_drive.result import NextDrive
from adhesion_can.diagnosis.plot_result import CurveData, PlotData, Profile
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.estimate import Estimate
from adhesion_can.result_text import html_table, plus_minus


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


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """Result of a diagnosis.

    Attributes:
        verdict: Verdict: named effects, an unexplained residual, or nothing.
        causes: Named effects, the strongest first; () where none is named.
        channel: Channel that an unexplained residual depends on; None: none was found.
        wrong: Sentence for each finding, with size, unit and place.
        gain: Gain on held-out data; None where the data allow no verdict at all.
        evidence: Evidence for every tested effect, largest gain first.
        models: Models that were compared, with their errors on blocks that were left out, the best
            first.
        channels: Dependence of the selected model's residual on every channel.
        needed: Manoeuvre or signal that would separate the rivals; None: none is needed.
        untested: Effects and quantities that the data do not identify, with the reason.
        surfaces: Adhesion curves of every segment.
        families: Curve families side by side, Burckhardt's first; () without a verdict.
        model: Extended model; None where no curve with a peak could be fitted.
        closest: Effects that help and were refuted as causes, the largest gain first.
        environments: Sizes of the named effects by environment, of each effect the partition with
            the largest spread first; those of the refuted ones where they refute.
        noise: Noise floor beside the sensors' noise; None where the data allow no verdict at all.
        saturated: Whether the reading of an effort sensor is cut off at a limit.
        oscillates: Whether the drive train oscillates enough to matter in the force balance.
        witness: The service's doubt with the plain curve and with the extended model; None where no
            cause is named, or no recording is long enough.
        remaining: What a short drive leaves of the explanations of the long ones; None where there
            is none, or nothing to choose from.
        explanations: Explanations that the data leave; () where they were not asked for.
        next_drive: Drive that would distinguish the remaining explanations; None where it was not
            asked for, or the data allow no verdict at all.
        next_step: What to do next, a clause with a command.
        effect_grams: Gram matrices of the effects for a diagnosis of many drives; None where they
            were not asked for, or the data allow no verdict at all.
        profile: Mean residual over the channel that matters; None: no channel does.
        draw: Function that computes `plots`; it keeps the rows of the drive that is drawn.
        samples: Number of rows by input name.
        lost: Number of unusable rows by input name and reason.
        begins: Time 0 of each input by its name, µs on its own clock.
        tables: Whether the rows come from sample tables.
        input_files: Input files; () where the data came from no file.

    """

    verdict: Verdict
    causes: tuple[Cause, ...] = ()
    channel: str | None = None
    wrong: tuple[str, ...] = ()
    gain: Gain | None = None
    evidence: tuple[EffectEvidence, ...] = ()
    models: tuple[ModelScore, ...] = ()
    channels: tuple[ChannelEvidence, ...] = ()
    needed: str | None = None
    untested: tuple[Untested, ...] = ()
    surfaces: tuple[SegmentResult, ...] = ()
    families: tuple[FamilyResult, ...] = ()
    model: ExtendedModel | None = None
    closest: tuple[ClosestExplanation, ...] = ()
    environments: tuple[EnvironmentSizes, ...] = ()
    noise: NoiseComparison | None = None
    saturated: bool = False
    oscillates: bool = False
    witness: Witness | None = None
    remaining: RemainingExplanations | None = None
    explanations: tuple[Explanation, ...] = ()
    next_drive: NextDrive | None = None
    next_step: str = ""
    effect_grams: EffectGrams | None = None
    profile: Profile | None = None
    draw: Callable[[], PlotData] = field(default=PlotData, repr=False, compare=False)
    samples: Mapping[str, int] = field(default_factory=dict)
    lost: Mapping[str, int] = field(default_factory=dict)
    begins: Mapping[str, int] = field(default_factory=dict)
    tables: bool = False
    input_files: tuple[InputFile, ...] = ()

    @cached_property
    def plots(self) -> PlotData:
        """What a page draws, computed when it is asked for."""
        return self.draw()

    @property
    def curves(self) -> CurveData | None:
        """Data of the longest segment; None without data."""
        return self.plots.curves

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
        return not (
            gain.leaves_much or leaves_more or any(tested.is_sure for tested in self.evidence)
        )

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
            "evidence": [tested.to_dict() for tested in self.evidence],
            "models": [model._asdict() for model in self.models],
            "needed": self.needed,
            "next": self.next_step,
            "closest": [cause.to_dict() for cause in self.closest],
            "environments": [environment.to_dict() for environment in self.environments],
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
