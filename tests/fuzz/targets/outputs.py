"""Output messages of a user's database: ours with changes, composed and decoded by cantools."""

from copy import copy
from math import inf, nan
from pathlib import Path

from cantools.database.can import Database, Message
from cantools.database.can.formats.dbc import DbcSpecifics
from cantools.database.can.formats.dbc.dbc_attribute import DbcAttribute
from cantools.database.can.formats.dbc.dbc_attribute_definition import DbcAttributeDefinition
from cantools.database.conversion import BaseConversion

from adhesion_can.bus.codec import AVAILABLE_FROM_BITS
from adhesion_can.bus.database import OUTPUT_MESSAGES, CanDatabase, load_database
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.status import Status
from adhesion_can.service import output_messages
from adhesion_can.service.output_layout import PROTECTION, require_layout
from adhesion_can.service.output_messages import AXLE_SIGNALS, Health, OutputMessages
from adhesion_can.service.outputs import Outputs, Setpoint
from tests.fuzz.octets import Octets
from tests.fuzz.rule import value_or_refusal
from tests.fuzz.targets.databases import has_overlap

_OWN = {name: load_database().message(name) for name in OUTPUT_MESSAGES}
_MOST_CHANGES = 4  # fewer than signals, which can be taken away
_SIZES = (8, 8, 12, 64, 9, 16, 7, 2, 1, 0, 65)
_CYCLES_MS = (20, None, 0, -20, 0.5, 1e-9, nan, inf, 86_400_000, 86_400_001, 10**400, "20", "")
_DATA_IDS = (0, 0xFFFF, 0x10000, -1, 5.0, 1.5, nan, inf, "7", "x", "")
_SCALES = (1, 0, -1, 2, 0.5, 1.0, 1e-5, -2e-5, 5e-324, 1e300, nan, inf, -inf, 2**63, 10**400)
_OFFSETS = (0, 1, -1, 0.5, -40, 1e-3, 2**63, -(2**63), 1e300, nan, inf, -(10**400))

_POINT = Setpoint(0.3, 0.05, 0.5)
_FULL = Outputs(
    Status.TRACKING,
    _POINT,
    {1: _POINT, 6: _POINT},
    (0.4, 30.0, 0.3),
    inf,
    0.01,
    1e9,
    objection=Objection.SLIPS_BEYOND_MODEL,
)
_HEALTH = Health(10**9, 0, None)


def _sent(content):
    """Values in the frames of each message, by signal."""

    def point(names, values):
        return dict(zip(names, values, strict=True))

    setpoint = point(("MuMax", "LambdaM", "CreepSpeedSetpoint"), content.setpoint)
    return {
        "AdhesionSetpoint": [{"Status": content.status, **setpoint}],
        "AdhesionModel": [
            {
                **point(("C1", "C2", "C3"), content.theta or (None,) * 3),
                "Objection": content.objection,
            }
        ],
        "AdhesionQuality": [
            {
                "MuMaxStd": content.mu_max_std,
                "LambdaMStd": content.lambda_m_std,
                "SurfaceAge": content.surface_age_s,
                "Doubt": content.doubt,
            }
        ],
        "AxleSetpoint": [
            point(names, (axle, *content.axles.get(axle, Setpoint())))
            for axle, names in AXLE_SIGNALS.items()
        ],
        "ServiceStatus": [
            {
                "State": content.status,
                "FramesRejected": _HEALTH.rejected,
                "FramesLost": _HEALTH.lost,
                "LoopTimeP99": _HEALTH.loop_time_p99_us,
            }
        ],
    }


_CONTENTS = [(content, _sent(content)) for content in (Outputs(), _FULL)]


def outputs(data):
    """Output messages with changes: refused, or each is sent as long as it is, with its values."""
    changed = _changed_messages(Octets(data))
    db = Database()
    # Given to `Database`, the messages of our own would make their codecs anew.
    db.messages.extend((_OWN | changed).values())
    output_messages.require_layout = _require_layout
    try:
        messages = value_or_refusal(OutputMessages, CanDatabase(Path("fuzz.dbc"), "", db), ())
    finally:
        output_messages.require_layout = require_layout
    if messages is None:
        return
    assert all(cycle_us > 0 for cycle_us in messages.cycles_us.values())
    for content, sent in _CONTENTS:
        for name, wanted in sent.items():
            frames = messages.compose(name, 0, content, lambda: _HEALTH)
            assert all(len(frame.data) == messages.sizes[name] for frame in frames)
            if name in changed:  # the others are decoded as ever
                _require_decoded(changed[name], frames, wanted)


def _require_layout(message, own, where):
    """The layout of a message is good; that of ours without changes is so every time."""
    if message is not own:
        require_layout(message, own, where)


def _changed_messages(choices):
    """Messages that have changes, by name."""
    drafts = {}
    for _ in range(_MOST_CHANGES):
        if choices:
            name = choices.among(OUTPUT_MESSAGES)
            drafts.setdefault(name, _Draft(_OWN[name])).change(choices)
    return {name: draft.message() for name, draft in drafts.items()}


