"""What the hunt calls a false name in worlds by others, and which of them it draws."""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.worlds import SINGLES
from tests.worlds.outside.car import CARS
from tests.worlds.outside.families import FAMILIES
from tests.worlds.outside.kinds import ASIDE, BESIDE, MECH, MEMORY, OPEN, SECOND
from tests.worlds.outside.registry import MECHANISMS

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def hunting():
    sys.path.insert(0, str(ROOT / "tools" / "hunting"))
    import judge
    import outside
    import plan
    import tables

    return SimpleNamespace(judge=judge, outside=outside, plan=plan, tables=tables)


def cause(effect, *rivals, form="", **parameters):
    found = {n: {"value": v, "std": s, "unit": ""} for n, (v, s) in parameters.items()}
    return {"effect": effect, "form": form, "rivals": list(rivals), "p_value": 0.0,
            "parameters": found}  # fmt: skip


def record(kind, causes, verdict="named", hidden=(), channel=None):
    head, _, rest = kind.partition(":")
    names = {
        "outside": [kind],
        "mech": [rest],
        "beside": [rest.partition("+")[0], f"outside:{rest.partition('+')[2]}"],
        "car": [kind],
    }.get(head, [])
    effects = [{"effect": n, "form": "", "parameters": dict(hidden)} for n in names]
    gain = {"percent": 20.0, "interval": None, "rmse_after": 0.01}
    return {
        "kind": kind, "seed": 1, "holdout": False, "status": 0, "seconds": 1.0, "rss_mb": 9.0,
        "truth": {"effects": effects, "channel": None},
        "diagnosis": {"verdict": verdict, "channel": channel, "causes": causes, "gain": gain},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "causes", "verdict", "outcome"),
    [
        ("outside:rail_joints", [], "unexplained", "unexplained"),
        ("outside:rail_joints", [], "nothing_found", "nothing"),
        ("outside:rail_joints", [cause("rail_cleaning")], "named", "wrong"),
        # A cause that is listed is a name, whatever the verdict.
        ("outside:rail_joints", [cause("rail_cleaning")], "unexplained", "wrong"),
        ("outside:rail_joints", [cause("channel:position")], "named", "same"),
        ("outside:rail_joints", [cause("formula", form="a * position")], "named", "wrong"),
        ("outside:rail_joints", [cause("formula", form="tanh(position / a)", a=(1, 0))], "named",
         "same"),
        ("outside:rail_joints", [cause("formula", form="position * speed")], "named", "wrong"),
        ("outside:water_film", [cause("speed_dependence")], "named", "same"),
        ("outside:water_film", [cause("load_dependence", "speed_dependence")], "named", "same"),
        ("outside:water_film", [cause("speed_dependence"), cause("humidity")], "named", "wrong"),
        ("outside:polygonal_wheel", [cause("wheel_once_per_turn")], "named", "wrong"),
        ("null:memory-1", [cause("curve_shape")], "named", "wrong"),
        ("null:memory-1", [], "nothing_found", "nothing"),
        ("null:memory-1", [], "unexplained", "unexplained"),
        ("car:scales", [cause("curve_shape"), cause("load_transfer")], "named", "same"),
        ("car:scales", [cause("speed_delay")], "named", "wrong"),
        ("car:loads", [cause("load_transfer")], "named", "wrong"),
        ("beside:sanding+rail_joints", [cause("sanding")], "unexplained", "kept"),
        ("beside:sanding+rail_joints", [cause("sanding"), cause("channel:position")], "named",
         "kept"),
        ("beside:sanding+rail_joints", [cause("sanding"), cause("humidity")], "named",
         "kept with a false one"),
        ("beside:sanding+rail_joints", [cause("humidity")], "named", "wrong"),
        ("beside:sanding+rail_joints", [], "unexplained", "lost"),
    ],
)  # fmt: skip
def test_a_false_name_is_what_is_physically_another_thing(hunting, kind, causes, verdict, outcome):
    assert hunting.judge.judge_record(record(kind, causes, verdict)).outcome == outcome


@pytest.mark.parametrize(
    ("causes", "verdict", "outcome"),
    [
        ([cause("load_transfer", height=(2.3, 0.01))], "named", "named"),
        ([cause("load_transfer", height=(2.5, 0.01))], "named", "wrong size"),
        ([cause("load_transfer", height=(2.5, 0.2))], "named", "named"),
        ([cause("load_transfer", scale=(2.5, 0.2))], "named", "size unknown"),
        ([cause("effort_gain", "load_transfer")], "named", "rival"),
        ([cause("load_transfer", height=(2.0, 0.1)), cause("humidity")], "named", "with others"),
        ([cause("load_transfer", height=(2.0, 0.1))], "unexplained", "unexplained"),
        ([cause("rail_cleaning")], "named", "wrong"),
        ([], "nothing_found", "nothing"),
    ],
)
def test_a_family_is_named_alone_and_with_its_size(hunting, causes, verdict, outcome):
    told = record("mech:load_transfer", causes, verdict, {"height": 2.0})
    assert hunting.judge.judge_record(told).outcome == outcome


