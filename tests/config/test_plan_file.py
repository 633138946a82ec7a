"""The file of a driving plan: read as it was written, and every mistake told in one line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.config.plan_file import plan_text, read_plan, write_plan
from adhesion_can.errors import ConfigError
from adhesion_can.physics.driving_plan import DrivingPlan, PlanLimits, PlanStep, Prediction


def sizes(low, high):
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


@st.composite
def steps(draw):
    mode = draw(st.sampled_from(["traction", "braking", "coast"]))
    duration, sand = draw(sizes(0.1, 10.0)), draw(st.booleans())
    if mode == "coast":
        return PlanStep(duration, mode, sand=sand)
    slip = draw(sizes(0.0, 0.2)), draw(sizes(1e-4, 0.2))
    period = draw(st.one_of(st.just(0.0), sizes(0.5, 10.0)))
    axles = draw(st.lists(st.integers(1, 6), unique=True, max_size=6))
    stagger = bool(period) and draw(st.booleans())
    return PlanStep(duration, mode, slip, period, stagger, tuple(axles), sand)


@st.composite
def plans(draw):
    return DrivingPlan(
        steps=tuple(draw(st.lists(steps(), min_size=1, max_size=8))),
        start_speed=draw(sizes(3.0, 25.0)),
        curve=(draw(sizes(0.1, 0.6)), draw(sizes(10.0, 100.0)), draw(sizes(0.0, 0.5))),
        limits=PlanLimits(effort_max=draw(sizes(1e3, 3e5))),
        purpose=draw(st.text(max_size=20)),
        predictions=tuple(
            Prediction(name, text)
            for name, text in draw(st.lists(st.tuples(st.text(max_size=5), st.text(max_size=9))))
        ),
        bandwidth_share=draw(sizes(0.01, 1.0)),
    )


@given(plan=plans())
def test_a_plan_is_read_as_it_was_written(plan, tmp_path_factory):
    path = tmp_path_factory.mktemp("plan") / "plan.toml"
    write_plan(plan, path)
    assert read_plan(path) == plan


def test_the_file_says_where_limits_come_from_and_is_read_all_the_same(tmp_path):
    plan = DrivingPlan((PlanStep(2.0, "coast"),), 10.0, limits=PlanLimits(effort_max=5e4))
    path = tmp_path / "plan.toml"
    write_plan(plan, path, {"effort_max": "0.49 of the mean axle load", "sand": "[limits]"})
    assert "\neffort_max = 50000.0  # 0.49 of the mean axle load\n" in path.read_text()
    assert "\nsand = true  # [limits]\n" in path.read_text()
    assert read_plan(path) == plan


GOOD = plan_text(DrivingPlan((PlanStep(2.0, "traction", (0.0, 0.1)),), 10.0))


def wrong(tmp_path, text):
    path = tmp_path / "plan.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        read_plan(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('mode = "traction"', 'mode = "sideways"', "step[1].mode: 'sideways'"),
        ('mode = "traction"', "", "step[1].mode: missing"),
        ("slip = [0.0, 0.1]", "slip = [0.0, 0.3]", "step 1 has a slip beyond slip_max"),
        ("slip = [0.0, 0.1]", "slip = [0.0, -0.1]", "slips have no sign"),
        ("slip = [0.0, 0.1]", "slip = [0.1]", "1 values"),
        ("slip = [0.0, 0.1]", "slips = [0.0, 0.1]", "step[1].slips: unknown key"),
        ("duration_s = 2.0", "duration_s = 0.0", "duration_s must be above 0"),
        ("duration_s = 2.0", "duration_s = 2000.0", "longer than duration_max"),
        ("start_speed = 10.0", "", "start_speed: missing"),
        ("start_speed = 10.0", "start_speed = 1.0", "start_speed must be within"),
        ("start_speed = 10.0", "start_speed = nan", "not a finite number"),
        ("purpose", "aim", "aim: unknown key"),
        ("sand = true", "snow = true", "limits.snow: unknown key"),
        ("speed_max = 25.0", "speed_max = 2.0", "speed_max must be above speed_min"),
        ("axles = []", "axles = [2, 2]", "axles must be different numbers"),
    ],
)
def test_a_mistake_is_told_with_its_place(tmp_path, old, new, said):
    assert GOOD.count(old) >= 1
    assert said in wrong(tmp_path, GOOD.replace(old, new, 1))


@pytest.mark.parametrize(
    ("limit", "step", "said"),
    [
        ("braking", 'mode = "braking"\nslip = [0.0, 0.1]', "which the limits exclude"),
        ("single_axles", 'mode = "traction"\nslip = [0.0, 0.1]\naxles = [1]', "single_axles"),
        ("sand", 'mode = "coast"\nsand = true', "which the limits exclude"),
    ],
)
def test_a_step_that_the_limits_exclude_is_refused(tmp_path, limit, step, said):
    head = "start_speed = 10.0\ncurve = [0.37, 60.0, 0.26]\n"
    text = f"{head}[limits]\n{limit} = false\n[[step]]\nduration_s = 1.0\n{step}\n"
    assert said in wrong(tmp_path, text)
    path = tmp_path / "allowed.toml"
    path.write_text(text.replace("false", "true"))
    assert read_plan(path).steps
