"""dbc/adhesion.dbc against the contract's table, which is written out here by hand."""

import re
import warnings
from pathlib import Path

import cantools
import pytest

from adhesion_can.bus.database import (
    DEMAND_MESSAGES,
    INPUT_MESSAGES,
    OUTPUT_MESSAGES,
    cycle_us,
    e2e_data_id,
    load_database,
    packaged_path,
)
from adhesion_can.errors import DatabaseError
from adhesion_can.physics.doubt import DESCRIPTIONS, Doubt
from adhesion_can.physics.objection import Objection
from tests.bus.bus_helpers import DBC, sealed

STATUS = {
    0: "INIT",
    1: "TRACKING",
    2: "LOW_EXCITATION",
    3: "SURFACE_CHANGE",
    4: "STALE_INPUT",
    5: "FAULT",
}
SOURCE = {
    0: "unknown",
    1: "radar",
    2: "GNSS",
    3: "trailing axle",
    4: "derived from driven axles",
}
DIRECTION = {0: "unknown", 1: "forward", 2: "reverse", 3: "not available"}
DOUBT = {
    0: "none",
    1: "shape of the curve",
    2: "speed",
    3: "axle load",
    4: "direction of effort",
    5: "axle",
    6: "time",
    7: "rate of slip",
    8: "surroundings",
    15: "not available",
}
OBJECTION = {
    0: "none",
    1: "speed jump",
    2: "wheels jump",
    3: "efforts jump",
    4: "loads jump",
    5: "speed deviates",
    6: "loads off",
    7: "peak beyond the ceiling",
    8: "slips beyond the model",
    9: "no relief of late",
    10: "observed speed not exact enough",
    11: "efforts rose since the last relief",
    12: "rail changed since the last relief",
}
RAIN = {0: "none", 1: "light", 2: "heavy", 3: "not available"}

# name: (start, length, signed, factor, offset, unit, lowest, highest, start value)
U16, S16 = 0xFFFF, 0x7FFF


def u16(start, factor, unit, highest):
    return (start, 16, False, factor, 0, unit, 0, highest, U16)


def s16(start, factor, unit, lowest, highest):
    return (start, 16, True, factor, 0, unit, lowest, highest, S16)


def axles(prefix, first, field):
    return {f"{prefix}_Ax{first + i}": field(16 * (i + 1)) for i in range(3)}


def wheel(start):
    return u16(start, 0.002, "rad/s", 131.068)


def effort(start):
    return s16(start, 10, "N", -327680, 327660)


def load(start):
    return u16(start, 10, "N", 655340)


STATUS_FIELD = (12, 4, False, 1, 0, "-", 0, 5, 0)
SETPOINT = {
    "MuMax": u16(16, 2e-5, "-", 1.31068),
    "LambdaM": u16(32, 1e-5, "-", 0.65534),
    "CreepSpeedSetpoint": u16(48, 5e-4, "m/s", 32.767),
}

