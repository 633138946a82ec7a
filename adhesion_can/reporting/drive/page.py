"""Page of a drive that the service went through, recorded or simulated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from adhesion_can.config import Configuration
from adhesion_can.physics.doubt import DESCRIPTIONS, Doubt
from adhesion_can.physics.status import Status
from adhesion_can.plurals import in_words
from adhesion_can.reporting.drive.figures import overview_figure, state_name, surface_figures
from adhesion_can.reporting.drive.recorder import DriveRecord
from adhesion_can.reporting.drive.signal_panels import signal_panels, signal_table
from adhesion_can.reporting.drive.surfaces import A_BIN, SLIP_BINS, SurfaceSpan, longest
from adhesion_can.reporting.page import Figure, Grid, Page, Part, Table, Text
from adhesion_can.result_text import TimeScale, plus_minus

MOST_FIGURES = 12
"""Number of surfaces whose curves are shown."""
MOST_ROWS = 300
"""Number of rows of a table that are shown, the first ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveTexts:
    """What a page of a drive says besides the record.

    Attributes:
        title: Title of the page.
        lead: Work that was done, a sentence or two.
        verdict: Further results, a sentence each.
        quality: Parts of the section on data quality.
        truth: Surfaces of a simulated drive, as --truth has them; none of a recording.
        comparison: Parts that compare truth and estimate; empty for a recording.
        provenance: Version, hashes and the command that repeats the work, by name.

    """

    title: str
    lead: str
    verdict: Sequence[str] = ()
    quality: Sequence[Part] = ()
    truth: Sequence[Mapping[str, Any]] = ()
    comparison: Sequence[Part] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)


def page(record: DriveRecord, texts: DriveTexts, config: Configuration) -> Page:
    """Build the page of a drive."""
    slip_max = config.estimators.identifiability.slip_max
    sections = {"Overview": _overview(record, texts.truth, config)}
    if texts.comparison:
        sections["Truth and estimate"] = list(texts.comparison)
    sections |= {
        "Surfaces": _surfaces(record, texts.truth, slip_max),
        "Status, doubt and objections": _states(record),
        "Data quality": [*texts.quality, signal_table(record.signals, config)],
    }
    return Page(
        title=texts.title,
        lead=texts.lead,
        verdict=[*_verdict(record), *texts.verdict],
        sections=sections,
        provenance=texts.provenance,
        begin=TimeScale.beginning_at(record.first_us).heading(),
    )


def _overview(
    record: DriveRecord, truth: Sequence[Mapping[str, Any]], config: Configuration
) -> list[Part]:
    if not len(record.history):
        return [Text("The service sent no setpoint, because it accepted no input.")]
    times = TimeScale.beginning_at(record.first_us)
    signals = signal_panels(record.signals, config, times.zero_us)
    parts: list[Part] = [overview_figure(record, truth, signals)]
    if record.distance > 0:
        parts.append(overview_figure(record, truth, over_distance=True))
    else:
        parts.append(Text(
            "There is no figure over distance, because the vehicle did not move or its speed is "
            "not known."))  # fmt: skip
    return parts


def _verdict(record: DriveRecord) -> list[str]:
    """Sentences on status, surfaces, objections and doubt."""
    counts = record.counts
    total = counts.by_status.total()
    if not total:
        return ["The service sent no setpoint."]
    shares = [
        f"{name.replace('_', ' ')} {_share(count, total)}"
        for name, count in ((s.name, counts.by_status[s]) for s in Status)
        if count
    ]
    sentences = [f"Status by time: {', '.join(shares)}."]
    points = [(s.last.setpoint.mu_max, s.last.mu_max_std) for s in record.surfaces]
    sure = [mu for mu, std in points if mu is not None and std is not None and std < 0.1 * mu]
    sentences.append(_surfaces_found(len(record.surfaces), sure))
    sentences += counts.objections.sentences()
    doubts = [(d, n) for d, n in counts.by_doubt.most_common() if d in DESCRIPTIONS]
    if doubts:
        why = ", ".join(f"{DESCRIPTIONS[d]} ({_share(n, total)})" for d, n in doubts)
        sentences.append(f"Doubt: {why}; 'adhesion-can diagnose' looks for the cause.")
    elif not counts.by_doubt[Doubt.NONE]:
        sentences.append("Model check not run: doubt was not available.")
    else:
        sentences.append(
            "Model check passed: the residual shows no dependence on speed, load, axle, time or "
            "surroundings."
        )
    return sentences


