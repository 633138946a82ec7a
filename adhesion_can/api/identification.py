"""Batch fit of the adhesion curve to arrays, samples or recordings."""

from collections.abc import Iterable
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from adhesion_can.api.configuration import ConfigurationLike, ModelLike, as_configuration
from adhesion_can.api.inputs import RecordingLike, as_recordings
from adhesion_can.api.samples import are_tables, load_recording_samples, load_table_samples
from adhesion_can.errors import InputError
from adhesion_can.estimation.batch_fit import identify as _identify
from adhesion_can.estimation.batch_result import BatchResult
from adhesion_can.physics.curves import FAMILIES, CurveFamily
from adhesion_can.physics.samples import Samples
from adhesion_can.recordings.recording import Recording

ALL_CURVES = "all"
"""Value of the option `curve` that asks for every family."""


@overload
def identify(
    slip: ArrayLike,
    adhesion: ArrayLike,
    *,
    time_s: ArrayLike | None = None,
    configuration: ConfigurationLike = None,
    curve: str | None = None,
) -> BatchResult: ...


@overload
def identify(
    slip: Samples | RecordingLike | Iterable[RecordingLike],
    *,
    configuration: ConfigurationLike = None,
    model: ModelLike = None,
    curve: str | None = None,
) -> BatchResult: ...


def identify(
    slip: ArrayLike | Samples | RecordingLike | Iterable[RecordingLike],
    adhesion: ArrayLike | None = None,
    *,
    time_s: ArrayLike | None = None,
    configuration: ConfigurationLike = None,
    model: ModelLike = None,
    curve: str | None = None,
) -> BatchResult:
    """Maximum-likelihood fit of one curve, and of one for each segment of constant surface.

    c1, c2 and c3 are Burckhardt's. Where the data contradict his form, the peak is that of the
    curve families that hold (`BatchResult.rails`), with the spread between them in its standard
    deviations.

    Args:
        slip: Slip ratios λ, shape (n,); or samples, or recordings, or paths of
            recordings or of tables.
        adhesion: Adhesion coefficients μ, shape (n,); with arrays alone.
        time_s: Times, s, ascending, shape (n,); without them all points are of one segment.
        configuration: Vehicle, database, roles and settings.
        model: Extended model whose effects are removed before the fit; with recordings alone.
        curve: Name of a curve family to fit besides, such as 'polach', or 'all' to compare all of
            them by held-out score; the result is `BatchResult.curves`.

    Raises:
        InputError: The arrays do not fit together, no sample is usable, or no family has the name.
        ConfigError: The roles do not suffice to form adhesion.
        RecordingError: A recording cannot be read, or holds no known frame.

    Examples:
        >>> import numpy as np
        >>> slip = np.linspace(0.001, 0.2, 500)
        >>> adhesion = 0.4 * (1 - np.exp(-40 * slip)) - 0.06 * slip
        >>> estimate = identify(slip, adhesion).whole
        >>> round(estimate.c1, 3), round(estimate.c2, 1), round(estimate.c3, 3)
        (0.4, 40.0, 0.06)

    """
    config = as_configuration(configuration, model)
    families = families_by_option(curve)
    labels = None
    if adhesion is not None:
        samples, where = _samples_from_arrays(slip, adhesion, time_s), "slip, adhesion"
    elif isinstance(slip, Samples):
        samples, where = slip, "samples"
    else:
        paths = _paths(slip)
        where = ", ".join(map(str, paths))
        if are_tables(paths, config):
            loaded = load_table_samples(paths, config)
            samples, labels = loaded.samples, loaded.labels
        else:
            recordings = as_recordings(slip)  # type: ignore[arg-type]  # `_paths` has checked it
            samples = load_recording_samples(recordings, config).samples
    settings, noise = config.estimators.identifiability, config.estimators.noise
    result = _identify(
        samples, settings, labels=labels, families=families, noise=noise, judge_family=True
    )
    if result is None:
        raise InputError(
            where,
            "no usable sample (a moving vehicle, slip within the curve's range)",
            "give slip ratios, not percent, of a drive in which the axles pull or brake",
        )
    return result


def families_by_option(curve: str | None) -> tuple[CurveFamily, ...]:
    """Curve families of the option `curve`: one by its name, all of them, or none.

    Raises:
        InputError: No family has the name.

    """
    if curve is None:
        return ()
    if curve == ALL_CURVES:
        return tuple(FAMILIES.values())
    if curve not in FAMILIES:
        raise InputError(
            "curve", f"no family {curve!r}", f"give one of {', '.join(FAMILIES)}, or {ALL_CURVES}"
        )
    return (FAMILIES[curve],)


def _paths(given: object) -> list[Path]:
    """Paths of recordings or tables; an InputError where something else was given."""
    paths = []
    for item in given if isinstance(given, list | tuple) else [given]:
        if not isinstance(item, str | Path | Recording):
            fix = "give slip and adhesion, arrays of one length"
            raise InputError("adhesion", "is missing", fix)
        paths.append(item.path if isinstance(item, Recording) else Path(item))
    return paths


def _samples_from_arrays(slip: object, adhesion: ArrayLike, time_s: ArrayLike | None) -> Samples:
    """Samples from plain arrays; an InputError where they do not fit together."""
    columns = {}
    given = {"slip": slip, "adhesion": adhesion} | ({} if time_s is None else {"time_s": time_s})
    for name, values in given.items():
        try:
            columns[name] = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InputError(name, f"not numbers ({error})", "give an array of numbers") from error
    shapes = {name: column.shape for name, column in columns.items()}
    if any(len(shape) != 1 for shape in shapes.values()) or len(set(shapes.values())) > 1:
        shapes_text = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise InputError(
            "identify", f"shapes differ or are not (n,): {shapes_text}", "give one length"
        )
    if time_s is None:
        return Samples.curve(columns["slip"], columns["adhesion"])
    time = columns["time_s"]
    if not np.isfinite(time).all() or (np.diff(time) < 0).any():
        raise InputError("time_s", "not finite, or not ascending", "sort the points by time")
    stamps = np.round(time * 1e6).astype(np.int64)
    return Samples.curve(columns["slip"], columns["adhesion"], stamps)