CONTRACT = {
    (0x101, "WheelSpeeds1", 10, "LOCO"): axles("WheelSpeed", 1, wheel),
    (0x102, "WheelSpeeds2", 10, "LOCO"): axles("WheelSpeed", 4, wheel),
    (0x111, "VehicleSpeed", 20, "LOCO"): {
        "VehicleSpeed": u16(16, 0.002, "m/s", 131.068),
        "VehicleSpeedSource": (32, 4, False, 1, 0, "-", 0, 4, 0),
        "Direction": (36, 2, False, 1, 0, "-", 0, 3, 3),
    },
    (0x121, "TractiveEffort1", 10, "DRIVE"): axles("TractiveEffort", 1, effort),
    (0x122, "TractiveEffort2", 10, "DRIVE"): axles("TractiveEffort", 4, effort),
    (0x131, "AxleLoads1", 200, "LOCO"): axles("AxleLoad", 1, load),
    (0x132, "AxleLoads2", 200, "LOCO"): axles("AxleLoad", 4, load),
    (0x141, "Environment", 1000, "LOCO"): {
        "AmbientTemperature": (16, 8, False, 0.5, -40, "degC", -40, 87, 0xFF),
        "RailTemperature": (24, 8, False, 0.5, -40, "degC", -40, 87, 0xFF),
        "RelativeHumidity": (32, 8, False, 0.5, 0, "%", 0, 100, 0xFF),
        "SandingActive": (40, 1, False, 1, 0, "-", 0, 1, 0),
        "Rain": (41, 2, False, 1, 0, "-", 0, 3, 3),
    },
    (0x151, "TrackGeometry", 200, "LOCO"): {
        "Gradient": s16(16, 0.01, "permille", -327.68, 327.66),
        "Curvature": s16(32, 0.001, "1/km", -32.768, 32.766),
    },
    (0x201, "AdhesionSetpoint", 20, "ADHESION"): {"Status": STATUS_FIELD, **SETPOINT},
    (0x202, "AdhesionModel", 100, "ADHESION"): {
        "Objection": (12, 4, False, 1, 0, "-", 0, 15, 0),
        "C1": u16(16, 1e-4, "-", 6.5534),
        "C2": u16(32, 0.01, "-", 655.34),
        "C3": u16(48, 1e-4, "-", 6.5534),
    },
    (0x203, "AdhesionQuality", 100, "ADHESION"): {
        "Doubt": (12, 4, False, 1, 0, "-", 0, 15, 15),
        "MuMaxStd": u16(16, 1e-5, "-", 0.65534),
        "LambdaMStd": u16(32, 1e-5, "-", 0.65534),
        "SurfaceAge": u16(48, 0.1, "s", 6553.4),
    },
    (0x204, "AxleSetpoint", 20, "ADHESION"): {
        "Axle": (12, 4, False, 1, 0, "-", 1, 6, 1),
        **{f"{name}_Ax{i}": field for i in range(1, 7) for name, field in SETPOINT.items()},
    },
    (0x211, "ServiceStatus", 1000, "ADHESION"): {
        "State": STATUS_FIELD,
        "FramesRejected": u16(16, 1, "-", 65534),
        "FramesLost": u16(32, 1, "-", 65534),
        "LoopTimeP99": u16(48, 10, "us", 655340),
    },
    (0x301, "EffortDemand1", 10, "DRIVE"): {
        "SandDemand": (12, 1, False, 1, 0, "-", 0, 1, 0),
        **axles("EffortDemand", 1, effort),
    },
    (0x302, "EffortDemand2", 10, "DRIVE"): axles("EffortDemand", 4, effort),
}
FRAME_FIELDS = {
    "Crc": (0, 8, False, 1, 0, "-", 0, 255, 0),
    "Alive": (8, 4, False, 1, 0, "-", 0, 14, 0),
}
ENUMS = {
    "VehicleSpeedSource": SOURCE,
    "Direction": DIRECTION,
    "Rain": RAIN,
    "SandingActive": {0: "off", 1: "on"},
    "SandDemand": {0: "off", 1: "on"},
    "Status": STATUS,
    "State": STATUS,
    "Doubt": DOUBT,
    "Objection": OBJECTION,
}
ROWS = [(*head, signals) for head, signals in CONTRACT.items()]
IDS = [row[1] for row in ROWS]


@pytest.fixture(scope="module")
def strict_database():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return cantools.database.load_file(DBC, strict=True)


def test_the_database_has_the_messages_of_the_contract_and_no_others(strict_database):
    found = {(m.frame_id, m.name) for m in strict_database.messages}
    assert found == {(row[0], row[1]) for row in ROWS}


def test_bus_is_classic_can_at_500_kbit(strict_database):
    attributes = strict_database.dbc.attributes
    assert attributes["BusType"].value == "CAN"
    assert attributes["Baudrate"].value == 500_000
    assert {node.name for node in strict_database.nodes} == {"LOCO", "DRIVE", "ADHESION"}


@pytest.mark.parametrize("row", ROWS, ids=IDS)
def test_message_frame_cycle_and_attributes(strict_database, row):
    number, name, cycle, sender, _ = row
    message = strict_database.get_message_by_name(name)
    assert message.frame_id == number
    assert not message.is_extended_frame
    assert not message.is_fd
    assert message.length == 8
    assert message.cycle_time == cycle
    assert message.dbc.attributes["GenMsgCycleTime"].value == cycle
    assert message.dbc.attributes["E2EDataId"].value == number
    assert e2e_data_id(message) == number
    assert message.senders == [sender]
    assert message.comment
    assert "ptional" in message.comment or number not in (0x131, 0x132, 0x141, 0x151)
    # Every receiver exists, and nobody receives itself.
    assert message.receivers
    assert message.receivers <= {"LOCO", "DRIVE", "ADHESION"} - {sender}
    assert ("ADHESION" in message.receivers) is (number < 0x200)
    assert ("DRIVE" in message.receivers) or number < 0x200 or sender == "DRIVE"


