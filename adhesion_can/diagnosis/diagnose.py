"""The whole procedure: recordings in, a diagnosis out.

1. A part of the data is kept back for the gain alone.
2. Changes of the rail are a nuisance: a curve for each stretch (`surfaces`).
3. Residuals are weighed and whitened by what the fullest model leaves (`staging`).
4. Is anything there? Signs of block sums are flipped (`detect`).
5. Which effects? Every one and every two of them, with a confidence set (`naming`).
6. What is left? Splines in every channel, waves, bad signals (`unknown`).
7. What does it gain on what was kept back? (`gain`)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adhesion_can.diagnosis.conclusion import conclude, empty
from adhesion_can.diagnosis.drive.drive_data import Course
from adhesion_can.diagnosis.inference.candidates import (
    LEAST_ROWS,
    candidates_of,
    remarks,
    too_little,
)
from adhesion_can.diagnosis.inference.channel_splines import channels_of
from adhesion_can.diagnosis.inference.find_residual_channels import (
    Left,
    left_over,
    line,
    pinned,
    wave_channel,
)
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.select_effects import detection_of, name
from adhesion_can.diagnosis.regression.find_surface_changes import changes, start_of, study_of
from adhesion_can.diagnosis.regression.gram_matrices import blocks_of
from adhesion_can.diagnosis.regression.model import Candidate, Study, curve_slopes, evaluate
from adhesion_can.diagnosis.regression.prepare_regression import block_seconds, prepare
from adhesion_can.diagnosis.regression.whitened_regression import Fit, Stage
from adhesion_can.diagnosis.result import Diagnosis, Untested

HELD_EVERY, HELD_BLOCKS = 3, 2
"""Every third pair of blocks is kept back where no other data are."""
MANY_ROWS = 40_000
"""More rows than this are thinned to the rate of the settings: they cost time and tell little."""


@dataclass(frozen=True, slots=True)
class DiagnoseSettings:
    """Of a diagnosis.

    Attributes:
        alpha: level at which an effect counts as sure; a channel at half of it. What is not worth
            naming is not named besides, which makes false findings rarer than this.
        rate_hz: rows per second and axle that are used for deciding.
        seed: of the signs.

    """

    alpha: float = 0.05
    rate_hz: float = 16.0
    seed: int = 1


def _silent(_stage: str, _share: float) -> None:
    pass


def diagnose(
    courses: Sequence[Course],
    holdout: Sequence[Course] = (),
    settings: DiagnoseSettings | None = None,
    show: Callable[[str, float], None] = _silent,
) -> Diagnosis:
    """Diagnose recordings of one vehicle, or tables.

    Args:
        courses: to decide on.
        holdout: for the gain alone; none: a part of `courses` is kept back.
        settings: see there.
        show: told the stage of the work and the share that is done.

    """
    settings = settings or DiagnoseSettings()
    used = [course for course in (*courses, *holdout) if len(course)]
    candidates, untested = candidates_of(used) if used else ((), [])
    thin = tuple(_thinned(course, settings.rate_hz) for course in used)
    kept = _kept_back(used, [c for c in holdout if len(c)])
    length_s = block_seconds(Study(thin, np.empty(0, dtype=np.int64), 0)) if thin else 1.0
    block = _blocks(thin, kept, length_s)
    why = too_little(thin, block) if thin else "no usable row in any input"
    if why:
        return empty(courses, [*untested, Untested("everything", why)])
    show("rails", 0.05)
    times = [[] if course.table else changes(course, candidates) for course in thin]
    work = _Work(thin, candidates, block, length_s, settings, show)
    found = work.run(times)
    if any(times):
        # The other reading of the same data: the rail never changed, effects did it all.
        other = work.run([[] for _ in thin])
        if other.naming.best.rmse <= 1.02 * found.naming.best.rmse and other.naming.best.ids:
            found = other
    show("gain", 0.85)
    diagnosis = conclude(used, found, [*untested, *remarks(used)], other_drives=any(kept))
    show("done", 1.0)
    return diagnosis


@dataclass(frozen=True)
class _Work:
    """What stays the same whatever the rails did."""

    courses: tuple[Course, ...]
    candidates: tuple[Candidate, ...]
    block: NDArray[np.int64]
    length_s: float
    settings: DiagnoseSettings
    show: Callable[[str, float], None]

    def run(self, times: list[list[float]]) -> Findings:
        """Steps 3 to 6 with given changes of the rail."""
        study = study_of(self.courses, times)
        rng = np.random.default_rng(self.settings.seed)
        self.show("curves", 0.15)
        prepared = prepare(study, start_of(study), self.block, self.candidates, self.length_s)
        stage, base = prepared.stage, prepared.base
        self.show("effects", 0.35)
        detection, absorbed, cosines = detection_of(stage, base, prepared.signatures, rng)
        naming = name(stage, base, self.candidates, detection)
        self.show("what is left", 0.7)
        plain = self._left(stage, naming.base.fit, rng)
        rest = self._left(stage, naming.best.fit, rng) if naming.best.ids else plain
        lines = [found for course in self.courses if (found := line(course)) is not None]
        return Findings(
            prepared=prepared,
            naming=naming,
            absorbed=absorbed,
            cosines=cosines,
            left_plain=tuple(plain),
            left=tuple(rest),
            line=max(lines, key=lambda one: one.adhesion, default=None),
            pinned=tuple(self._pinned()),
            times=times,
            length_s=self.length_s,
            alpha=self.settings.alpha,
        )

    def _left(self, stage: Stage, found: Fit, rng: np.random.Generator) -> list[Left]:
        """What channels and waves explain of a model's residual, the most first."""
        likely = evaluate(stage.study, found.model.theta, found.model.actives, stage.shift)
        channels = channels_of(stage.study, likely)
        columns = [channel.basis(likely) for channel in channels]
        slopes = curve_slopes(stage.study, found.model.theta, likely)
        out = left_over(stage, found, channels, columns, slopes, rng)
        wave = wave_channel(stage, found.model, likely, rng)
        if wave is not None and wave[2] <= self.settings.alpha / 2:
            channel, own, p_value = wave
            (one,) = left_over(stage, found, [channel], [own], slopes, rng)
            out.append(replace(one, p_value=p_value))
        return sorted(out, key=lambda one: -one.gain)

    def _pinned(self) -> list[tuple[str, int, float, float]]:
        """Recording, axle, effort and share of its readings that are cut off."""
        return [
            (course.name, int(axle), *seen)
            for course in self.courses
            if not course.table
            for axle in np.unique(course.axle)
            if (seen := pinned(course, int(axle))) is not None
        ]


