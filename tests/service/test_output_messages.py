"""What the output messages say of themselves."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.bus.database import OUTPUT_MESSAGES, load_database
from adhesion_can.bus.protected_message import ProtectedMessage
from adhesion_can.errors import DatabaseError
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.status import Status
from adhesion_can.service.output_messages import SETPOINT, Health, OutputMessages
from adhesion_can.service.outputs import Outputs, Setpoint
from tests.bus.bus_helpers import DBC, e2e_checksum
from tests.wire import decoded

CONTRACT = {
    "AdhesionSetpoint": (0x201, 20),
    "AdhesionModel": (0x202, 100),
    "AdhesionQuality": (0x203, 100),
    "AxleSetpoint": (0x204, 20),
    "ServiceStatus": (0x211, 1000),
}
"""Id and cycle in ms."""


@pytest.fixture
def messages():
    return OutputMessages(load_database(), ())


def test_ids_and_cycles_are_those_of_the_contract(messages):
    assert set(OUTPUT_MESSAGES) == set(CONTRACT)
    assert messages.ids == {(number, False) for number, _ in CONTRACT.values()}
    assert messages.ids_by_name == {name: number for name, (number, _) in CONTRACT.items()}
    assert messages.cycles_us == {name: ms * 1000 for name, (_, ms) in CONTRACT.items()}
    assert messages.cycles_by_id_us == {number: ms * 1000 for number, ms in CONTRACT.values()}


def test_each_has_eight_bytes(messages):
    assert messages.sizes == dict.fromkeys(CONTRACT, 8)


def test_they_are_in_ascending_order_of_their_ids(messages):
    assert next(iter(messages.cycles_us)) == SETPOINT
    assert list(messages.cycles_us) == sorted(CONTRACT, key=lambda name: CONTRACT[name][0])


def test_each_id_has_its_name(messages):
    for name, (number, _) in CONTRACT.items():
        assert messages.find_name(number) == name


HEALTH = Health(rejected=7, lost=3, loop_time_p99_us=1250.0)
AXLES = {axle: Setpoint(0.1 * axle, 0.01 * axle, 0.5 * axle) for axle in (1, 2, 6)}
FULL = Outputs(
    Status.SURFACE_CHANGE,
    Setpoint(0.373, 0.073, 0.42),
    AXLES,
    (0.4, 60.0, 0.3),
    mu_max_std=0.001,
    lambda_m_std=0.002,
    surface_age_s=12.5,
    doubt=Doubt.AXLE_LOAD,
)


def signals(messages, name, outputs=FULL, health=HEALTH):
    """Signals of each frame of a message, without counter and checksum; None: not available."""
    found = []
    for frame in messages.compose(name, 0, outputs, lambda: health):
        values = decoded(frame)
        own = {key: values[key] for key in values if key not in ("Checksum", "Counter", "CRC")}
        found.append({k: None if str(v) == "not available" else v for k, v in own.items()})
    return found


def subset(found, wanted):
    return {key: found[key] for key in wanted}


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("AdhesionSetpoint", {"MuMax": 0.373, "LambdaM": 0.073, "CreepSpeedSetpoint": 0.42}),
        ("AdhesionModel", {"C1": 0.4, "C2": 60.0, "C3": 0.3}),
        ("AdhesionQuality", {"MuMaxStd": 0.001, "LambdaMStd": 0.002, "SurfaceAge": 12.5}),
        ("ServiceStatus", {"FramesRejected": 7, "FramesLost": 3, "LoopTimeP99": 1250.0}),
    ],
)
def test_each_signal_carries_its_own_number(messages, name, wanted):
    (found,) = signals(messages, name)
    assert subset(found, wanted) == pytest.approx(wanted, rel=0.01)
    (empty,) = signals(messages, name, Outputs(), Health(0, 0, None))
    counts = {"FramesRejected": 0, "FramesLost": 0}
    assert subset(empty, wanted) == {key: counts.get(key) for key in wanted}


def test_status_and_doubt_go_out_by_their_names(messages):
    assert str(signals(messages, "AdhesionSetpoint")[0]["Status"]) == "SURFACE_CHANGE"
    assert str(signals(messages, "ServiceStatus")[0]["State"]) == "SURFACE_CHANGE"
    assert str(signals(messages, "AdhesionQuality")[0]["Doubt"]) == "axle load"


def test_six_axles_in_turn_and_those_without_a_setpoint_are_not_available(messages):
    frames = signals(messages, "AxleSetpoint")
    assert [frame["Axle"] for frame in frames] == [1, 2, 3, 4, 5, 6]
    for axle, frame in enumerate(frames, 1):
        found = [frame[f"{key}_Ax{axle}"] for key in ("MuMax", "LambdaM", "CreepSpeedSetpoint")]
        point = AXLES.get(axle, Setpoint())
        expected = [point.mu_max, point.lambda_m, point.creep_speed]
        assert found == (expected if axle not in AXLES else pytest.approx(expected, rel=0.01))


def test_each_message_counts_by_itself_from_0_to_14_and_again(messages):
    for name in ("AdhesionModel", "ServiceStatus"):
        frames = [messages.compose(name, t, FULL, lambda: HEALTH)[0] for t in range(32)]
        assert [frame.data[1] & 15 for frame in frames] == [t % 15 for t in range(32)]
    (frame,) = messages.compose("AdhesionModel", 4711, FULL, lambda: HEALTH)
    assert (frame.t_us, frame.arbitration_id, frame.is_extended) == (4711, 0x202, False)


DATABASE = load_database()
OTHERS = (FULL, replace(FULL), Outputs(Status.STALE_INPUT), Outputs())
STEPS = st.lists(st.tuples(st.booleans(), st.sampled_from(OTHERS), st.integers(0, 2)), max_size=40)


@given(STEPS)
def test_what_is_composed_ahead_changes_no_frame(steps):
    """Prepared in vain, twice, for another due time, for other outputs: the same frames."""
    ahead, plain = (OutputMessages(DATABASE, ()) for _ in range(2))
    for is_prepared, outputs, late in steps:
        if is_prepared:
            ahead.prepare(1000, outputs)
        else:
            found, wanted = (
                one.compose(SETPOINT, 1000 + late // 2, outputs, lambda: HEALTH)
                for one in (ahead, plain)
            )
            assert found == wanted


def test_what_is_composed_ahead_is_sent_once(messages):
    messages.prepare(1000, FULL)
    messages.prepare(2000, FULL)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ProtectedMessage, "draft", None)
        (first,) = messages.compose(SETPOINT, 2000, FULL, lambda: HEALTH)
        with pytest.raises(TypeError):
            messages.compose(SETPOINT, 2000, FULL, lambda: HEALTH)
    (second,) = messages.compose(SETPOINT, 2000, FULL, lambda: HEALTH)
    assert [frame.data[1] & 15 for frame in (first, second)] == [0, 1]


@pytest.mark.parametrize(("t_us", "outputs"), [(1000, replace(FULL)), (500, FULL), (2000, FULL)])
def test_for_another_due_time_or_other_outputs_it_is_composed_anew(messages, t_us, outputs):
    messages.prepare(1000, FULL)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ProtectedMessage, "draft", None)
        with pytest.raises(TypeError):
            messages.compose(SETPOINT, t_us, outputs, lambda: HEALTH)


# --- databases of the user's own


def with_changes(tmp_path, *changes):
    text = DBC.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "mine.dbc").write_text(text)
    return OutputMessages(load_database(tmp_path / "mine.dbc"), ())


def test_ids_of_a_user_set_the_order_and_are_found_by_their_names(tmp_path):
    """The setpoint behind all others, and with 29 bits."""
    number = 0x18FF0601
    mine = with_changes(tmp_path, (" 513 ", f" {number | 1 << 31} "))
    assert list(mine.cycles_us) == [*list(CONTRACT)[1:], SETPOINT]
    assert (number, True) in mine.ids
    assert (0x201, False) not in mine.ids
    for name, found in mine.ids_by_name.items():
        assert mine.find_name(found) == name
    (frame,) = mine.compose(SETPOINT, 0, FULL, lambda: HEALTH)
    assert (frame.arbitration_id, frame.is_extended) == (number, True)


@pytest.mark.parametrize("data_id", [0, 0x1234])
def test_a_data_id_that_the_database_states_protects_the_frame(tmp_path, data_id):
    mine = with_changes(
        tmp_path, ('BA_ "E2EDataId" BO_ 513 513;', f'BA_ "E2EDataId" BO_ 513 {data_id};')
    )
    (frame,) = mine.compose(SETPOINT, 0, FULL, lambda: HEALTH)
    assert frame.data[0] == e2e_checksum(data_id, frame.data)


def test_a_doubt_beside_a_signal_that_is_missing_is_no_excuse_for_it(tmp_path):
    with pytest.raises(DatabaseError, match="AdhesionQuality: no signal SurfaceAge"):
        with_changes(tmp_path, (" SurfaceAge ", " Age "))
    with pytest.raises(DatabaseError, match="ServiceStatus: no signal FramesLost, State"):
        with_changes(tmp_path, (" FramesLost ", " Lost "), (" State ", " Mode "))


def test_outputs_are_those_of_the_package_where_the_user_defines_not_all_of_them(tmp_path):
    mine = with_changes(tmp_path, (" 513 ", " 1537 "), ("AxleSetpoint:", "Axles:"))
    assert mine.ids_by_name[SETPOINT] == 0x201