class _Message(Message):
    """A message that makes its codecs only where they are wanted: most messages are refused."""

    def refresh(self, strict=None):
        """Nothing yet, where cantools makes the codecs."""

    def make_codecs(self):
        """Make the codecs, by which it decodes."""
        super().refresh(strict=False)


class _Draft:
    """One of our output messages, to be changed.

    Args:
        own: The message as it is in our database.

    """

    def __init__(self, own):
        self._signals = list(own.signals)
        self._name, self._size, self._cycle_ms = own.name, own.length, own.cycle_time
        self._number, self._is_extended, self._attributes = own.frame_id, False, {}

    def message(self):
        """The message as it is by now."""
        return _Message(
            self._number,
            self._name,
            self._size,
            self._signals,
            cycle_time=self._cycle_ms,
            dbc_specifics=DbcSpecifics(attributes=self._attributes),
            is_extended_frame=self._is_extended,
            strict=False,
        )

    def change(self, choices):
        """Change the message, or one of its signals."""
        match choices.below(14):
            case 0:
                self._size = choices.among(_SIZES)
            case 1:
                number = choices.number(4)
                self._is_extended = bool(number >> 31)
                self._number = number & (0x1FFFFFFF if self._is_extended else 0x7FF)
            case 2:
                self._cycle_ms = choices.among(_CYCLES_MS)
            case 3:
                definition = DbcAttributeDefinition("E2EDataId")
                value = choices.among(_DATA_IDS)
                self._attributes = {"E2EDataId": DbcAttribute(value, definition)}
            case 4:
                self._signals.pop(choices.below(len(self._signals)))
            case 5:
                self._signals.append(copy(choices.among(self._signals)))
            case kind:
                place = choices.below(len(self._signals))
                self._signals[place] = copy(self._signals[place])
                _change_signal(self._signals[place], kind, choices)


def _change_signal(signal, kind, choices):
    """Change place, type, factor or page of a signal; each kind of change has a number."""
    match kind:
        case 6:
            signal.start = choices.below(64)
        case 7:
            signal.start = choices.below(520)
        case 8:
            signal.length = 1 + choices.below(66)
        case 9:
            signal.byte_order = choices.among(("big_endian", "little_endian"))
        case 10:
            signal.is_signed = not signal.is_signed
        case 11:
            signal.conversion = _conversion(signal, scale=choices.among(_SCALES))
        case 12:
            signal.conversion = _conversion(signal, offset=choices.among(_OFFSETS))
        case 13:
            _change_kind(signal, choices)


def _change_kind(signal, choices):
    """Make a signal a float, a multiplexer, or one of other pages; or what it was not."""
    kind = choices.number()
    if kind & 1:
        signal.conversion = _conversion(signal, is_float=not signal.conversion.is_float)
    if kind & 2:
        signal.is_multiplexer = not signal.is_multiplexer
    if kind & 4:
        signal.multiplexer_signal = choices.among((None, "Axle", "Status", "C1", "Crc", "Nobody"))
        signal.multiplexer_ids = None
        if signal.multiplexer_signal:
            signal.multiplexer_ids = [choices.below(16), choices.below(16)]


def _conversion(signal, **changes):
    """Conversion of a signal with changes."""
    old = signal.conversion
    parts = {"scale": old.scale, "offset": old.offset, "is_float": old.is_float}
    return BaseConversion.factory(**parts | changes, choices=old.choices)


def _require_decoded(message, frames, sent):
    """cantools decodes what was sent in the frames of a message, and no other of our signals."""
    own = _protection(_OWN[message.name])
    if _protection(message) != own or has_overlap(message):
        return  # checksum and counter are no values; of signals that share bits cantools knows one
    message.make_codecs()
    signals = {signal.name: signal for signal in message.signals}
    for frame, values in zip(frames, sent, strict=True):
        found = message.decode(frame.data, decode_choices=False)
        assert found.keys() - PROTECTION == values.keys() & signals.keys()
        for name in values.keys() & signals.keys():  # a database may lack one of them
            raw = _nearest_raw(signals[name], values[name])
            wanted = signals[name].conversion.raw_to_scaled(raw, decode_choices=False)
            assert found[name] == wanted, f"{name}: {found[name]} instead of {wanted}"


def _protection(message):
    """Signals of checksum and counter."""
    return [signal for signal in message.signals if signal.name in PROTECTION]


def _nearest_raw(signal, value):
    """The raw value nearest to a value; the highest stands for none where it is long enough."""
    lowest = -(1 << signal.length - 1) if signal.is_signed else 0
    highest = lowest + (1 << signal.length) - 1
    if value is None:
        return highest
    if signal.length >= AVAILABLE_FROM_BITS:
        highest -= 1
    ratio = (value - float(signal.conversion.offset)) / float(signal.conversion.scale)
    return round(min(max(ratio, lowest), highest))