@pytest.mark.parametrize("row", ROWS, ids=IDS)
def test_signals_stand_where_the_contract_says(strict_database, row):
    _, name, _, _, signals = row
    message = strict_database.get_message_by_name(name)
    expected = FRAME_FIELDS | signals
    names = [s.name for s in message.signals]
    assert len(names) == len(set(names)), "names are unique within a message"
    assert set(names) == set(expected)
    for signal in message.signals:
        start, length, signed, factor, offset, unit, lowest, highest, initial = expected[
            signal.name
        ]
        assert (signal.start, signal.length) == (start, length), signal.name
        assert signal.byte_order == "little_endian"
        assert signal.is_signed is signed
        assert not signal.is_float
        assert signal.scale == pytest.approx(factor, rel=1e-12)
        assert signal.offset == offset
        assert (signal.unit or "-") == unit
        assert signal.minimum == pytest.approx(lowest, abs=abs(factor) * 1e-6)
        assert signal.maximum == pytest.approx(highest, abs=abs(factor) * 1e-6)
        assert signal.dbc.attributes["GenSigStartValue"].value == initial, signal.name
        assert signal.raw_initial in (None, initial)
        assert signal.comment


@pytest.mark.parametrize("name", IDS)
def test_value_tables_name_every_enum_and_what_is_not_available(strict_database, name):
    for signal in strict_database.get_message_by_name(name).signals:
        choices = {k: str(v) for k, v in (signal.choices or {}).items()}
        if signal.name in ENUMS:
            assert choices == ENUMS[signal.name]
        elif signal.name in ("Crc", "Alive", "Axle"):
            assert not choices
        else:
            ones = (1 << (signal.length - signal.is_signed)) - 1
            assert choices == {ones: "not available"}, signal.name


def test_axle_setpoint_is_multiplexed_by_axle(strict_database):
    message = strict_database.get_message_by_name("AxleSetpoint")
    by_name = {s.name: s for s in message.signals}
    assert by_name["Axle"].is_multiplexer
    for name in ("Crc", "Alive", "Axle"):
        assert by_name[name].multiplexer_ids is None
    for axle in range(1, 7):
        for prefix in ("MuMax", "LambdaM", "CreepSpeedSetpoint"):
            signal = by_name[f"{prefix}_Ax{axle}"]
            assert signal.multiplexer_ids == [axle]
            assert signal.multiplexer_signal == "Axle"
    multiplexed = [m.name for m in strict_database.messages if m.is_multiplexed()]
    assert multiplexed == ["AxleSetpoint"]


def test_the_raw_text_has_no_motorola_and_no_unnamed_signal():
    # Read as text, so that a mistake of the parser and of this file would have to agree.
    text = DBC.read_text(encoding="ascii")
    layouts = re.findall(r"^ SG_ (\w+) (?:m\d+ |M )?: (\d+)\|(\d+)@(\d)([+-])", text, re.MULTILINE)
    assert len(layouts) == sum(len(FRAME_FIELDS | signals) for *_, signals in ROWS)
    assert {order for *_, order, _ in layouts} == {"1"}
    signed = {name for name, *_, sign in layouts if sign == "-"}
    efforts = {f"{kind}_Ax{i}" for kind in ("TractiveEffort", "EffortDemand") for i in range(1, 7)}
    assert signed == efforts | {"Gradient", "Curvature"}


def test_all_ones_stands_outside_the_range_of_every_number(strict_database):
    for message in strict_database.messages:
        for signal in message.signals:
            if signal.length < 8 or signal.name == "Crc":
                continue
            ones = (1 << (signal.length - signal.is_signed)) - 1
            assert ones * signal.scale + signal.offset > signal.maximum + abs(signal.scale) / 2


