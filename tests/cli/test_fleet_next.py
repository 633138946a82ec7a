"""Commands to run after `fleet`: which recordings, and that they can be typed as they stand."""

from argparse import Namespace
from dataclasses import replace
from pathlib import Path

import pytest

from adhesion_can.cli.fleet_next import SHARED, next_commands
from adhesion_can.fleet.evidence import CauseSize
from adhesion_can.fleet.pooled_diagnosis import diagnose_fleet
from adhesion_can.fleet.units import Unit
from tests.fleet.synthetic_units import NAMES, SIZE, Fleet

OPTIONS = Namespace(config=None, dbc=None, lenient=False, column=[], assume=None)


def commands(fleet, folder, options=OPTIONS, config=None, own=()):
    evidence = [
        replace(one, path=f"{folder}/{one.unit}.log", cause_sizes=own) for one in fleet.draw(5)
    ]
    units = [Unit(one.path, one.vehicle, config=config) for one in evidence]
    return next_commands(diagnose_fleet(evidence), units, options)


def test_a_worn_wheel_is_calibrated_with_the_configuration_of_the_run(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    fleet = Fleet(worn={20: -0.013})
    (one,) = commands(fleet, tmp_path, Namespace(**{**vars(OPTIONS), "config": Path("my v.toml")}))
    assert one.who == "V20"
    assert one.line.startswith("Next: ")
    assert one.command.endswith(
        "adhesion-can calibrate u20-0.log u20-1.log --out V20.toml --config 'my v.toml'"
    )
    (own,) = commands(fleet, tmp_path, config="/its/own.toml")
    assert own.command.endswith("--config /its/own.toml")


@pytest.mark.parametrize("column", [[], ["slip=kappa,unit=percent"]])
def test_an_effect_of_all_vehicles_is_diagnosed_in_the_clearest_recordings(column):
    options = Namespace(**{**vars(OPTIONS), "column": column})
    own = (CauseSize(NAMES[2], "", 0, "size", "1", SIZE, 0.01),)
    fleet = Fleet(everywhere={2: SIZE})
    (one,) = commands(fleet, "/far/away", options, own=own)
    assert one.who == SHARED
    assert " diagnose /far/away/u" in one.command
    assert "--html fleet.html" not in one.command  # that is the page of the fleet itself
    assert one.command.count(".log") == 3
    assert ("--column slip=kappa,unit=percent" in one.command) == bool(column)


def test_a_recording_at_a_url_is_fetched_first():
    (one,) = commands(Fleet(worn={20: -0.013}), "s3://bucket/drives")
    assert one.command.startswith("fetch s3://bucket/drives/u20-0.log, ")
    assert "calibrate u20-0.log u20-1.log" in one.command


def test_nothing_named_is_nothing_to_run():
    assert commands(Fleet(), "/far/away") == []