def _surfaces_found(count: int, sure: Sequence[float]) -> str:
    """Sentence on the surfaces and the μ_max of those whose peak is known.

    Args:
        count: Number of surfaces.
        sure: μ_max of the surfaces where it is known within 10 %.

    """
    beginning = f"{in_words(count).capitalize()} surface{'' if count == 1 else 's'} found"
    if not sure:
        return f"{beginning}; no μ_max is known within 10 %."
    low, high = min(sure), max(sure)
    peaks = f"{low:.3f}" if len(sure) == 1 else f"{low:.3f} to {high:.3f}"
    if len(sure) < count:
        return f"{beginning}; μ_max known within 10 % on {in_words(len(sure))} of them: {peaks}."
    return f"{beginning}, μ_max {peaks}, {'each ' if count > 1 else ''}known within 10 %."


def _share(count: int, total: int) -> str:
    share = 100 * count / total
    return "below 0.1 %" if share < 0.05 else f"{share:.1f} %"


def _surfaces(
    record: DriveRecord, truth: Sequence[Mapping[str, Any]], slip_max: float
) -> list[Part]:
    if not record.surfaces:
        return [Text("No curve was sent, so there is no surface to show.")]
    times = TimeScale.beginning_at(record.first_us)
    before = [0.0, *(surface.to_m for surface in record.surfaces)]
    rows = [
        _surface_row(number, surface, begin_m, times)
        for number, (surface, begin_m) in enumerate(
            zip(record.surfaces[:MOST_ROWS], before, strict=False), start=1
        )
    ]
    columns = ("surface", "span, s", "distance, m", "μ_max", "λ_m", "c1", "c2", "c3",
               "status", "doubt")  # fmt: skip
    note = (
        "The last values sent on each surface, ± standard deviation; ± ?: not identifiable. c1, "
        "c2 and c3 belong to the Burckhardt curve that is nearest around the peak. "
        + _rest(len(record.surfaces), "surfaces")
    )
    parts: list[Part] = [Table("Surfaces found by the service.", columns, rows, note)]
    shown = longest(record.surfaces, MOST_FIGURES)
    if len(shown) < len(record.surfaces):
        parts.append(Text(f"Below: the {len(shown)} surfaces with the most samples."))
    if shown:
        parts.append(
            Text(
                f"At most {A_BIN} random samples are shown for each of {SLIP_BINS} ranges of "
                "slip, so the density of points is not that of the data. The line is the last "
                "curve sent on the surface; the diamond is its peak."
            )
        )
        figures: list[Figure] = surface_figures(record, shown, slip_max, truth)
        parts.append(figures[0] if len(figures) == 1 else Grid(figures))
    return parts


def _surface_row(
    number: int, surface: SurfaceSpan, begin_m: float, times: TimeScale
) -> tuple[str, ...]:
    out = surface.last
    theta = out.theta or (float("nan"),) * 3
    return (
        str(number),
        times.span(surface.from_us, surface.to_us).replace(" .. ", " to "),
        f"{begin_m:.0f} to {surface.to_m:.0f}",
        plus_minus(out.setpoint.mu_max, out.mu_max_std),
        plus_minus(out.setpoint.lambda_m, out.lambda_m_std),
        f"{theta[0]:.4f}",
        f"{theta[1]:.2f}",
        f"{theta[2]:.4f}",
        state_name(out.status),
        state_name(out.doubt) if out.doubt in DESCRIPTIONS else "-",
    )


def _rest(count: int, what: str) -> str:
    return f"The first {MOST_ROWS} of {count} {what}." if count > MOST_ROWS else ""


def _states(record: DriveRecord) -> list[Part]:
    """Shares of status, doubt and objections, and the log of their changes."""
    total = record.counts.by_status.total()
    rows = [
        (kind, state_name(state), str(count), _share(count, total))
        for kind, counts in (
            ("status", record.counts.by_status),
            ("doubt", record.counts.by_doubt),
            ("objection", record.counts.by_objection),
        )
        for state, count in counts.most_common()
    ]
    columns = ("of", "state", "setpoints", "share")
    parts: list[Part] = [Table("Setpoints by status, doubt and objection.", columns, rows)]
    times = TimeScale.beginning_at(record.first_us)
    ends = [change.t_us for change in record.changes[1:]]
    if record.change_count == len(record.changes):
        ends.append(record.last_us)
    log = [
        (
            f"{(change.t_us - times.zero_us) / 1e6:.2f}",
            f"{(end - change.t_us) / 1e6:.2f}",
            f"{change.distance:.0f}",
            state_name(change.status),
            state_name(change.doubt),
            state_name(change.objection),
        )
        for change, end in zip(record.changes[:MOST_ROWS], ends, strict=False)
    ]
    headings = ("from s", "for s", "at m", "status", "doubt", "objection")
    caption = "Log of changes of status, doubt and objection."
    parts.append(Table(caption, headings, log, _rest(record.change_count, "changes")))
    return parts
