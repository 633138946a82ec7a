"""The controller over frames: three parties in one process, and what may go wrong on the way."""

import numpy as np
import pytest

from adhesion_can.bus.database import load_database
from adhesion_can.bus.protected_message import ProtectedMessage
from adhesion_can.config import load_configuration
from adhesion_can.control.creep_controller import Mode
from adhesion_can.control.frames import ControllerOnBus, build_reference
from adhesion_can.control.inputs import Advice
from adhesion_can.errors import ConfigError
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.status import Status
from adhesion_can.service.core import ServiceCore
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name
from tests.wire import decoded

DRY_PEAK = 0.3731
DATABASE = load_database()


def pull(seconds, *, scenario="dry", service=True, lose=lambda *_: False):
    """Locomotive, service and controller; demands, shares of the adhesion, and the controller."""
    config = load_configuration()
    simulation = Simulation(
        RunSettings(scenario_by_name(scenario), seconds, obey=True), config.database
    )
    core, controller = ServiceCore(config), ControllerOnBus(config)
    demands, used = [], []
    for frames in simulation.run():
        for frame in frames:
            if lose(frame, simulation.now_us / 1e6):
                continue
            for own in [*(core.feed(frame) if service else ()), frame]:
                for demand in controller.feed(own):
                    demands.append(demand)
                    simulation.receive(demand)
        used.append(simulation.adhesion_used())
    return demands, np.array(used), controller


def efforts(demands):
    """Demands of the axles by message, N; NaN where not available."""
    rows = [decoded(frame) for frame in demands]
    assert all(row["Crc"] is not None for row in rows)
    return [
        [float(x) if isinstance(x, int | float) else np.nan
         for name, x in row.items() if name.startswith("Effort")]
        for row in rows
    ]  # fmt: skip


def test_without_a_vehicle_speed_it_waits_and_demands_nothing():
    """Before the first vehicle speed, and again after the last; a slow train is no such thing."""
    silent = {0x111}
    demands, _, controller = pull(1.0, lose=lambda frame, _: frame.arbitration_id in silent)
    assert demands
    assert not np.nan_to_num(efforts(demands)).any()
    assert controller.controller.mode is Mode.WAITING
    demands, _, controller = pull(
        3.0, lose=lambda frame, time_s: frame.arbitration_id in silent and time_s > 1.0
    )
    assert np.nan_to_num(efforts(demands)).any()
    assert controller.controller.mode is Mode.WAITING


@pytest.mark.costly
def test_three_parties_use_what_the_rail_gives():
    """97 % of the peak from the third second on, by the service's curve."""
    demands, used, controller = pull(8.0)
    assert used[1500:].mean() > 0.97 * DRY_PEAK
    assert controller.controller.mode is Mode.HOLD
    assert controller.advice.status is Status.TRACKING
    assert {frame.arbitration_id for frame in demands} == {0x301, 0x302}
    steps = np.diff([frame.t_us for frame in demands if frame.arbitration_id == 0x301])
    assert set(steps.tolist()) == {10_000}


def test_it_pulls_without_a_service_too():
    _, used, controller = pull(6.0, service=False)
    assert used[1500:].mean() > 0.97 * DRY_PEAK
    assert controller.advice == Advice()
    assert controller.controller.mode is Mode.SEARCH


def test_the_same_frames_give_the_same_bytes():
    assert pull(2.0)[0] == pull(2.0)[0]


@pytest.mark.costly
def test_a_service_that_goes_silent_is_not_believed_any_longer():
    """Three cycles without a setpoint: as if the service had never said anything."""
    outputs = {0x201, 0x202, 0x203, 0x204}
    config = load_configuration()
    simulation = Simulation(RunSettings(scenario_by_name("dry"), 8.0, obey=True), config.database)
    core, controller = ServiceCore(config), ControllerOnBus(config)
    for frames in simulation.run():
        for frame in frames:
            answers = core.feed(frame)
            if simulation.now_us > 6_000_000:
                answers = [a for a in answers if a.arbitration_id not in outputs]
            for own in [*answers, frame]:
                for demand in controller.feed(own):
                    simulation.receive(demand)
        if simulation.now_us == 5_990_000:
            assert controller.controller.mode is Mode.HOLD
    assert controller.advice == Advice()
    assert controller.controller.mode is Mode.SEARCH
    assert simulation.adhesion_used() > 0.95 * DRY_PEAK


def test_without_wheel_speeds_the_motors_let_go_and_the_demands_keep_coming():
    wheels = {0x101, 0x102}
    demands, used, _ = pull(
        4.0, lose=lambda frame, t_s: t_s > 3.0 and frame.arbitration_id in wheels
    )
    assert used[1400] > 0.9 * DRY_PEAK
    late = [frame for frame in demands if frame.t_us > 3_400_000]
    assert np.abs(efforts(late)).max() == 0.0
    steps = np.diff([frame.t_us for frame in late if frame.arbitration_id == 0x301])
    assert set(steps.tolist()) == {15_000}
    assert used[-1] < 0.01


