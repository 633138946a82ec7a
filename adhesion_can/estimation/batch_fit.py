"""Batch fit of a recording, and the changes of the surface within it.

The curve is fitted by variable projection: the profile likelihood of c2. Where samples state errors
of their slips, these are scaled to what the samples show and removed by corrected scores
(`errors_in_variables`). The same projection on sums over narrow bins of slip scores every possible
change point in one matrix product.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.batch_result import BatchResult, Segment
from adhesion_can.estimation.compare_directions import compare_directions
from adhesion_can.estimation.errors_in_variables import fit_with_errors
from adhesion_can.estimation.identifiability import (
    IdentifiabilitySettings,
    assess,
    build_estimate,
    require_fall,
)
from adhesion_can.estimation.likelihood import sum_of_squares
from adhesion_can.estimation.missing_peak import find_missing_peak
from adhesion_can.estimation.noise.noise_factors import batch_factors
from adhesion_can.estimation.noise.settings import NoiseSettings
from adhesion_can.estimation.variable_projection import (
    STEEPNESS,
    UPPER,
    fit_least_squares,
    solve_two_by_two,
)
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.physics.samples import Samples

if TYPE_CHECKING:
    from adhesion_can.estimation.rail_peak import RailPeak
    from adhesion_can.physics.curves import CurveFamily

BINS = 96
"""Number of bins of slip for the score of a change."""
AT_BOUND = 1.0 - 1e-4
"""Share of the largest value of a parameter from which it is at its bound."""
SHORT = 10
"""Duration of a segment, in margins beside a change, up to which all of it is used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentationSettings:
    """Detection of surface changes in a recording by binary segmentation.

    Attributes:
        chunk_s: Time resolution of a change, s.
        shortest_s: Least duration of a segment, s. Larger: fewer segments.
        penalty: Least gain in log likelihood of a change, in units of the BIC's. Larger: fewer
            segments, and small changes are missed.
        noise_gain: Least relative decrease of the residuals' root mean square by a change.

    """

    chunk_s: float = 0.1
    shortest_s: float = 1.0
    penalty: float = 4.0
    noise_gain: float = 0.05


def fit(samples: Samples, settings: IdentifiabilitySettings | None = None) -> Estimate:
    """Maximum likelihood of one curve for all samples (eq. 13), their slips taken as exact.

    Args:
        samples: Samples, at least one, finite, |λ| within the range of `settings`.
        settings: Limits from which the peak counts as identifiable.

    """
    settings = settings or IdentifiabilitySettings()
    h, z = samples.folded()
    theta = fit_least_squares(h, z)
    return assess(theta, sum_of_squares(theta, h, z), samples, settings)


def fit_surface(samples: Samples, settings: IdentifiabilitySettings | None = None) -> Estimate:
    """Curve of one surface, without the errors of the slips that the samples state.

    Samples that state none are fitted as by `fit`. λ_m is identifiable only where the fall beyond
    the peak is significant, and neither is where a parameter ends at its bound.

    Args:
        samples: Samples, at least one, finite, |λ| within the range of `settings`.
        settings: Limits from which the peak counts as identifiable.

    """
    settings = settings or IdentifiabilitySettings()
    if samples.slip_total_var.any():
        fitted = fit_with_errors(samples, settings.slip_max)
        if fitted is not None:
            return _require_inside(require_fall(build_estimate(*fitted, samples, settings)))
    return _require_inside(require_fall(fit(samples, settings)))


def _require_inside(estimate: Estimate) -> Estimate:
    """Estimate whose peak is not identifiable where c1, c2 or c3 ends at the largest value tried.

    The curve would go on, and its standard deviations know nothing of that.
    """
    if (np.array(estimate.theta) < AT_BOUND * UPPER).all():
        return estimate
    return replace(estimate, identifiable=Identifiable(mu_max=False, lambda_m=False))


