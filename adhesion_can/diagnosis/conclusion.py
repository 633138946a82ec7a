"""From findings to a diagnosis: gain, extended model, sentences, pictures."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adhesion_can.diagnosis.drive.drive_data import Course
from adhesion_can.diagnosis.extended_model import extension, spline_of, surfaces_of, with_spline
from adhesion_can.diagnosis.inference.candidates import IMITATED
from adhesion_can.diagnosis.inference.channel_splines import Channel, channels_of
from adhesion_can.diagnosis.inference.find_residual_channels import Left
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.hold_out_gain import gain_of, held_out
from adhesion_can.diagnosis.plot_data import curve_data, pictures_of, profile_of, shown_channel
from adhesion_can.diagnosis.regression.model import (
    EXCLUDED,
    Candidate,
    Model,
    Study,
    evaluate,
)
from adhesion_can.diagnosis.regression.prepare_regression import Prepared
from adhesion_can.diagnosis.regression.whitened_regression import Fit, fit
from adhesion_can.diagnosis.result import (
    Cause,
    ChannelEvidence,
    Diagnosis,
    Evidence,
    Gain,
    Profile,
    Untested,
    Value,
    Verdict,
)
from adhesion_can.diagnosis.sentences import (
    SHOWN,
    cause_sentence,
    channel_label,
    channel_sentence,
    line_sentence,
    pinned_sentences,
    separating,
    where_sentence,
)


def empty(courses: Sequence[Course], untested: Sequence[Untested]) -> Diagnosis:
    """Diagnosis of data that carry none."""
    return Diagnosis(
        Verdict.NOTHING, (), None, (), None, (), (), None, tuple(untested), (), None, None, (),
        None, {course.name: len(course) for course in courses}, _lost(courses),
    )  # fmt: skip


def _lost(courses: Sequence[Course]) -> dict[str, int]:
    return {
        f"{course.name}: {reason}": count
        for course in courses
        for reason, count in course.lost.items()
        if count
    }


def conclude(
    courses: Sequence[Course],
    found: Findings,
    untested: Sequence[Untested],
    *,
    other_drives: bool,
) -> Diagnosis:
    """The diagnosis.

    Args:
        courses: every row of every recording, in the order of the study's.
        found: see there.
        untested: what could not be tested.
        other_drives: whether whole recordings were kept back.

    """
    prepared = found.prepared
    study = prepared.stage.study
    named, unknown, gain, doubts = _decided(found, other_drives=other_drives)
    untested = [*untested, *doubts]
    plain = found.naming.base.fit.model
    extended = found.naming.best.fit.model if named else plain
    explained = bool(named) or unknown is not None or found.swings or bool(found.pinned)
    verdict = Verdict.NAMED if named else Verdict.UNEXPLAINED if explained else Verdict.NOTHING
    final = _refitted(prepared, extended, other_drives=other_drives)
    spline = None if unknown is None else spline_of(unknown)
    whole = final.model if spline is None else with_spline(prepared, final.model, spline)
    change = evaluate(study, whole.theta, whole.actives)
    before = evaluate(study, plain.theta)
    after = change.residual
    if unknown is not None and spline is None:
        after = before.residual - unknown.explained
    channels = channels_of(study, before)
    channel = _shown(study, named, unknown, channels)
    profile = None
    if channel is not None:
        profile = profile_of(
            study, channel, before.residual, after, before.residual - after, before.predicted
        )
    causes = tuple(_cause(found, c, final) for c in _by_strength(found, named))
    surfaces, longest = surfaces_of(study, found.times, whole)
    pictures = [] if verdict is Verdict.NOTHING else pictures_of(
        courses[longest[0]], longest[1], plain, whole
    )  # fmt: skip
    return Diagnosis(
        verdict=verdict,
        causes=causes,
        channel=_channel_name(found, unknown) if verdict is Verdict.UNEXPLAINED else None,
        wrong=tuple(_wrong(found, causes, unknown, gain, profile)),
        gain=gain,
        evidence=tuple(_evidence(found)),
        channels=tuple(
            ChannelEvidence(
                channel_label(one.channel), one.channel.unit, one.p_value, 100 * one.gain
            )
            for one in found.left
        ),
        needed=_needed(causes),
        untested=(*untested, *_imitated(found)),
        surfaces=surfaces,
        model=extension(whole, final, longest[1], spline),
        profile=profile,
        pictures=tuple(pictures),
        curves=curve_data(study, longest[1], whole),
        samples={course.name: len(course) for course in courses},
        lost=_lost(courses),
    )


def _decided(
    found: Findings, *, other_drives: bool
) -> tuple[tuple[Candidate, ...], Left | None, Gain, list[Untested]]:
    """Named effects, channel, gain, and what showed but does not hold on what was held out.

    Data that were held out choose nothing. But what makes them worse is no finding.
    """
    plain, best = found.naming.base.fit.model, found.naming.best.fit.model
    doubts: list[Untested] = []
    if found.named:
        gain = _gain(found, best, None, other_drives=other_drives)
        if gain.percent > 0.0:
            return found.named, None, gain, doubts
        doubts += [_not_held(candidate.effect.id) for candidate in found.named]
    if found.unknown is not None:
        gain = _gain(found, plain, found.unknown, other_drives=other_drives)
        if _sure(gain):
            return (), found.unknown, gain, doubts
        label = channel_label(found.unknown.channel)
        doubts.append(_not_held(f"a dependence on {label}"))
    return (), None, _gain(found, plain, None, other_drives=other_drives), doubts


def _sure(gain: Gain) -> bool:
    """Whether a gain is more than chance on what was held out, as far as its units can tell.

    A channel bends as it must: on noise of a second's memory two drives in twenty had one that
    gained something, and its interval held 0.
    """
    low = gain.interval[0]
    return gain.percent > 0.0 and (low > 0.0 or low == -np.inf)


def _not_held(what: str) -> Untested:
    return Untested(
        what, "it showed in the data that decided, and does not hold on those that were held out"
    )


def _gain(found: Findings, extended: Model, left: Left | None, *, other_drives: bool) -> Gain:
    stage = found.prepared.stage
    plain = found.naming.base.fit.model
    held = held_out(stage, plain, extended, left, other_drives=other_drives)
    unit, words, spans = _units(
        stage.study, stage.block, held.rows, found, other_drives=other_drives
    )
    return gain_of(held, unit, found.noise_floor, words, spans)


def _units(
    study: Study,
    block: NDArray[np.int64],
    rows: NDArray[np.int64],
    found: Findings,
    *,
    other_drives: bool,
) -> tuple[NDArray[np.int64], str, tuple[tuple[str, float, float], ...]]:
    """Unit of each held-out row, and what was held out, in words and as times."""
    number = (-1 - block[rows]) // 2
    names = np.concatenate([np.full(len(c), i) for i, c in enumerate(study.courses)])[rows]
    t_s = study.column("time_s")[rows]
    held = np.unique(names)
    if other_drives and len(held) >= 3:
        number = names
    spans = []
    for unit in np.unique(number):
        own = number == unit
        course = study.courses[int(names[own][0])]
        start = course.first_us / 1e6
        spans.append((course.name, start + float(t_s[own].min()), start + float(t_s[own].max())))
    if other_drives:
        words = f"{len(held)} of {len(study.courses)} recordings: " + ", ".join(
            study.courses[int(i)].name for i in held
        )
    else:
        share = len(rows) / max(int((study.surface != EXCLUDED).sum()), 1)
        words = (
            f"this drive only: {len(spans)} spans of {2 * found.length_s:.1f} s, "
            f"{100 * share:.0f} % of the rows"
        )
    return number, words, tuple(spans)


def _refitted(prepared: Prepared, extended: Model, *, other_drives: bool) -> Fit:
    """The extended model on all rows but those of other drives that were kept back."""
    return fit(prepared.stage if other_drives else prepared.stage.whole, extended)


def _by_strength(found: Findings, named: Sequence[Candidate]) -> list[Candidate]:
    """Named effects, the one that alone gains most first."""
    alone = {one.candidates[0]: one.fit.square for one in found.naming.singles}
    return sorted(named, key=lambda c: alone.get(c, np.inf))


def _cause(found: Findings, candidate: Candidate, final: Fit) -> Cause:
    effect = candidate.effect
    place = final.model.candidates.index(candidate)
    first = final.model.theta.values.size + sum(c.size for c in final.model.candidates[:place])
    std = iter(np.sqrt(final.covariance.diagonal())[first : first + candidate.size])
    numbers = iter(final.model.values[place])
    values = tuple(
        Value(p.name, float(candidate.axle), None, p.unit, p.meaning)
        if p.axle
        else Value(p.name, next(numbers), float(next(std)), p.unit, p.meaning)
        for p in effect.parameters
    )
    return Cause(
        effect.id,
        effect.form,
        effect.title,
        effect.literature,
        values,
        found.p_value(candidate),
        found.naming.rivals(candidate),
    )


def _evidence(found: Findings) -> list[Evidence]:
    candidates, detection = found.prepared.candidates, found.naming.detection
    base = found.naming.base
    alone = {one.candidates[0]: 100 * (1 - one.rmse / base.rmse) for one in found.naming.singles}
    out = []
    for place, candidate in enumerate(candidates):
        cosines = np.abs(found.cosines[place])
        others = [i for i, c in enumerate(candidates) if c.effect.id != candidate.effect.id]
        alike = int(others[int(np.argmax(cosines[others]))]) if others else place
        gain = alone.get(candidate, 50.0 * float(detection.gain[place]))
        out.append(
            Evidence(
                candidate.effect.id,
                candidate.effect.form,
                candidate.axle,
                float(detection.statistic[place]),
                float(detection.p_value[place]),
                float(np.clip(found.absorbed[place], 0.0, 1.0)),
                (candidates[alike].effect.id, float(found.cosines[place, alike])),
                float(gain),
            )
        )
    return sorted(out, key=lambda e: (-e.gain_percent, e.p_value))


def _imitated(found: Findings) -> list[Untested]:
    out = {}
    for candidate, absorbed in zip(found.prepared.candidates, found.absorbed, strict=True):
        if absorbed >= IMITATED and candidate not in found.naming.best.candidates:
            out[candidate.effect.id] = (
                f"the curve's own parameters imitate {100 * absorbed:.1f} % of it in these data"
            )
    return [Untested(what, why) for what, why in out.items()]


def _needed(causes: Sequence[Cause]) -> str | None:
    words = [separating(cause.effect, cause.rivals) for cause in causes if cause.rivals]
    return "; ".join(words) or None


def _channel_name(found: Findings, unknown: Left | None) -> str | None:
    if found.pinned:
        return "tractive_effort"
    if found.swings or unknown is None:
        return None
    return unknown.channel.name


def _wrong(
    found: Findings,
    causes: Sequence[Cause],
    unknown: Left | None,
    gain: Gain,
    profile: Profile | None,
) -> list[str]:
    out = [cause_sentence(cause) for cause in causes]
    out += pinned_sentences(found.pinned)
    if found.swings and found.line is not None:
        out.append(line_sentence(found.line))
    if unknown is not None:
        out.append(channel_sentence(unknown))
    if out and profile is not None:
        out.append(where_sentence(profile, gain))
    return out


def _shown(
    study: Study, named: Sequence[Candidate], unknown: Left | None, channels: Sequence[Channel]
) -> Channel | None:
    if named:
        return shown_channel(study, SHOWN.get(named[0].effect.id, "slip"), channels)
    return None if unknown is None else unknown.channel