def test_a_written_frame_reads_back_in_cantools(strict_database):
    # Golden bytes: 100 rad/s = raw 50000 = 0xC350, 1 rad/s = raw 500, third not available.
    payload = sealed(0x101, 7, bytes([0, 0, 0x50, 0xC3, 0xF4, 0x01, 0xFF, 0xFF]))
    values = strict_database.decode_message(0x101, payload, decode_choices=False)
    assert values["WheelSpeed_Ax1"] == pytest.approx(100.0)
    assert values["WheelSpeed_Ax2"] == pytest.approx(1.0)
    assert values["WheelSpeed_Ax3"] == pytest.approx(131.07), "the trap that the contract names"
    assert values["Alive"] == 7


def test_the_names_of_a_doubt_are_those_of_the_package(strict_database):
    message = strict_database.get_message_by_name("AdhesionQuality")
    numbers = set(message.get_signal_by_name("Doubt").choices)
    assert numbers == set(Doubt)
    assert numbers - {Doubt.NONE, Doubt.NOT_AVAILABLE} == set(DESCRIPTIONS)


def test_the_numbers_of_an_objection_are_those_of_the_package(strict_database):
    message = strict_database.get_message_by_name("AdhesionModel")
    assert set(message.get_signal_by_name("Objection").choices) == set(Objection)


def test_packaged_database_is_this_one_and_complete():
    assert packaged_path().read_bytes() == DBC.read_bytes()
    database = load_database()
    names = {m.name for m in database.db.messages}
    assert names == set(INPUT_MESSAGES) | set(OUTPUT_MESSAGES) | set(DEMAND_MESSAGES)
    assert set(OUTPUT_MESSAGES) == {row[1] for row in ROWS if row[3] == "ADHESION"}, (
        "what we send is what node ADHESION sends"
    )


TEXT = 'VERSION ""\nBU_: A\nBO_ 256 M: 8 A\n SG_ T : 0|16@1+ (0.1,0) [0|0] "{}" A\n'


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("unit", ["°C", "µm/m²", "K"])
def test_units_are_read_in_the_encoding_that_they_are_written_in(tmp_path, encoding, unit):
    path = tmp_path / "a.dbc"
    path.write_bytes(TEXT.format(unit).encode(encoding))
    assert load_database(path).message("M").signals[0].unit == unit


def test_xml_keeps_the_encoding_of_its_format(tmp_path):
    path = tmp_path / "a.kcd"
    path.write_text(
        '<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0"><Document/>'
        '<Bus name="B"><Message id="0x1" length="1" name="M"><Signal name="T" offset="0">'
        '<Value type="unsigned" slope="1" unit="°C"/>'
        "</Signal></Message></Bus></NetworkDefinition>",
        encoding="utf-8",
    )
    assert load_database(path).message("M").signals[0].unit == "°C"


# --- databases of strangers ----------------------------------------------------------------------

MESSAGE = """VERSION ""
BO_ 256 M: 8 A
 SG_ Mux M : 0|8@1+ (1,0) [0|0] "" B
 SG_ S m1 : 8|16@1- (0.5,-40) [0|0] "" B
"""


def stranger(tmp_path, text, suffix="dbc"):
    path = tmp_path / f"stranger.{suffix}"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "ranges", ["1-4000000000", "1-1000000, 1-1000000", "1 -4000000000", "1 24000000000"]
)
def test_ranges_that_would_fill_the_memory_are_refused(tmp_path, ranges):
    path = stranger(tmp_path, f"{MESSAGE}SG_MUL_VAL_ 256 S Mux {ranges};\n")
    for lenient in (False, True):
        with pytest.raises(DatabaseError, match=r"SG_MUL_VAL_.* write at most 1048576"):
            load_database(path, lenient=lenient)


