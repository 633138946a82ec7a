"""The simulated locomotive on the bus of another database: what it writes is read back as true."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adhesion_can import identify, simulate
from adhesion_can.bus.block import Block
from adhesion_can.bus.database import load_database
from adhesion_can.bus.protected_message import ProtectedMessage
from adhesion_can.bus.receiver import Receiver
from adhesion_can.bus.roles import SignalChoice
from adhesion_can.config import load_configuration
from adhesion_can.errors import InputError
from adhesion_can.physics.readings import Role
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name

DATA = Path(__file__).resolve().parents[1] / "data"
TRAM = """
[vehicle]
axles = 4
wheel_radius_m = 0.33
axle_load_N = 90e3
wheelset_inertia_kgm2 = 60.0
train_mass_kg = 40e3
[bus]
database = "{dbc}"
[roles]
vehicle_speed = "GW_Odometrie.v_Fzg"
direction = "GW_Odometrie.Fahrtrichtung"
"""
WHEEL = '"wheel_speed.{k}" = "TCU_Achsen.n_RS_{k}"\n'
EFFORT = '"tractive_effort.{k}" = {{ signal = "TCU_Zugkraft.Zugkraft_RS_{k}", {keys} }}\n'


def tram(folder, keys='protection = "none"', more="", dbc=DATA / "tram.dbc"):
    path = folder / "tram.toml"
    rows = [WHEEL.format(k=k) + EFFORT.format(k=k, keys=keys) for k in (1, 2, 3, 4)]
    path.write_text(TRAM.format(dbc=dbc) + "".join(rows) + more)
    return load_configuration(path)


@pytest.mark.parametrize("keys", ['protection = "none"', "sign = -1"])
def test_the_truth_is_identified_from_the_tram_s_own_messages(tmp_path, keys):
    config = tram(tmp_path, keys)
    drive = simulate("dry", 8.0, configuration=config)
    ids = {m.plan.frame_id for m in config.messages}
    assert {frame.arbitration_id for frame in drive.frames} == ids
    assert {f.arbitration_id for f in drive.frames if f.is_extended} == {2566844672 & 0x1FFFFFFF}
    found = identify(drive.write(tmp_path / "tram.log"), configuration=config)
    assert found.whole.mu_max == pytest.approx(drive.truth["surfaces"][0]["mu_max"], rel=0.05)


def test_units_signs_offsets_and_protection_are_undone_by_the_receiver(tmp_path):
    """Two configurations of one drive and seed give the same readings, to a raw step."""
    readings = []
    text = (DATA / "tram.dbc").read_text()
    (tmp_path / "room.dbc").write_text(text.replace("aktiv : 16|1", "aktiv : 17|1"))
    sand = 'sanding_active = {{ signal = "GW_Klima.Sandung_aktiv", {} }}'
    for keys in ('protection = "none"', "sign = -1, offset = 2000.0"):
        guard = "data_id = 9" if "sign" in keys else 'protection = "none"'
        more = sand.format(guard)
        config = tram(tmp_path, keys, more, tmp_path / "room.dbc")
        assert any(m.data_id == 9 for m in config.messages) is ("sign" in keys)
        frames = simulate("dry", 2.0, configuration=config).frames
        receiver = Receiver(config.messages)
        block = Block.from_frames(frames, ())
        readings.append(receiver.accept_block(block, block.t_us).readings)
        assert receiver.rejected == 0
        assert receiver.lost == 0
    one, other = readings
    for axle in (1, 2, 3, 4):
        a, b = (r[Role.TRACTIVE_EFFORT, axle] for r in (one, other))
        assert np.array_equal(a[0], b[0])
        assert np.max(np.abs(a[1] - b[1])) <= 10.0 + 1e-6
        assert np.max(np.abs(a[1])) > 5e3


def test_the_file_s_database_is_written_with_the_default_roles_too(tmp_path):
    text = (DATA.parents[1] / "dbc" / "adhesion.dbc").read_text()
    (tmp_path / "moved.dbc").write_text(text.replace("257", "1257"))
    (tmp_path / "moved.toml").write_text('[bus]\ndatabase = "moved.dbc"\n')
    drive = simulate("dry", 0.1, configuration=tmp_path / "moved.toml")
    assert 1257 in {frame.arbitration_id for frame in drive.frames}
    assert 257 not in {frame.arbitration_id for frame in drive.frames}


@pytest.mark.parametrize("identifier", [513, 513 | 1 << 31], ids=["standard", "extended"])
def test_setpoints_are_read_in_the_byte_order_and_with_the_id_of_the_database(tmp_path, identifier):
    text = (
        (DATA.parents[1] / "dbc" / "adhesion.dbc").read_text().replace(" 513 ", f" {identifier} ")
    )
    for name, little, big in (
        ("MuMax", 16, 23),
        ("LambdaM", 32, 39),
        ("CreepSpeedSetpoint", 48, 55),
    ):
        text = text.replace(f" SG_ {name} : {little}|16@1+", f" SG_ {name} : {big}|16@0+")
    (tmp_path / "motorola.dbc").write_text(text)
    database = load_database(tmp_path / "motorola.dbc")
    simulation = Simulation(RunSettings(scenario_by_name("dry"), 1.0, obey=True), database)
    values = {"Status": 1, "MuMax": 0.37, "LambdaM": 0.07, "CreepSpeedSetpoint": 0.5}
    frame = ProtectedMessage(database.message("AdhesionSetpoint")).frame(0, values)
    simulation.receive(frame._replace(is_extended=not frame.is_extended))
    assert not simulation.is_answered
    simulation.receive(frame)
    assert simulation._drive.command.known
    assert simulation._drive.command.creep_speed == pytest.approx(0.5)


def test_what_cannot_be_written_is_refused(tmp_path):
    text = (DATA / "tram.dbc").read_text()
    (tmp_path / "narrow.dbc").write_text(text.replace("[0|320]", "[0|5]"))
    with pytest.raises(InputError, match=r"vehicle_speed: v_Fzg has no room .*0 to 5"):
        simulate("dry", 1.0, configuration=tram(tmp_path, dbc=tmp_path / "narrow.dbc"))
    (tmp_path / "silent.dbc").write_text(
        text.replace('"GenMsgCycleTime" BO_ 832 10', '"GenMsgCycleTime" BO_ 832 0')
    )
    with pytest.raises(InputError, match="the cycle of TCU_Achsen is unknown"):
        simulate("dry", 1.0, configuration=tram(tmp_path, dbc=tmp_path / "silent.dbc"))
    packaged = load_configuration()
    on_muxed = SignalChoice(Role.HUMIDITY, 0, "AxleSetpoint", "MuMax_Ax1", unit="%")
    config = replace(packaged, choices=(*packaged.choices, on_muxed))
    with pytest.raises(InputError, match="is multiplexed"):
        simulate("dry", 1.0, configuration=config)
