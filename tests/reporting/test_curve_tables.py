"""What the comparison of curve families says in a terminal."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.cli.main import main
from adhesion_can.estimation.batch_fit import identify
from adhesion_can.physics.burckhardt import adhesion
from adhesion_can.physics.curves import FAMILIES
from adhesion_can.physics.samples import Samples
from adhesion_can.reporting.curves import _verdict, render_curves

TWO = (FAMILIES["burckhardt"], FAMILIES["burckhardt_c4"])


def two_speeds(c4):
    """A drive at 5 and then at 25 m/s whose adhesion falls with creep speed."""
    rng = np.random.default_rng(7)
    time_s = np.arange(900) * 0.05
    slip = 0.1 + 0.09 * np.sin(2 * np.pi * time_s / 5.3)
    speed = np.where(time_s < 22.5, 5.0, 25.0)
    mu = adhesion(slip, 0.35, 70.0, 0.2) * np.exp(-c4 * slip * speed)
    samples = Samples.curve(slip, mu + 0.003 * rng.standard_normal(900))
    t_us = np.round(time_s * 1e6).astype(np.int64)
    return replace(samples, t_us=t_us, speed=speed, creep_speed=slip * speed)


def text_of(result):
    return "\n".join(part for part in render_curves(result) if isinstance(part, str))


def test_a_change_of_speed_that_looks_like_one_of_the_surface_is_called_so():
    result = identify(two_speeds(0.15), families=TWO)
    assert len(result.segments) == 2
    assert result.whole_curves.plausible == ("burckhardt_c4",)
    assert "A single burckhardt_c4 curve predicts" in text_of(result)
    document = result.to_dict()
    assert document["curves"]["plausible"] == ["burckhardt_c4"]
    assert [s["curves"]["samples"] for s in document["segments"]] == [450, 450]


def test_nothing_is_said_of_changes_where_there_are_none():
    result = identify(two_speeds(0.0), families=TWO)
    assert len(result.segments) == 1
    assert "may not have changed" not in text_of(result)
    assert "burckhardt" in result.whole_curves.plausible


def test_few_samples_are_said_to_be_too_few():
    samples = two_speeds(0.0).select(slice(0, 25))
    assert "fewer than 30 samples, none compared" in text_of(identify(samples, families=TWO))


@pytest.mark.costly
def test_the_command_prints_table_values_and_verdict(realdata, capsys):
    path = str(realdata / "eurosprinter_points.csv")
    assert main(["identify", path, "--curve", "polach"]) == 0
    printed = capsys.readouterr().out
    assert "polach: kA 0.85" in printed
    assert "61 % of the stiffness of a clean contact" in printed
    assert "Held out: 140 points, each predicted" in printed
    assert main(["identify", path]) == 0
    assert "Curve families" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("names", "holds", "agrees"),
    [
        (("free",), True, True),
        (("free",), False, False),
        (("free", "burckhardt"), True, False),
        (("burckhardt",), True, False),
    ],
)
def test_a_family_that_predicts_better_does_not_contradict_a_peak_that_holds(names, holds, agrees):
    common = SimpleNamespace(slip=0.004, adhesion=0.02)
    comparison = SimpleNamespace(
        plausible=names, rail_std=(0.008, 0.004), mu_max=0.373, lambda_m=0.074, speed=14.0,
        common=common,
    )  # fmt: skip
    said = _verdict(comparison, SimpleNamespace(burckhardt_holds=holds))
    assert ("agrees with that of burckhardt, which the last line has" in said) is agrees
    assert ("predicts held-out samples better than the others" in said) is (len(names) == 1)
    assert "agrees" not in _verdict(comparison, None)


def test_an_unknown_family_ends_with_status_2(realdata, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["identify", str(realdata / "eurosprinter_points.csv"), "--curve", "kalker"])
    assert stop.value.code == 2
    assert "known: burckhardt" in capsys.readouterr().err


def test_a_diagnosis_of_few_points_says_where_each_family_has_the_peak(realdata, capsys, tmp_path):
    answer = tmp_path / "answer.json"
    points = str(realdata / "eurosprinter_points.csv")
    assert main(["diagnose", points, "--json", str(answer)]) == 0
    lines = capsys.readouterr().out
    assert "The peak depends on the form of the curve: Burckhardt, Polach, free curve" in lines
    assert "at slips from 0.018" in lines
    # No standard deviation of a form that the others contradict.
    base = json.loads(answer.read_text())["base"]
    assert base["lambda_m"]["std"] is None
    assert not base["identifiable"]["lambda_m"]
