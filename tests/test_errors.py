"""What an error suggests for a name that is written wrongly."""

import pytest

from adhesion_can.bus.database import load_database
from adhesion_can.errors import DatabaseError, suggest


def test_names_that_are_written_alike_are_suggested_whatever_their_case():
    known = ["WheelSpeed_Ax1", "VehicleSpeed", "Crc"]
    assert suggest("wheelspeed_a1", known).startswith("similar names: WheelSpeed_Ax1")
    assert suggest("zzz", known) == ""
    assert suggest("x", []) == ""


def test_a_role_whose_signal_is_not_there_names_those_that_are_near():
    with pytest.raises(DatabaseError, match=r"similar names: .*WheelSpeeds1\.WheelSpeed_Ax1"):
        load_database().signal("WheelSpeeds1", "WheelSpeed_A1", "wheel_speed.1")
    with pytest.raises(DatabaseError, match=r"no such message.*cantools dump"):
        load_database().signal("Q", "Z", "wheel_speed.1")


def test_a_missing_database_says_where_it_was_looked_for(tmp_path):
    with pytest.raises(DatabaseError, match=str(tmp_path / "none.dbc")):
        load_database(tmp_path / "none.dbc")
