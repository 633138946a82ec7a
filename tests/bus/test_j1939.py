"""J1939: one parameter group from whatever sender and with whatever priority."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.bus.block import EXTENDED, Block
from adhesion_can.bus.database import load_database
from adhesion_can.bus.decoder import Decoder
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.j1939 import Senders, group_mask, parameter_group, source_address
from adhesion_can.bus.receiver import Receiver
from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.offline.check import check
from adhesion_can.physics.readings import Role
from adhesion_can.recordings.candump import format_frame

DBC = """
BO_ 2565866750 EBC2: 8 X
 SG_ FrontAxleSpeed : 0|16@1+ (0.00390625,0) [0|250.996] "km/h" X

BO_ 2364540158 EEC1: 8 X
 SG_ EngineSpeed : 24|16@1+ (0.125,0) [0|8031.875] "rpm" X
 SG_ EngineTorque : 16|8@1+ (1,-125) [-125|125] "%" X
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "VFrameFormat" BO_ 2565866750 3;
BA_ "VFrameFormat" BO_ 2364540158 3;
"""
EEC1 = 0x0CF004FE
TSC1 = 0x0C000003


@pytest.fixture
def dbc(tmp_path):
    path = tmp_path / "truck.dbc"
    path.write_text(DBC.replace("2565866750", str(0x18FEBFFE | 1 << 31)))
    path.write_text(path.read_text().replace("2364540158", str(EEC1 | 1 << 31)))
    return path


def remove_marks(dbc):
    """Make of a database of J1939 one that does not say so."""
    lines = dbc.read_text().splitlines()
    dbc.write_text("\n".join(line for line in lines if "VFrameFormat" not in line))


def configured(dbc):
    """Configuration with a vehicle speed and a wheel speed of the database."""
    path = dbc.with_name("c.toml")
    path.write_text(
        f'[bus]\ndatabase = "{dbc.name}"\n[roles]\nvehicle_speed = "EBC2.FrontAxleSpeed"\n'
        'wheel_speed.1 = { signal = "EEC1.EngineSpeed", unit = "rpm" }\n'
    )
    return load_configuration(path)


def test_groups_of_the_standard():
    """SAE J1939-71: EEC1 61444, EBC2 65215; J1939-21: a request goes to a destination."""
    assert parameter_group(0x0CF00400) == 61444
    assert parameter_group(0x18FEBF0B) == 65215
    assert parameter_group(0x18EA0021) == parameter_group(0x18EAFF03) == 0xEA00
    assert source_address(0x18FEBF0B) == 0x0B
    assert group_mask(0x18FEBF0B) == 0x3FFFF00
    assert group_mask(0x18EAFF03) == 0x3FF0000


def test_the_named_sender_is_preferred_and_until_then_the_first():
    senders = Senders([0x0CF00400])
    assert senders.translate(0x0CF0040F) == 0x0CF00400
    assert senders.translate(0x18F0040F) == 0x0CF00400  # the same sender with another priority
    assert senders.translate(0x0CF00427) == 0x0CF00427
    assert senders.translate(0x0CF00400) == 0x0CF00400
    assert senders.translate(0x0CF0040F) == 0x0CF0040F
    assert senders.heard == {0x0CF00400: 0x00}
    assert senders.others == {0x0CF00400: {0x0F, 0x27}}


def test_two_messages_of_one_group_are_matched_to_the_bit():
    senders = Senders([0x0CF00400, 0x0CF0040F])
    assert not senders
    assert senders.translate(0x0CF00427) == 0x0CF00427


IDS = [
    0x0CF00400,
    0x18F00400,
    0x0CF0040F,
    0x18F0040F,
    0x0CF00427,
    0x18FEBF0B,
    0x18FEBFFE,
    0x123,
    0x18EA0021,
]


@given(
    rows=st.lists(st.tuples(st.sampled_from(IDS), st.booleans()), max_size=30),
    cut=st.integers(0, 30),
)
@settings(deadline=None)
def test_a_block_gives_what_its_frames_give_one_by_one(rows, cut):
    one, many = Senders([0x0CF00400, 0x18FEBFFE]), Senders([0x0CF00400, 0x18FEBFFE])
    expected = [one.translate(number) if is_data else number for number, is_data in rows]
    found = []
    for part in (rows[:cut], rows[cut:]):
        keys = np.array([number | EXTENDED for number, _ in part], dtype=np.uint32)
        is_data = np.array([data for _, data in part], dtype=np.bool_)
        found += (many.translate_keys(keys, is_data) & ~np.uint32(EXTENDED)).tolist()
    assert found == expected
    assert many.heard == one.heard
    assert many.others == one.others


def frames_of(*senders):
    """EEC1 at 1500 rpm, twice from each sender, 10 ms apart."""
    payload = (0xFFFFFF | (12000 << 24) | (0xFFFFFF << 40)).to_bytes(8, "little")
    order = list(itertools.chain(*([number] * 2 for number in senders)))
    return [Frame(10_000 * k, number, payload, is_extended=True) for k, number in enumerate(order)]


def test_the_receiver_takes_any_sender_and_check_says_which(dbc):
    configuration = configured(dbc)
    single, block = Receiver(configuration.messages), Receiver(configuration.messages)
    frames = frames_of(0x0CF00400, 0x0CF00427)
    readings = [single.accept(frame) for frame in frames]
    assert [bool(one) for one in readings] == [True, True, False, False]
    found = block.accept_block(Block.from_frames(frames), np.array([f.t_us for f in frames]))
    ((_, values),) = found.readings.values()
    assert values == pytest.approx([1500 * 2 * np.pi / 60] * 2)
    assert found.foreign == 2
    assert {(f.number, f.mask) for f in block.ids} == {
        (0x18FEBFFE, 0x3FFFF00),
        (EEC1, 0x3FFFF00),
    }


@pytest.mark.parametrize("marked", [True, False])
def test_check_says_that_a_database_is_not_marked_as_one_of_j1939(dbc, marked):
    if not marked:
        remove_marks(dbc)
    configuration = configured(dbc)
    found = check([Block.from_frames(frames_of(0x0CF00400))], configuration)
    hints = [text for text in found.warnings if "VFrameFormat" in text]
    if marked:
        assert not hints
    else:
        (hint,) = hints
        assert hint.startswith("EEC1 (0xcf004fe): 0xcf00400 carries its parameter group 61444")


def test_frames_and_blocks_find_the_same_sender_of_a_group(dbc):
    remove_marks(dbc)
    messages = configured(dbc).messages
    single, block = Receiver(messages), Receiver(messages)
    frames = frames_of(0x0CF00427, 0x0CF00400, 0x18EA0021, EEC1)
    for frame in frames:
        single.accept(frame)
    block.accept_block(Block.from_frames(frames), np.array([f.t_us for f in frames]))
    assert single.same_group == block.same_group == {EEC1: 0x0CF00400}


@pytest.fixture
def group_0(dbc):
    """EEC1 replaced by TSC1, whose group is 0: the bits of a standard identifier name no other."""
    text = dbc.read_text().replace(str(EEC1 | 1 << 31), str(TSC1 | 1 << 31))
    dbc.write_text(text)
    return dbc


def test_a_standard_frame_is_no_sender_of_a_group(group_0):
    single, block = Receiver(configured(group_0).messages), Receiver(configured(group_0).messages)
    frames = [Frame(0, 0x27, bytes(8)), *frames_of(0x0C000011)]
    assert [single.accept(frame) is None for frame in frames] == [True, False, False]
    found = block.accept_block(Block.from_frames(frames), np.array([f.t_us for f in frames]))
    assert len(found.readings[Role.WHEEL_SPEED, 1][0]) == 2
    assert single.senders.heard == block.senders.heard == {TSC1: 0x11}


@pytest.mark.parametrize(
    ("heard", "noted"),
    [(0x27, {}), (0, {TSC1: 0}), (0x11, {TSC1: 0x11}), (0x1C000003, {TSC1: 0x1C000003})],
)
def test_only_identifiers_of_29_bits_have_a_group(group_0, heard, noted):
    remove_marks(group_0)
    single, block = Receiver(configured(group_0).messages), Receiver(configured(group_0).messages)
    frames = [Frame(0, heard, bytes(8), is_extended=bool(noted))]
    assert single.accept(frames[0]) is None
    block.accept_block(Block.from_frames(frames), np.array([0]))
    assert single.same_group == block.same_group == noted


def test_a_message_that_is_sent_itself_is_missed_under_no_other_identifier(group_0):
    remove_marks(group_0)
    single, block = Receiver(configured(group_0).messages), Receiver(configured(group_0).messages)
    frames = frames_of(TSC1)
    assert all(single.accept(frame) for frame in frames)
    block.accept_block(Block.from_frames(frames), np.array([f.t_us for f in frames]))
    assert single.same_group == block.same_group == {}


@pytest.mark.parametrize("marked", [True, False])
def test_a_group_is_looked_for_only_where_the_database_keeps_silent_about_it(group_0, marked):
    if not marked:
        remove_marks(group_0)
    plain, groups = Receiver(load_configuration().messages), Receiver(configured(group_0).messages)
    for subject in (plain, groups):
        subject.accept(Frame(0, 0x11, bytes(8), is_extended=True))
        subject.accept(Frame(1, 0x12, bytes(8), is_extended=True))
    assert plain.same_group == {}
    assert groups.same_group == ({} if marked else {TSC1: 0x11})
    wanted = {0x3FF0000, 0x3FFFF00} if marked else {0x1FFFFFFF}
    assert {one.mask for one in groups.ids} == wanted


@pytest.mark.parametrize("command", ["check", "diagnose", "identify", "replay"])
def test_where_nothing_else_is_heard_the_commands_say_it_too(dbc, tmp_path, capsys, command):
    remove_marks(dbc)
    config = tmp_path / "c.toml"
    config.write_text(
        f'[bus]\ndatabase = "{dbc.name}"\n[roles]\n'
        'vehicle_speed = { signal = "EBC2.FrontAxleSpeed", cycle_ms = 100 }\n'
        'wheel_speed.1 = { signal = "EEC1.EngineSpeed", unit = "rpm", cycle_ms = 20 }\n'
        'tractive_effort.1 = { signal = "EEC1.EngineTorque", unit = "N", cycle_ms = 20 }\n'
    )
    log = tmp_path / "a.log"
    log.write_text("".join(map(format_frame, frames_of(0x0CF00400))))
    assert main([command, str(log), "--config", str(config)]) == 2
    said = capsys.readouterr().err
    assert "no frame of a known id; EEC1 (0xcf004fe): 0xcf00400 carries its parameter group" in said
    assert "VFrameFormat J1939PG" in said


def test_convert_says_it_where_the_database_alone_lacks_the_mark(dbc, tmp_path, capsys):
    remove_marks(dbc)
    log = tmp_path / "a.log"
    log.write_text("".join(map(format_frame, frames_of(0x0CF00400))))
    words = ["convert", str(log), "--dbc", str(dbc), "--out", str(tmp_path / "a.csv")]
    assert main(words) == 2
    said = capsys.readouterr().err
    assert "EEC1 (0xcf004fe): 0xcf00400 carries its parameter group 61444" in said
    log.write_text("(0.000000) can0 064#1027000000000000\n")
    assert main(words) == 2
    assert "name the database of this bus with --dbc" in capsys.readouterr().err


def test_convert_names_each_sender(dbc):
    decoder = Decoder(load_database(dbc))
    decoded = decoder.decode(Block.from_frames(frames_of(0x0CF00400, 0x0CF00427)))
    names = {columns.message.name: len(columns) for columns in decoded}
    assert names == {"EEC1": 2, "EEC1@CF00427": 2}
    assert decoder.report.unknown == {}
    assert decoder.name_of(0x18EEFF03, is_extended=True) == "J1939 address claimed"
    assert decoder.name_of(0x1CEBFF00, is_extended=True) == "J1939 transport protocol, data"
    assert decoder.name_of(0x18FEF100, is_extended=True) == ""
    assert decoder.name_of(0x123, is_extended=False) == ""
    wanted = Decoder(load_database(dbc), lambda message, _: message == "EBC2")
    assert wanted.decode(Block.from_frames(frames_of(0x0CF00400))) == []