@pytest.mark.parametrize(
    "statement",
    [
        "SG_MUL_VAL_ // 1-1;\n 256 S // ;\n Mux 1-4000000000;",
        "SG_MUL_VAL_ 256S Mux 1-4000000000;",
        "SG_MUL_VAL_ +256 S Mux 1-3, 1-4000000000;",
        'CM_ "SG_MUL_VAL_";SG_MUL_VAL_\n\n256\nS\nMux\n1\n-4000000000\n;',
        "SG_MUL_VAL_ 256 S Mux 1-" + "9" * 5000 + ";",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_wide_ranges_are_seen_however_they_are_written(tmp_path, statement, encoding):
    path = tmp_path / "a.dbc"
    path.write_text(f"{MESSAGE}{statement}\n", encoding=encoding)
    with pytest.raises(DatabaseError, match=r"SG_MUL_VAL_.* write at most 1048576"):
        load_database(path)


def test_the_keyword_alone_is_no_range(tmp_path):
    """In the list of keywords that most databases begin with, in strings and in comments."""
    text = MESSAGE.replace('VERSION ""', 'VERSION ""\nNS_ :\n\tVAL_\n\tSG_MUL_VAL_\nBS_:\nBU_: B\n')
    text += (
        "// SG_MUL_VAL_ 256 S Mux 1-4000000000;\n"
        'CM_ BO_ 256 "as SG_MUL_VAL_ 256 S Mux 1-4000000000; says";\n'
        "SG_MUL_VAL_ 256 S Mux 2-3;\n"
    )
    (message,) = load_database(stranger(tmp_path, text)).db.messages
    assert message.get_signal_by_name("S").multiplexer_ids == [1, 2, 3]


def test_ranges_of_usual_width_are_read(tmp_path):
    path = stranger(tmp_path, MESSAGE + "SG_MUL_VAL_ 256 S Mux 65535-65535, 1-3, 7-5;\n" * 20)
    (message,) = load_database(path).db.messages
    assert message.get_signal_by_name("S").multiplexer_ids == [1, 2, 3, 65535]


def test_identifiers_that_would_fill_the_memory_are_refused(tmp_path):
    text = 'FormatVersion=6.0 // x\nTitle="t"\n{SENDRECEIVE}\n[M]\nID=0h-1FFFFFFFh\nLen=8\n'
    with pytest.raises(DatabaseError, match="identifiers"):
        load_database(stranger(tmp_path, text, "sym"))


@pytest.mark.parametrize(
    ("text", "suffix", "what"),
    [
        ('FormatVersion=6.0 // x\nTitle="t"\n{SENDRECEIVE}\n[M]\nID=-100h\nLen=8\n', "sym", "id"),
        (MESSAGE.replace("M: 8", "M: -8"), "dbc", "length"),
    ],
)
def test_a_message_with_a_number_below_0_is_refused(tmp_path, text, suffix, what):
    with pytest.raises(DatabaseError, match=f"M: its {what} is -"):
        load_database(stranger(tmp_path, text, suffix))


def test_a_cycle_in_words_is_none(tmp_path):
    text = with_attribute("GenMsgCycleTime", "STRING", '"20 ms"').replace(" 0 0;", " ;")
    text = text.replace('"GenMsgCycleTime" 0;', '"GenMsgCycleTime" "";')
    (message,) = load_database(stranger(tmp_path, text)).db.messages
    assert message.cycle_time == "20 ms"
    assert cycle_us(message) is None


def test_a_device_is_no_database():
    with pytest.raises(DatabaseError, match="a pipe or a device"):
        load_database(Path("/dev/zero"))


def with_attribute(name, kind, value):
    return (
        f'{MESSAGE}BA_DEF_ BO_ "{name}" {kind} 0 0;\nBA_DEF_DEF_ "{name}" 0;\n'
        f'BA_ "{name}" BO_ 256 {value};\n'
    )


@pytest.mark.parametrize("value", ["1e400", "1.5", "-1", "65536"])
def test_a_data_id_that_is_none_is_refused(tmp_path, value):
    path = stranger(tmp_path, with_attribute("E2EDataId", "FLOAT", value))
    (message,) = load_database(path).db.messages
    with pytest.raises(DatabaseError, match="write 0 to 65535"):
        e2e_data_id(message)


@pytest.mark.parametrize(
    ("value", "cycle"),
    [("20", 20_000), ("0.5", 500), ("0", None), ("-5", None), ("1e400", None), ("1e-9", None)],
)
def test_a_cycle_that_is_no_time_is_none(tmp_path, value, cycle):
    path = stranger(tmp_path, with_attribute("GenMsgCycleTime", "FLOAT", value))
    (message,) = load_database(path).db.messages
    assert cycle_us(message) == cycle
