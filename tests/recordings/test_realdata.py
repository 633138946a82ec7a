"""The bus on measured data: a car's drive and a tyre rig, where the files are at hand."""

import csv
from collections import Counter

import numpy as np
import pytest

from adhesion_can.bus.frame import Frame
from adhesion_can.bus.receiver import Receiver
from adhesion_can.config import load_configuration
from adhesion_can.physics.readings import Role
from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.tables.sample_table import is_table, read_table
from tests.bus.bus_helpers import DATA, real_data

FOLDER = real_data()
pytestmark = pytest.mark.skipif(
    FOLDER is None, reason="measured data not found; set ADHESION_CAN_REALDATA to their folder"
)
RADIUS = {1: 0.35, 2: 0.35, 3: 0.36, 4: 0.36}


@pytest.fixture(scope="module")
def drive():
    """(recording, receiver, readings, channels) of the whole drive."""
    configuration = load_configuration(DATA / "car.toml")
    recording = Recording(FOLDER / "rav4_drive.log.gz")
    subject = Receiver(configuration.messages)
    readings, channels = [], Counter()
    for item in recording:
        assert isinstance(item, Frame)
        channels[item.channel] += 1
        outcome = subject.accept(item)
        if isinstance(outcome, list):
            readings += [r for r in outcome if r.role is Role.WHEEL_SPEED]
    return recording, subject, readings, channels


@pytest.mark.costly
def test_every_line_of_the_drive_is_read(drive):
    recording, _, _, channels = drive
    assert recording.report.kinds == {"frame": 135_468}
    assert recording.report.passed_over == 0
    assert recording.report.bad_lines == recording.report.notes == []
    assert channels == {"can0": 53_800, "can1": 45_000, "can128": 12_434, "can129": 24_234}


def test_every_wheel_speed_frame_is_accepted(drive):
    _, subject, readings, _ = drive
    (wheels,) = [r for r in subject.records if r.message.plan.name == "WHEEL_SPEEDS"]
    assert wheels.frames == wheels.accepted > 4000
    assert not wheels.rejected
    assert len(readings) == 4 * wheels.accepted
    assert wheels.not_available == 0


def test_the_wheels_read_as_low_against_gnss_as_the_data_sheet_says(drive):
    """0.77 % in front, 0.96 % behind: the way through database, units and radii is right."""
    *_, readings, _ = drive
    with (FOLDER / "rav4_gnss_speed.csv").open(newline="") as file:
        rows = [(float(r["time_s"]), float(r["gnss_speed_mps"])) for r in csv.DictReader(file)]
    time_s, speed = np.array(rows).T
    low = {}
    for axle, radius in RADIUS.items():
        stamps = np.array([r.t_us / 1e6 for r in readings if r.axle == axle])
        rim = np.array([r.value * radius for r in readings if r.axle == axle])
        inside = (time_s > stamps[0]) & (time_s < stamps[-1]) & (speed > 5)
        at_gnss = np.interp(time_s[inside], stamps, rim)
        low[axle] = 100 * (1 - at_gnss.sum() / speed[inside].sum())
    front, rear = (low[1] + low[2]) / 2, (low[3] + low[4]) / 2
    assert front == pytest.approx(0.77, abs=0.1)
    assert rear == pytest.approx(0.96, abs=0.1)
    assert all(0.6 < value < 1.1 for value in low.values())


def test_the_tyre_rig_is_a_table_of_26306_rows():
    path = FOLDER / "tyre_rig_83kPa.csv.gz"
    assert is_table(path)
    table = read_table(path)
    assert table.rows == 26_306
    assert table.left_out == 0
    assert table.ignored == ()
    samples = table.samples
    assert len(samples) == 26_306
    assert set(samples.covariates) == {
        "slip_angle_deg",
        "inclination_deg",
        "pressure_kPa",
        "surface_temp_C",
        "ambient_temp_C",
    }
    # The first row of the file, by hand.
    assert samples.t_us[0] == 5_150_000
    assert samples.slip[0] == 0.1420
    assert samples.adhesion[0] == pytest.approx(3236.14 / 2627.17)
    assert samples.load[0] == 2627.17
    assert samples.creep_speed[0] == pytest.approx(0.1420 * 11.1806)
    assert -0.2 < samples.slip.min() < -0.18
    assert 0.14 < samples.slip.max() < 0.16
    assert np.ptp(samples.covariates["pressure_kPa"]) < 10


def test_the_gnss_file_is_neither_table_nor_recording():
    with pytest.raises(Exception, match="neither") as caught:
        is_table(FOLDER / "rav4_gnss_speed.csv")
    assert len(str(caught.value).splitlines()) == 1
