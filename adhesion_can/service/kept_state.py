"""What a service has learned, kept in a file: the surfaces that it has identified.

The file is JSON with a version, the vehicle that it belongs to, and a checksum over all of it. What
is damaged, of another vehicle or of another version is refused with a reason; surfaces that are too
old are left out.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from math import isfinite
from operator import gt
from typing import Any, NamedTuple

import numpy as np

from adhesion_can.config import Configuration
from adhesion_can.errors import RecordingError
from adhesion_can.estimation.extended.model import LARGEST_BASE
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.status import Status
from adhesion_can.printable import printable
from adhesion_can.service.log_comments import format_comment, format_stamp, read_comments
from adhesion_can.service.outputs import Outputs

FORMAT, VERSION = "adhesion-can state", 1
MOST_SURFACES = 8
"""Number of surfaces that are kept, the latest ones."""
LARGEST_TEXT = 1 << 20
"""Size of a state file that is read, bytes; one of 8 surfaces has 2 KiB."""
LATEST_US = 1 << 62
"""Latest time that a clock can show, µs since the epoch."""
SAME_SURFACE_US = 500_000
"""Change of the time since when a surface is there, µs, that makes no other surface of it."""


_COMMENT = "adhesion-can-surfaces"


class StateError(ValueError):
    """A state that cannot be used; the message says why."""


class KeptSurface(NamedTuple):
    """A surface that was identified.

    Attributes:
        theta: Parameters (c1, c2, c3) of its curve.
        since_us: Time at which the drive came upon it, µs since the epoch.
        seen_us: Time at which it was seen last, µs since the epoch.

    """

    theta: CurveParameters
    since_us: int
    seen_us: int


@dataclass(frozen=True, slots=True)
class KeptState:
    """What a service has learned.

    Attributes:
        vehicle: Fingerprint of the vehicle that it belongs to.
        surfaces: Surfaces that were identified, the latest one last.

    """

    vehicle: str
    surfaces: tuple[KeptSurface, ...] = ()

    @property
    def curves(self) -> tuple[CurveParameters, ...]:
        """Parameters (c1, c2, c3) of the surfaces."""
        return tuple(surface.theta for surface in self.surfaces)

    def with_outputs(self, t_us: int, outputs: Outputs) -> "KeptState":
        """The state after a setpoint.

        Only what was sent with confidence is learned: TRACKING, no doubt, both of the peak known.

        Args:
            t_us: Due time of the setpoint, µs.
            outputs: What was sent.

        """
        since_us = t_us - round((outputs.surface_age_s or 0.0) * 1e6)
        others = self.surfaces
        if others and abs(others[-1].since_us - since_us) < SAME_SURFACE_US:
            others = others[:-1]
        if outputs.doubt not in (Doubt.NONE, Doubt.NOT_AVAILABLE):
            # What cannot be explained was in the curve before it showed.
            return self if others is self.surfaces else replace(self, surfaces=others)
        stds = (outputs.mu_max_std, outputs.lambda_m_std)
        known = all(std is not None and isfinite(std) for std in stds)
        if outputs.status is not Status.TRACKING or outputs.theta is None or not known:
            return self
        surfaces = (*others, KeptSurface(outputs.theta, since_us, t_us))
        return replace(self, surfaces=surfaces[-MOST_SURFACES:])


def with_surfaces(configuration: Configuration, curves: Sequence[CurveParameters]) -> Configuration:
    """Configuration that knows surfaces, the latest last; nothing is sent of them before new data.

    For the tracker they are surfaces that may come again; a search starts at the latest one.
    """
    if not curves:
        return configuration
    settings = configuration.estimators
    search = settings.evolution
    theta0 = tuple(np.clip(curves[-1], search.lower, search.upper).tolist())
    settings = replace(
        settings,
        evolution=replace(search, theta0=theta0),
        tracker=replace(
            settings.tracker, known_surfaces=tuple(curve for curve in curves if curve[2] > 0)
        ),
    )
    return replace(configuration, estimators=settings)


def kept_curves_to_lines(t_us: int, curves: Sequence[CurveParameters]) -> str:
    """A comment for the service's log, so that a replay begins with the same; '' without any."""
    text = json.dumps(curves, separators=(",", ":"))
    return format_comment(format_stamp(t_us), _COMMENT, text) if curves else ""


