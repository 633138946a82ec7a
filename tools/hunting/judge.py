"""What a diagnosis is worth beside the truth. The rules are here and nowhere else."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from contact import PeakErrors, blames_instrument, contact_outcome, peak_errors
from outside import OUTSIDE_GROUPS, formula_channels, outside_outcome
from plan import find_group, split_form

Record = dict[str, Any]
CONTACT_GROUPS = ("contact", "contact+", "points")
MOST_RIVALS = 1
"""Rivals that a cause may have; with more it names everything and nothing, and counts as wrong."""


@dataclass(frozen=True)
class JudgedRecord:
    """A record, judged.

    Attributes:
        kind: Kind of the world.
        group: Group of the kind.
        outcome: 'named' (by its own name), 'rival' (declared indistinguishable), 'wrong', 'both',
            'one', 'unexplained' (with the right channel where there is one), 'wrong channel',
            'nothing', 'failed'; for contacts see `contact.contact_outcome`,
            for worlds by others `outside.outside_outcome`.
        answer: What was named, or the channel, for the confusion table.
        inside: Whether each parameter that can be compared lies in its interval.
        covered: Whether the gain's interval holds the true gain; None: not known.
        gain_error: Reported less true gain, %; None: not known.
        floor_ratio: RMSE of the held-out data after extension, over their noise floor.
        seconds: Duration of the diagnosis, s.
        rss_mb: Peak memory of the diagnosis, MiB.
        blames_instrument: Whether a sensor or the vehicle's data were blamed without reason.
        excess: Share by which what is hidden raises the RMSE of the plain fit; None: not known.
        peak: Peak of the extended model beside the true one, for contacts; None: not known.

    """

    kind: str
    group: str
    outcome: str
    answer: tuple[str, ...]
    inside: tuple[bool, ...]
    covered: bool | None
    gain_error: float | None
    floor_ratio: float | None
    seconds: float
    rss_mb: float | None
    blames_instrument: bool = False
    excess: float | None = None
    peak: PeakErrors | None = None

    @property
    def found(self) -> bool:
        """Whether every hidden effect was named, by name or with its rivals."""
        return self.outcome in ("named", "rival", "both")


def judge_record(record: Record) -> JudgedRecord:
    """Judge one record."""
    form, kind = split_form(record["kind"])
    if form:
        inner = judge_record(record | {"kind": kind, "diagnosis": _of_form(form, record)})
        return replace(inner, kind=record["kind"], group=form)
    diagnosis = record.get("diagnosis")
    if diagnosis is None or record["status"] != 0:
        outcome, answer, inside = "failed", (str(record["status"]),), ()
    else:
        outcome, answer = _outcome(record, diagnosis)
        # The numbers of a contact law are not those of the family that a diagnosis fits.
        compared = find_group(kind) not in CONTACT_GROUPS
        inside = tuple(_inside(record, diagnosis["causes"])) if compared else ()
    covered, error, ratio = _gain(record) if diagnosis else (None, None, None)
    of_contact = diagnosis is not None and find_group(kind) in CONTACT_GROUPS
    return JudgedRecord(
        kind,
        find_group(kind),
        outcome,
        answer,
        inside,
        covered,
        error,
        ratio,
        float(record["seconds"]),
        record["rss_mb"],
        blames_instrument=of_contact and blames_instrument(record, diagnosis),
        excess=max(record.get("truth", {}).get("excess") or (), default=None),
        peak=peak_errors(record["truth"], diagnosis) if of_contact else None,
    )


def _of_form(form: str, record: Record) -> Record | None:
    """The diagnosis; of a table a factor in the column of an effect is this effect."""
    diagnosis: Record | None = record.get("diagnosis")
    if form != "table" or diagnosis is None:
        return diagnosis
    names = {f"channel:{name}": name for name in ("humidity", "rail_temperature", "sanding")}
    causes = [c | {"effect": names.get(c["effect"], c["effect"])} for c in diagnosis["causes"]]
    return diagnosis | {"causes": causes}


def _is_factor_of(channel: str, cause: Record) -> bool:
    """Whether a cause is a factor in one channel, or a formula that depends on it alone."""
    if cause["effect"] != "formula":
        return bool(cause["effect"] == f"channel:{channel}")
    return formula_channels(cause) == {channel}


def _outcome(record: Record, diagnosis: Record) -> tuple[str, tuple[str, ...]]:
    causes = diagnosis["causes"]
    names = tuple(cause["effect"] for cause in causes)
    if any(len(_rivals(cause)) > MOST_RIVALS for cause in causes):
        return "wrong", names
    if find_group(record["kind"]) in CONTACT_GROUPS:
        return contact_outcome(record, diagnosis)
    if find_group(record["kind"]) in OUTSIDE_GROUPS:
        return outside_outcome(record, diagnosis)
    if find_group(record["kind"]) in ("null", "out"):
        return _without_effect(record["truth"]["channel"], diagnosis, names)
    true = [e["effect"] for e in record["truth"]["effects"]]
    verdict, channel = diagnosis["verdict"], diagnosis["channel"]
    if verdict == "named" and len(true) == 1:
        return single_outcome(true[0], causes), names
    if verdict == "named":
        return {2: "both", 1: "one", 0: "wrong"}[pair_count(true, causes)], names
    # What it names beside a channel that it does not know is no answer.
    if verdict == "unexplained":
        return "unexplained", (*names, f"[{channel}]")
    return "nothing", ()


def _without_effect(
    wanted: str | None, diagnosis: Record, names: tuple[str, ...]
) -> tuple[str, tuple[str, ...]]:
    """Outcome and answer where no effect of the library is hidden, perhaps a channel's."""
    causes, verdict, channel = diagnosis["causes"], diagnosis["verdict"], diagnosis["channel"]
    # A factor in the right column is an answer as well, and so is a formula in it alone.
    if wanted is not None and causes and all(_is_factor_of(wanted, one) for one in causes):
        return "unexplained", names
    if names or verdict == "named":
        return "wrong", names
    if verdict == "nothing_found":
        return "nothing", ()
    right = wanted is None or wanted == channel
    return ("unexplained" if right else "wrong channel"), (f"[{channel}]",)


