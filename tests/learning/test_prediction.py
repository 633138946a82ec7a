"""Spans that were not fitted: who predicts them better, in drives of the tests' own worlds."""

import numpy as np
import pytest

from adhesion_can.config import load_configuration
from adhesion_can.errors import InputError
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.learning.examination import build_drive
from adhesion_can.learning.prediction import predict_spans
from adhesion_can.offline.load_traces import load_traces
from adhesion_can.physics.effects import ActiveEffect, forms_of_effect
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings
from tests.learning.learning_helpers import BASE
from tests.worlds import make_world

CONFIG = load_configuration()
FROM_US, SPAN_US, SPANS = 60_000_000, 5_000_000, 10


def readings_of(log):
    """Readings of a recording in columns, as the service's record has them."""
    blocks = blocks_in_sequence(open_recordings([log]), CONFIG.service.restart_s)
    return {
        key: tuple(map(np.concatenate, zip(*parts, strict=True)))
        for key, parts in load_traces(blocks, CONFIG, str(log)).columns.items()
    }


def scaled(error):
    """Model in which the vehicle speed reads high by a share."""
    effect = forms_of_effect("speed_scale")[0]
    return ExtendedModel(BASE, effects=(ActiveEffect(effect, (error,)),))


@pytest.fixture(scope="module")
def low_speed(tmp_path_factory):
    """Drive in which the speed reads wrong, and by how much."""
    log = tmp_path_factory.mktemp("low") / "drive.log"
    truth = make_world("speed_scale", 1, log, duration_s=120.0)
    return build_drive(readings_of(log), CONFIG), truth.effects[0].parameters["error"]


def won(drive, model):
    spans = predict_spans(drive, model, FROM_US, SPAN_US, SPANS)
    return len(spans), sum(span.is_better for span in spans)


def test_the_true_model_predicts_better_and_its_opposite_worse(low_speed):
    drive, error = low_speed
    number, better = won(drive, scaled(error))
    assert number >= 6
    assert better >= 0.9 * number
    number, better = won(drive, scaled(-error))
    assert number >= 6
    assert better <= 0.1 * number


def test_a_model_that_changes_nothing_tells_nothing_apart(low_speed):
    drive, _ = low_speed
    assert predict_spans(drive, scaled(0.0), FROM_US, SPAN_US, SPANS) == []


def test_spans_end_where_they_were_asked_for(low_speed):
    drive, error = low_speed
    ends = {span.to_us for span in predict_spans(drive, scaled(error), FROM_US, SPAN_US, SPANS)}
    assert ends <= {FROM_US + k * SPAN_US for k in range(1, SPANS + 1)}


def test_without_readings_before_it_there_is_no_prediction(low_speed):
    drive, error = low_speed
    with pytest.raises(InputError, match="too few rows"):
        predict_spans(drive, scaled(error), drive.first_us, SPAN_US, SPANS)


def test_a_model_whose_channel_is_missing_is_refused():
    effect = next(e for e in forms_of_effect("sanding") if not e.form)
    values = tuple(p.typical for p in effect.parameters)
    model = ExtendedModel(BASE, effects=(ActiveEffect(effect, values),))
    with pytest.raises(InputError, match="sanding"):
        predict_spans(build_drive({}, CONFIG), model, FROM_US, SPAN_US, SPANS)