def test_a_gain_of_another_axle_is_no_right_size(hunting):
    right = hunting.outside.has_right_size
    true = {"gain": 0.1, "axle": 3}
    assert right(true, {"gain": {"value": 0.1, "std": None}, "axle": {"value": 3.0}})
    assert not right(true, {"gain": {"value": 0.1, "std": 0.01}, "axle": {"value": 2.0}})


def test_every_effect_that_is_physically_the_same_is_one_of_the_contract():
    known = {*SINGLES, *FAMILIES, "curve_shape", "wheel_speed_delay"}
    for name, mechanism in MECHANISMS.items():
        effects = {one for one in mechanism.same if ":" not in one}
        assert effects <= known, name
        assert all(mechanism.same.values()), name


def test_worlds_by_others_are_drawn_only_where_they_are_asked_for(hunting):
    def kinds(*only):
        return [task.kind for task in hunting.plan.build_tasks(7, 1, only)]

    assert not set(kinds()) & {*OPEN, *ASIDE, *SECOND, *MECH, *MEMORY, *CARS, *BESIDE}
    assert kinds("outside:open") == list(OPEN)
    assert kinds("outside:aside") == list(ASIDE)
    assert len(ASIDE) == 12
    assert kinds("outside:second") == list(SECOND)
    assert kinds(SECOND[0]) == [SECOND[0]]
    assert kinds("outside") == [*OPEN, *ASIDE]
    assert kinds("memory", "car") == [*MEMORY, *CARS]
    assert len(kinds("beside")) == 8
    assert set(kinds("beside")) <= set(BESIDE)
    assert kinds(ASIDE[0]) == [ASIDE[0]]
    # What is set aside does not come in by another door.
    hidden = {kind.partition(":")[2] for kind in (*ASIDE, *SECOND)}
    assert not hidden & {kind.rpartition("+")[2] for kind in BESIDE}
    everything = {kind for form in hunting.plan.FORMS for kind in hunting.plan.GROUPS[form]}
    assert not hidden & {kind.rpartition(":")[2] for kind in everything}
    hunting.plan.check_kinds(["outside", "beside", MECH[0], CARS[0]])
    with pytest.raises(ValueError, match="no kind 'outside:none'"):
        hunting.plan.check_kinds(["outside:none"])


def test_false_names_stand_beside_their_targets(hunting):
    judge, tables = hunting.judge.judge_record, hunting.tables
    rows = [judge(record(kind, [], "unexplained")) for kind in (*OPEN, *ASIDE, *SECOND, *MEMORY)]
    rows.append(judge(record("car:scales", [], "nothing_found")))
    rows.append(judge(record(OPEN[0], [cause("humidity")])))
    found = {t.what: t for t in tables.targets(rows)}
    assert found["outside:open: false names"].figure.startswith(f"{1 / (len(OPEN) + 1):.1%} (1 of")
    assert found["outside:open: false names"].wanted == "at most 3%"
    assert found["outside:aside: false names"].verdict == "met"
    assert found["outside:second: false names"].figure.startswith(f"0.0% (0 of {len(SECOND)}")
    assert found["outside:second: false names"].wanted == "at most 3%"
    assert found["null:memory-10: false names"].wanted == "at most 2%"
    assert found["multi-body car: never called noise"].verdict == "FAILED"
    assert "humidity 1" in tables.confusion(rows)
    assert f"| {SECOND[0]} " in tables.confusion(rows)
    loud = [judge(record(OPEN[0], [], verdict)) for verdict in ("nothing_found", "unexplained")]
    loud = [replace(row, excess=0.2) for row in loud] + [replace(loud[0], excess=0.01)]
    found = {t.what: t for t in tables.targets(loud)}
    title = "outside:open: not called noise where it raises the RMSE by 10 % and more"
    assert found[title].figure.startswith("50.0% (1 of 2")
    assert "families" not in " ".join(found)


def test_forms_of_drives_are_judged_as_their_kind_and_stand_in_their_own_rows(hunting):
    judge = hunting.judge.judge_record
    humid = {"effects": [{"effect": "humidity", "form": "", "parameters": {}}], "channel": None}
    for form in hunting.plan.FORMS:
        row = judge(record(f"{form}:humidity", [cause("humidity")]) | {"truth": humid})
        assert (row.group, row.outcome) == (form, "named")
        kinds = [task.kind for task in hunting.plan.build_tasks(7, 1, [form])]
        assert len(kinds) == 6
        assert all(kind.startswith(f"{form}:") for kind in kinds)
    column = [cause("channel:humidity")]
    assert judge(record("table:humidity", column) | {"truth": humid}).outcome == "named"
    assert judge(record("short:humidity", column) | {"truth": humid}).outcome == "wrong"
    rows = [judge(record("short:outside:dew", [cause("sanding")]))]
    found = {t.what: t for t in hunting.tables.targets(rows)}
    assert found["drives of 30 s: false names"].verdict == "FAILED"
    assert found["drives of 30 s: single effects named, or with their rivals"].verdict == "no data"
