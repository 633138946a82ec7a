"""Measured data of a tyre rig: the load dependence that the plain curve does not know."""

import csv
import gzip

import pytest

from tests.diagnosis.diagnosis_helpers import diagnosed

STRAIGHT_DEG = 0.5


def rows_of(folder):
    path = folder / "tyre_rig_83kPa.csv.gz"
    with gzip.open(path, "rt", newline="") as file:
        head, *rows = csv.reader(file)
    return path, head, rows


def test_straight_running_names_the_load(realdata, tmp_path):
    _, head, rows = rows_of(realdata)
    angle, lean = head.index("slip_angle_deg"), head.index("inclination_deg")
    straight = [
        row
        for row in rows
        if abs(float(row[angle])) < STRAIGHT_DEG and abs(float(row[lean])) < STRAIGHT_DEG
    ]
    assert len(straight) == 4140
    path = tmp_path / "straight.csv"
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([head, *straight])
    answer = diagnosed(tmp_path, path)
    assert answer.status == 0
    assert answer.verdict == "named"
    assert answer.document["causes"][0]["effect"] == "load_dependence"
    assert answer.document["causes"][0]["rivals"] == []
    gain = answer.document["gain"]
    assert gain["rmse_before"] == pytest.approx(0.15, abs=0.03)
    assert gain["rmse_after"] <= 0.11
    assert gain["interval"][0] > 0
    # Nothing is there that the rig cannot tell.
    assert {"humidity", "wheel_radius", "sanding"} <= set(answer.untested)


@pytest.mark.slow
def test_all_rows_show_lateral_slip(realdata, tmp_path):
    path, *_ = rows_of(realdata)
    answer = diagnosed(tmp_path, path)
    assert answer.status == 0
    lateral = {"slip_angle_deg", "inclination_deg"}
    assert "curve_creep" in answer.named_or_rivals or answer.document["channel"] in lateral
    assert "load_dependence" in answer.named
    gain = answer.document["gain"]
    assert gain["rmse_after"] < 0.6 * gain["rmse_before"]
