"""Slips that a drive reached, and the peaks that they show."""

import numpy as np

from adhesion_can.estimation.batch_result import BatchResult
from adhesion_can.physics.samples import Samples
from adhesion_can.plurals import counted
from adhesion_can.result_text import TimeScale


def describe_excitation(
    samples: Samples,
    fitted: BatchResult,
    findings: list[str],
    limits: list[str],
    times: TimeScale | None = None,
) -> bool:
    """Add sentences about the slips that were driven and the peaks that they show.

    Args:
        samples: Samples, at least one.
        fitted: Their batch fit.
        findings: Sentences about what can be estimated.
        limits: Sentences about what cannot be estimated.
        times: Scale of the times for people; None: that of the fit.

    Returns:
        Whether a segment shows its peak.

    """
    low, high = np.quantile(np.abs(samples.slip), [0.05, 0.98])
    findings.append(f"{len(samples)} samples, |slip| from {low:.4f} to {high:.4f} (5 % to 98 %)")
    known = [s for s in fitted.segments if s.estimate.identifiable.both]
    if known:
        findings.append(
            f"{len(known)} of {counted(len(fitted.segments), 'surface')} with an identifiable peak"
        )
    times = times or fitted.times
    limits.extend(sentence for s in fitted.segments if (sentence := s.sentence(times)))
    return bool(known)