def identify(
    samples: Samples,
    settings: IdentifiabilitySettings | None = None,
    segmentation: SegmentationSettings | None = None,
    labels: NDArray[np.int64] | None = None,
    families: "Sequence[CurveFamily]" = (),
    noise: NoiseSettings | None = None,
    *,
    judge_family: bool = False,
) -> BatchResult | None:
    """Batch fit of a recording: one curve for all of it, and one for each segment.

    Args:
        samples: Samples in the order of their stamps.
        settings: Limits from which the peak counts as identifiable.
        segmentation: Settings of the detection of surface changes.
        labels: Number of each sample's segment where it is known, shape (n,); None: changes are
            detected from the samples.
        families: Curve families to compare in each segment.
        noise: Settings of the noise of the samples; None: the defaults.
        judge_family: Whether each segment's peak is that of the curve families that hold, where
            Burckhardt's does not.

    Returns:
        Result of the fit; None where no sample is usable.

    """
    settings = settings or IdentifiabilitySettings()
    usable = np.isfinite(samples.slip) & np.isfinite(samples.adhesion)
    usable &= np.abs(samples.slip) <= settings.slip_max
    kept = samples.select(usable)
    if not len(kept):
        return None
    noise, segmentation = noise or NoiseSettings(), segmentation or SegmentationSettings()
    margin_us = 0
    if noise.estimated and kept.slip_total_var.any():
        kept = batch_factors(kept, noise).scale(kept)
    if labels is None:
        edges = change_points(kept, segmentation)
        # A change is known to a chunk: what is beside it may be of the other surface. Points
        # without errors are few, and all of them count.
        margin_us = round(segmentation.chunk_s * 1e6) if kept.slip_total_var.any() else 0
    else:
        edges = [int(i) for i in np.flatnonzero(np.diff(labels[usable])) + 1]
    bounds = [0, *edges, len(kept)]
    inner = [kept.select(_inner(kept.t_us, a, b, margin_us)) for a, b in pairwise(bounds)]
    segments = tuple(
        _fit_segment(kept, a, b, rows, settings)
        for (a, b), rows in zip(pairwise(bounds), inner, strict=True)
    )
    rails: tuple[RailPeak | None, ...] = ()
    if judge_family:
        segments, rails = _judge_families(segments, inner, settings)
    segments = tuple(
        segment._replace(missing=find_missing_peak(segment.estimate, rows, settings))
        for segment, rows in zip(segments, inner, strict=True)
    )
    whole = segments[0].estimate
    if len(segments) > 1:
        whole = replace(
            fit_surface(kept, settings), identifiable=Identifiable(mu_max=False, lambda_m=False)
        )
    if not families:
        return BatchResult(whole, segments, len(samples) - len(kept), rails=rails)
    # Imported here: most fits compare nothing, and a short check would wait for it.
    from adhesion_can.estimation.curves.hold_out import compare_families  # noqa: PLC0415

    curves = tuple(
        compare_families(kept.select(slice(a, b)), families, slip_max=settings.slip_max)
        for a, b in pairwise(bounds)
    )
    alone = len(segments) == 1
    together = curves[0] if alone else compare_families(kept, families, slip_max=settings.slip_max)
    return BatchResult(whole, segments, len(samples) - len(kept), curves, together, rails)


def _judge_families(
    segments: tuple[Segment, ...], inner: Sequence[Samples], settings: IdentifiabilitySettings
) -> "tuple[tuple[Segment, ...], tuple[RailPeak | None, ...]]":
    """Segments with the peak of the rail, and the families that it comes from.

    Where traction and braking have curves of their own no one curve is compared.
    """
    # Imported here: a short check compares nothing, and would wait for it.
    from adhesion_can.estimation.find_rail_peak import find_rail_peak  # noqa: PLC0415

    rails = tuple(
        find_rail_peak(rows, segment.estimate, settings) if segment.directions.agree else None
        for segment, rows in zip(segments, inner, strict=True)
    )
    judged = tuple(
        segment if rail is None else segment._replace(estimate=rail.estimate)
        for segment, rail in zip(segments, rails, strict=True)
    )
    return judged, rails


def _fit_segment(
    samples: Samples, first: int, last: int, inner: Samples, settings: IdentifiabilitySettings
) -> Segment:
    """Segment of the rows first..last−1, whose curve is fitted to the inner ones."""
    estimate = fit_surface(inner, settings)
    directions = compare_directions(estimate, inner)
    if not directions.agree:
        estimate = replace(estimate, identifiable=Identifiable(mu_max=False, lambda_m=False))
    stamps = samples.t_us
    return Segment(int(stamps[first]), int(stamps[last - 1]), estimate, directions)


def _inner(t_us: NDArray[np.int64], first: int, last: int, margin_us: int) -> slice:
    """Rows of a segment without those beside its neighbours; all of a segment that is short."""
    begin, end = int(t_us[first]), int(t_us[last - 1])
    if not margin_us or end - begin < SHORT * margin_us:
        return slice(first, last)
    a = first if first == 0 else int(np.searchsorted(t_us, begin + margin_us))
    b = last if last == len(t_us) else int(np.searchsorted(t_us, end - margin_us))
    return slice(a, b)


