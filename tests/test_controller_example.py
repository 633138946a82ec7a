"""The decisions of docs/examples/controller.py, without a bus."""

import importlib.util
from pathlib import Path

import pytest

import adhesion_can
from adhesion_can.bus.database import load_database
from adhesion_can.bus.protected_message import ProtectedMessage
from adhesion_can.physics.status import Status
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name

PATH = Path(__file__).resolve().parent.parent / "docs" / "examples" / "controller.py"
SERVICE_IDS = {0x201, 0x202, 0x203, 0x204, 0x211}


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location("controller_example", PATH)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def drive(controller, seconds, *, scenario="dry", watch=lambda t_s, controller: None, lost=None):
    """Simulated locomotive, service and controller; True of `lost(t_s)`: the service is silent."""
    config = adhesion_can.load_configuration()
    settings = RunSettings(scenario_by_name(scenario), seconds, obey=True)
    locomotive, service = Simulation(settings, config.database), adhesion_can.ServiceCore(config)
    locomotive.await_demands()
    used = []
    for frames in locomotive.run():
        for frame in frames:
            t_s = frame.t_us / 1e6
            answers = [] if lost and lost(t_s) else service.feed(frame)
            for each in [*answers, frame]:
                for demand in controller.feed(each.t_us, each.arbitration_id, each.data):
                    locomotive.receive(adhesion_can.Frame(each.t_us, *demand))
                    watch(t_s, controller)
        used.append((locomotive.now_us / 1e6, locomotive.adhesion_used()))
    return used