def single_outcome(true: str, causes: Sequence[Record]) -> str:
    """The true id is a cause, or a rival of one, and every other cause is a rival of that one."""
    for cause in causes:
        others = {c["effect"] for c in causes if c is not cause}
        if true in {cause["effect"], *_rivals(cause)} and others <= _rivals(cause):
            return "named" if cause["effect"] == true else "rival"
    return "wrong"


def pair_count(true: Sequence[str], causes: Sequence[Record]) -> int:
    """How many of two effects are named, each by a cause of its own or as its rival."""
    first, second = (
        {k for k, c in enumerate(causes) if effect in {c["effect"], *_rivals(c)}} for effect in true
    )
    if first and second and len(first | second) > 1:
        return 2
    return 1 if first or second else 0


def _rivals(cause: Record) -> set[str]:
    return set(cause["rivals"] or ())


def _inside(record: Record, causes: Sequence[Record]) -> list[bool]:
    """Parameters of effects named by their own name: the truth within value ± 1.96 std."""
    found = []
    for hidden in record["truth"]["effects"]:
        for cause in causes:
            if cause["effect"] != hidden["effect"]:
                continue
            parameters = cause["parameters"] or {}
            for name, true in hidden["parameters"].items():
                if name == "axle" or parameters.get(name) is None:
                    continue  # another form of the effect has other parameters
                if parameters[name]["std"] is not None:
                    found.append(
                        abs(parameters[name]["value"] - true) <= 1.96 * parameters[name]["std"]
                    )
            axle = (parameters.get("axle") or {}).get("value")
            if axle is not None and axle != hidden["parameters"].get("axle"):
                found = [False for _ in found]
    return found


def _gain(record: Record) -> tuple[bool | None, float | None, float | None]:
    # Noise of the slip makes most of what is left where a curve is steep: no floor, no true gain.
    if find_group(record["kind"]) in CONTACT_GROUPS:
        return None, None, None
    gain, true, floor = record["diagnosis"]["gain"], record.get("true_gain"), record.get("floor")
    after = gain["rmse_after"]
    ratio = after / floor if after is not None and floor else None
    if true is None or gain["percent"] is None:
        return None, None, ratio
    error = gain["percent"] - true
    if not gain["interval"] or None in gain["interval"]:
        return None, error, ratio
    low, high = gain["interval"]
    return low <= true <= high, error, ratio