@pytest.mark.costly
def test_one_lost_frame_of_the_wheel_speeds_is_hardly_noticed():
    lost = iter(range(10_000))
    _, used, _ = pull(
        5.0, lose=lambda frame, _: frame.arbitration_id == 0x102 and next(lost) % 20 == 19
    )
    assert used[1500:].mean() > 0.95 * DRY_PEAK


def test_the_last_frames_demand_nothing():
    controller = ControllerOnBus(load_configuration())
    assert np.isnan(efforts(controller.stop(5))).all()


def setpoint_frames(status, doubt, c1=0.4, objection=0):
    values = {
        "AdhesionSetpoint": {"Status": status, "LambdaM": 0.07, "MuMax": 0.37,
                             "CreepSpeedSetpoint": 0.5},
        "AdhesionModel": {"Objection": objection, "C1": c1, "C2": 60.0, "C3": 0.3},
        "AdhesionQuality": {"Doubt": doubt, "MuMaxStd": 0.001, "LambdaMStd": 0.002,
                            "SurfaceAge": 3.0},
        "AxleSetpoint": {"Axle": 2, "MuMax_Ax2": 0.36, "LambdaM_Ax2": 0.068,
                         "CreepSpeedSetpoint_Ax2": 0.5},
    }  # fmt: skip
    return [
        ProtectedMessage(DATABASE.message(name)).frame(1000, row) for name, row in values.items()
    ]


def test_the_messages_of_the_service_become_advice():
    controller = ControllerOnBus(load_configuration())
    for frame in setpoint_frames(2, 3, objection=5):
        assert controller.feed(frame) == []
    advice = controller.advice
    assert (advice.status, advice.doubt) == (Status.LOW_EXCITATION, Doubt.AXLE_LOAD)
    assert advice.objection is Objection.SPEED_DEVIATES
    assert advice.lambda_m == pytest.approx(0.07)
    assert advice.lambda_m_std == pytest.approx(0.002)
    assert advice.theta == pytest.approx((0.4, 60.0, 0.3))
    assert advice.axles == {2: pytest.approx(0.068)}


@pytest.mark.parametrize(
    ("objection", "wanted"), [(0, False), (5, False), (9, True), (10, True), (11, True), (12, True)]
)
def test_an_objection_that_a_relief_ends_asks_for_one(objection, wanted):
    controller = ControllerOnBus(load_configuration())
    for frame in setpoint_frames(2, 0, objection=objection):
        controller.feed(frame)
    assert controller.advice.relief_wanted is wanted


def test_a_doubt_that_only_a_newer_service_knows_is_one_all_the_same():
    controller = ControllerOnBus(load_configuration())
    for frame in setpoint_frames(1, 12):
        controller.feed(frame)
    assert controller.advice.doubt not in (Doubt.NONE, Doubt.NOT_AVAILABLE)
    assert controller.advice.trusted_curve(0.2) is None


def test_what_is_not_available_is_none_and_what_is_damaged_changes_nothing():
    controller = ControllerOnBus(load_configuration())
    for frame in setpoint_frames(1, 0, c1=None):
        controller.feed(frame)
    assert controller.advice.theta is None
    for frame in setpoint_frames(5, 0):
        controller.feed(frame._replace(data=bytes([frame.data[0] ^ 1, *frame.data[1:]])))
    assert controller.advice.status is Status.TRACKING


def configured(tmp_path, roles):
    path = tmp_path / "c.toml"
    path.write_text(f"[vehicle]\naxles = 2\n[roles]\n{roles}")
    return load_configuration(path)


TWO = (
    'wheel_speed.1 = "WheelSpeeds1.WheelSpeed_Ax1"\nwheel_speed.2 = "WheelSpeeds1.WheelSpeed_Ax2"\n'
)


def test_what_the_controller_needs_is_named_where_it_lacks(tmp_path):
    with pytest.raises(ConfigError, match=r"no signal has the role vehicle_speed"):
        ControllerOnBus(configured(tmp_path, TWO))
    one = TWO.splitlines()[0] + '\nvehicle_speed = "VehicleSpeed.VehicleSpeed"\n'
    with pytest.raises(ConfigError, match=r"no signal has the role wheel_speed\.2"):
        ControllerOnBus(configured(tmp_path, one))


def test_a_slower_bus_gets_a_smaller_bandwidth(tmp_path):
    roles = TWO.replace('"WheelSpeeds1.', '{ signal = "WheelSpeeds1.').replace(
        'Ax1"', 'Ax1", cycle_ms = 50 }'
    ).replace('Ax2"', 'Ax2", cycle_ms = 50 }')  # fmt: skip
    config = configured(tmp_path, roles + 'vehicle_speed = "VehicleSpeed.VehicleSpeed"\n')
    loop = build_reference(config)._settings.loop
    assert loop.cycle_s == 0.05
    assert loop.bandwidth == pytest.approx(0.58 / 0.05)
