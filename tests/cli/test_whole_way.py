"""The whole way with a mechanism that the library does not have, from a drive to what is left."""

import json

import pytest

from adhesion_can.api.configuration import as_configuration
from adhesion_can.cli.main import main
from adhesion_can.config.plan_file import read_plan
from adhesion_can.control.frames import ControllerOnBus, build_follower
from tests.worlds.outside.bench import OutsideBench
from tests.worlds.outside.kinds import OPEN
from tests.worlds.outside.registry import MECHANISMS
from tests.worlds.outside.world import find_outside

KIND = "outside:automatic_sander"
"""No message tells of the sand, and no effect of the library is the same."""


def diagnose(document, *arguments):
    assert main(["diagnose", *map(str, arguments), "--json", str(document)]) == 0
    return json.loads(document.read_text())


@pytest.mark.slow
@pytest.mark.long
def test_of_an_unlisted_mechanism_no_explanation_is_left(tmp_path, capsys):
    assert KIND in OPEN
    assert not MECHANISMS[KIND.partition(":")[2]].acceptable
    first, second, file = (tmp_path / name for name in ("first.log", "second.log", "plan.toml"))
    world, _ = find_outside(KIND, 1, first, duration_s=120.0, label="large")

    # A drive that is not explained, and what comes closest.
    before = diagnose(tmp_path / "before.json", first, "--next-drive", file)
    assert before["verdict"] == "unexplained"
    assert before["causes"] == []
    assert before["closest"]
    assert all(one["refuted_by"] for one in before["closest"])

    # The drive that tells them apart, with what each predicts.
    planned = before["next_drive"]
    said = capsys.readouterr().out
    # An explanation is one effect, or several that the data leave together.
    told_apart = {
        part.split()[0] for name in planned["explanations"] for part in name.split(" with ")
    }
    assert {one["effect"] for one in before["closest"]} & told_apart
    assert len(planned["explanations"]) >= 2
    for name in planned["explanations"]:
        assert f"If {name} holds, the adhesion " in said
    plan = read_plan(file)
    assert [one.name for one in plan.predictions] == planned["explanations"]

    # On the bench the hidden mechanism acts as before, and `control --plan` drives.
    config = as_configuration(None)
    follower = build_follower(config, plan)
    bench = OutsideBench(world, plan.start_speed, plan.duration_s + 1.0, 1)
    bench.drive(ControllerOnBus(config, follower, lambda: follower.sanding), second)
    assert follower.is_over

    # The best of wrong explanations is not left either, and nothing gets a name.
    after = diagnose(tmp_path / "after.json", first, second)
    assert after["verdict"] == "unexplained"
    assert after["causes"] == []
    remaining = after["remaining"]
    assert (remaining["before"], remaining["by"]) == (["first.log"], ["second.log"])
    assert remaining["left"] == []
    assert {one["name"] for one in remaining["refuted"]} == set(planned["explanations"])
    out = capsys.readouterr().out
    assert "No explanation that remained after first.log" in out