def change_points(samples: Samples, settings: SegmentationSettings) -> list[int]:
    """Rows at which the surface changed, ascending, by binary segmentation of the likelihood.

    Args:
        samples: Samples in the order of their stamps.
        settings: Settings of the detection.

    """
    h, z = samples.folded()
    since = samples.t_us - samples.t_us[0]
    if since[-1] <= 0 or np.any(np.diff(since) < 0):
        return []
    chunk = (since // round(settings.chunk_s * 1e6)).astype(np.int64)
    # Empty chunks (a pause) are left out.
    starts = np.flatnonzero(np.diff(chunk, prepend=-1))
    sums = _chunk_sums(h, z, starts)
    times = since[starts] * 1e-6
    splits: list[int] = []
    open_ranges = [(0, len(starts))]
    while open_ranges:
        first, last = open_ranges.pop()
        split = _best_split(sums, times, first, last, settings)
        if split is not None:
            splits.append(split)
            open_ranges += [(first, split), (split, last)]
    return sorted(int(starts[split]) for split in splits)


class _Sums(NamedTuple):
    """Cumulative sums over chunks, from zero on.

    Attributes:
        counts: Number of samples by bin of slip, shape (chunks + 1, bins).
        z: Σz by bin of slip, shape (chunks + 1, bins).
        zz: Σz² of all bins, shape (chunks + 1,).
        centre: Mean slip ratio of each bin, shape (bins,).

    """

    counts: Array
    z: Array
    zz: Array
    centre: Array


def _chunk_sums(h: Array, z: Array, starts: NDArray[np.int64]) -> _Sums:
    # Narrow bins where the samples are, and where the curve is steep though samples are few.
    crowded = np.quantile(h, np.linspace(0, 1, BINS + 1)[1:-1])
    edges = np.unique(np.concatenate([crowded, np.geomspace(1e-3, 1.0, BINS) * max(h.max(), 1e-6)]))
    index = np.searchsorted(edges, h)
    bins = len(edges) + 1
    count_all = np.bincount(index, minlength=bins)
    centre = np.bincount(index, h, minlength=bins) / np.maximum(count_all, 1)
    chunks = len(starts)
    chunk = np.searchsorted(starts, np.arange(len(h)), side="right") - 1
    flat = chunk * bins + index
    shape = (chunks, bins)

    def cumulative(values: NDArray[Any]) -> Array:
        return np.concatenate(
            [np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0, dtype=np.float64)]
        )

    return _Sums(
        cumulative(np.bincount(flat, minlength=chunks * bins).reshape(shape)),
        cumulative(np.bincount(flat, z, minlength=chunks * bins).reshape(shape)),
        cumulative(np.add.reduceat(z * z, starts)),
        centre,
    )


def _best_split(
    sums: _Sums, times: Array, first: int, last: int, settings: SegmentationSettings
) -> int | None:
    """Chunk at which the range first..last−1 is best split; None without a significant split."""
    inner = np.arange(first + 1, last)
    inner = inner[
        (times[inner] - times[first] >= settings.shortest_s)
        & (times[last - 1] - times[inner] >= settings.shortest_s)
    ]
    if not len(inner):
        return None
    begin, middle, end = (
        [part[i] for part in (sums.counts, sums.z, sums.zz)] for i in (first, inner, last)
    )
    left = [m - b for m, b in zip(middle, begin, strict=True)]
    right = [e - m for e, m in zip(end, middle, strict=True)]
    whole = [np.asarray(e - b)[None] for e, b in zip(end, begin, strict=True)]
    n = whole[0].sum()
    cost, cost1, cost2 = (
        _projected_cost(count, z, zz, sums.centre) for count, z, zz in (whole, left, right)
    )
    # One noise level for both sides: a change of the noise alone is no change of the surface.
    gain = 0.5 * n * np.log(cost / (cost1 + cost2))
    best = int(np.argmax(gain))
    threshold = settings.penalty * 0.5 * 5 * np.log(n)
    quieter = 1.0 - np.sqrt((cost1 + cost2)[best] / cost[0])
    if gain[best] <= threshold or quieter <= settings.noise_gain:
        return None
    return int(inner[best])


def _projected_cost(count: Array, z: Array, zz: Array, centre: Array) -> Array:
    """J with c1 and c3 projected out and c2 scanned, for each row of sums."""
    a = -np.expm1(-np.multiply.outer(centre, STEEPNESS))  # 1 - e^(-c2 h), (bins, c2)
    b = -centre[:, None]
    aa, ab, bb = count @ (a * a), count @ (a * b), count @ (b * b)
    az, bz = z @ a, z @ b
    c1, c3 = solve_two_by_two(
        aa, ab, np.broadcast_to(bb, aa.shape), az, np.broadcast_to(bz, az.shape)
    )
    explained = c1 * az + c3 * bz
    return np.asarray(np.maximum(zz - explained.max(axis=-1), 1e-12 * np.maximum(zz, 1e-12)))