def read_kept_curves(comments: Iterable[bytes], where: str) -> tuple[CurveParameters, ...]:
    """Curves with which a service began, as its log has them; none where it had none.

    Args:
        comments: Comment lines of the log, or all its lines.
        where: Name of the log, for errors.

    Raises:
        RecordingError: They are damaged.

    """
    try:
        for comment in read_comments(comments, _COMMENT):
            return _curves(json.loads(comment.text))
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise RecordingError(
            where,
            f"the surfaces with which the service began are damaged: {printable(str(error))}",
            "copy the log again, or delete that line: other setpoints come out then",
        ) from error
    return ()


def fingerprint(configuration: Configuration) -> str:
    """Hash of what curves depend on: the vehicle's data, the signals and the extended model."""
    model = configuration.model
    parts = (
        repr(configuration.vehicle),
        repr(configuration.choices),
        configuration.database.sha256,
        "" if model is None else model.sha256,
    )
    return sha256("\n".join(parts).encode()).hexdigest()


def state_to_text(state: KeptState) -> str:
    """Text of a state's file."""
    surfaces = [
        {"c1": c1, "c2": c2, "c3": c3, "since_us": since_us, "seen_us": seen_us}
        for (c1, c2, c3), since_us, seen_us in state.surfaces
    ]
    document = {
        "format": FORMAT,
        "version": VERSION,
        "vehicle": state.vehicle,
        "surfaces": surfaces,
    }
    return json.dumps({**document, "sha256": _checksum(document)}, indent=1) + "\n"


def state_from_text(text: str, vehicle: str, now_us: int, most_age_s: float) -> KeptState:
    """State from the text of its file, without surfaces that are too old.

    Args:
        text: Text of the file.
        vehicle: Fingerprint of the vehicle that asks for it.
        now_us: Present time, µs since the epoch.
        most_age_s: Largest age of a surface, s.

    Raises:
        StateError: The text is damaged, of another version or vehicle, or too old.

    """
    document = _document(text)
    if document["vehicle"] != vehicle:
        raise StateError("it belongs to another vehicle, database or model")
    try:
        surfaces = tuple(map(_surface, document["surfaces"]))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise StateError(f"damaged: {error}") from error
    # A clock that was set back makes a surface young; it is not refused.
    young = tuple(surface for surface in surfaces if now_us - surface.seen_us <= most_age_s * 1e6)
    if surfaces and not young:
        age_h = (now_us - surfaces[-1].seen_us) / 3.6e9
        raise StateError(f"too old: it last saw a surface {age_h:.1f} h ago")
    return KeptState(vehicle, young[-MOST_SURFACES:])


def _document(text: str) -> dict[str, Any]:
    if len(text) > LARGEST_TEXT:
        raise StateError("damaged: too large")
    try:
        document = json.loads(text)
        checksum = _checksum(document)
    except (ValueError, RecursionError) as error:
        raise StateError("damaged: not JSON") from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise StateError("it is not a state file of adhesion-can")
    if document.get("version") != VERSION:
        raise StateError(f"version {document.get('version')!r}, this service reads {VERSION}")
    if document.pop("sha256", None) != checksum:
        raise StateError("damaged: the checksum is wrong")
    if not {"vehicle", "surfaces"} <= set(document):
        raise StateError("damaged: vehicle or surfaces missing")
    return document


def _checksum(document: Any) -> str:
    """Hash of all that a document holds besides its hash, hex."""
    if isinstance(document, dict):
        document = {key: value for key, value in document.items() if key != "sha256"}
    return sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()


_CURVE = ("c1", "c2", "c3")


def _curve(table: Any) -> CurveParameters:
    c1, c2, c3 = (float(table[name]) for name in _CURVE)
    if not (all(map(isfinite, (c1, c2, c3))) and c1 > 0 and c2 > 0 and 0 <= c3 < c1 * c2):
        raise ValueError("no curve")
    if any(map(gt, (c1, c2, c3), LARGEST_BASE)):
        raise ValueError("a curve that no wheel/rail contact has")
    return c1, c2, c3


def _curves(rows: Any) -> tuple[CurveParameters, ...]:
    """Curves from a list of lists, the first `MOST_SURFACES`."""
    if not isinstance(rows, list):
        raise TypeError("no list of curves")
    return tuple(_curve(dict(zip(_CURVE, row, strict=True))) for row in rows[:MOST_SURFACES])


def _surface(table: Any) -> KeptSurface:
    theta = _curve(table)
    since_us, seen_us = (int(table[name]) for name in ("since_us", "seen_us"))
    if max(abs(since_us), abs(seen_us)) > LATEST_US:
        raise ValueError("no time")
    return KeptSurface(theta, since_us, seen_us)