def _thinned(course: Course, rate_hz: float) -> Course:
    """Rows of a course at a lower rate, axle by axle."""
    if len(course) <= MANY_ROWS or course.table:
        return course
    kept = np.zeros(len(course), dtype=np.bool_)
    for axle in np.unique(course.axle):
        rows = np.flatnonzero(course.axle == axle)
        cycle = float(np.median(np.diff(course.t_s[rows]))) if len(rows) > 1 else 1.0
        kept[rows[:: max(round(1.0 / (rate_hz * cycle)), 1)]] = True
    return course.rows(kept)


def _kept_back(courses: Sequence[Course], holdout: Sequence[Course]) -> list[bool]:
    """Whether each course is kept back whole; none is where one drive is all there is."""
    chosen = list(holdout)
    if not holdout and len(courses) > 1:
        # The shortest that are long enough: most of the data decide.
        able = sorted((c for c in courses if len(c) >= LEAST_ROWS), key=len)
        count = max(len(courses) // HELD_EVERY, 1)
        chosen = able[:count] if len(able) > count else []
    return [any(course is one for one in chosen) for course in courses]


def _blocks(courses: Sequence[Course], kept: Sequence[bool], length_s: float) -> NDArray[np.int64]:
    """Number of each row's block, −1 − number where it is kept back."""
    out, base = [], 0
    for course, whole in zip(courses, kept, strict=True):
        # Numbered through: pauses are no blocks.
        number = np.unique(blocks_of(course.t_s, length_s), return_inverse=True)[1]
        back = np.full(len(number), whole)
        if not any(kept):
            back = (number // HELD_BLOCKS) % HELD_EVERY == 1
        number = number + base
        base = int(number.max(initial=base - 1)) + 1
        out.append(np.where(back, -1 - number, number))
    return np.concatenate(out) if out else np.empty(0, dtype=np.int64)
