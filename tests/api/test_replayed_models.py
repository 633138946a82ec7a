"""What a log says beside its frames: replay begins and goes on as the service did."""

import pytest

from adhesion_can.api.replayed_models import ReplayedModels
from adhesion_can.api.simulation import simulate
from adhesion_can.bus.frame import STOP, Mark
from adhesion_can.config import load_configuration
from adhesion_can.diagnosis.result import InputFile
from adhesion_can.errors import RecordingError
from adhesion_can.fleet.unit_sources import RecordingUnit
from adhesion_can.recordings.candump import format_frame, format_mark
from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.sequence import blocks_in_sequence
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.correcting_core import CorrectingCore
from adhesion_can.service.kept_state import kept_curves_to_lines, with_surfaces
from adhesion_can.service.model_changes import ModelChange
from tests.service.test_correcting_core import drive
from tests.service.test_model_changes import model_of

CONFIG = load_configuration()
CURVES = ((0.27, 45.0, 0.22), (0.35, 60.0, 0.31))


class Run:
    """A service that logs what it receives, from a time later than the first run, s."""

    def __init__(self, path, later_s=0.0, change_s=None, config=CONFIG, frames=None, head=""):
        self.sent, self.path = [], path
        core = CorrectingCore(config) if change_s is not None else ServiceCore(config)
        frames = drive() if frames is None else frames
        frames = [replace_time(frame, later_s) for frame in frames]
        begin_us, lines = frames[0].t_us, [head]
        for frame in frames:
            self.sent += core.feed(frame)
            lines.append(format_frame(frame))
            if change_s is not None and frame.t_us - begin_us >= 1e6 * change_s:
                change = ModelChange(core.next_change_us(), model_of(-0.01))
                core.change_model(change)
                lines.append(change.to_lines())
                change_s = None
        self.sent += core.stop(core.now_us)
        lines.append(format_mark(Mark(core.now_us, STOP)))
        path.write_text("".join(lines))


def replace_time(frame, later_s):
    return frame._replace(t_us=frame.t_us + round(1e6 * later_s))


def replayed(*paths):
    recordings = [Recording(path) for path in paths]
    models, sent = ReplayedModels(recordings), []
    core = models.make_core(CONFIG, None, lambda *_: None)
    models.run(blocks_in_sequence(recordings, CONFIG.service.restart_s), core, sent.append)
    return sent, models, recordings


@pytest.mark.costly
def test_a_log_of_another_start_begins_with_the_plain_curve(tmp_path):
    first = Run(tmp_path / "a.log", change_s=1.0)
    second = Run(tmp_path / "b.log", later_s=100.0)
    sent, models, recordings = replayed(first.path, second.path)
    assert sent[: len(first.sent)] == first.sent
    took = list(models.sentences(0))
    assert len(took) == 2
    assert "the plain curve" in took[1]
    begin_s = float(took[1].split()[1])
    assert begin_s == pytest.approx(100.0 + drive()[0].t_us / 1e6, abs=0.05)
    # The first stamp was looked for before, and its frames count once all the same.
    again = Recording(second.path)
    assert sum(map(len, again.blocks())) == len(drive()) + 1
    assert recordings[1].report == again.report


@pytest.mark.costly
def test_a_log_that_was_begun_at_a_signal_goes_on_with_the_model(tmp_path):
    whole = Run(tmp_path / "whole.log", change_s=1.0)
    lines = whole.path.read_text().splitlines(keepends=True)
    half = len(lines) // 2
    changes = [line for line in lines if "adhesion-can-model" in line]
    (tmp_path / "a.log").write_text("".join(lines[:half]))
    (tmp_path / "a.1.log").write_text("".join([*changes, *lines[half:]]))
    sent, models, _ = replayed(tmp_path / "a.log", tmp_path / "a.1.log")
    assert sent == whole.sent
    assert len(list(models.sentences(0))) == 1


@pytest.mark.costly
def test_a_row_of_a_fleet_has_the_model_of_the_log(tmp_path):
    path = Run(tmp_path / "a.log", change_s=1.0).path
    unit = RecordingUnit(InputFile(path, "a.log", ""), CONFIG)
    with_change = unit.replay()
    lines = [line for line in path.read_text().splitlines(True) if "adhesion-can" not in line]
    path.write_text("".join(lines))
    assert with_change["tracking_s"] > 0.0
    assert with_change["lambda_m"] != unit.replay()["lambda_m"]


@pytest.mark.costly
def test_a_service_that_began_with_kept_surfaces_is_repeated_to_the_byte(tmp_path):
    frames = simulate("wet", 6.0, seed=5).frames
    head = kept_curves_to_lines(frames[0].t_us, CURVES)
    warm = Run(tmp_path / "a.log", config=with_surfaces(CONFIG, CURVES), frames=frames, head=head)
    sent, models, _ = replayed(warm.path)
    assert sent == warm.sent
    assert sent != Run(tmp_path / "cold.log", frames=frames).sent
    assert list(models.sentences(0)) == ["The service began with 2 kept surfaces."]
    assert models.to_dict() == {"kept_surfaces": 2}


def test_eight_surfaces_are_read_as_they_were_written(tmp_path):
    curves = tuple((0.1 + k / 70, 45.0 + k / 30, 0.2 / (k + 3)) for k in range(8))
    (path := tmp_path / "a.log").write_text(
        kept_curves_to_lines(1_700_000_000_000_000, curves) + format_frame(drive()[0])
    )
    models = ReplayedModels([Recording(path)])
    core = models.make_core(CONFIG, None, lambda *_: None)
    assert core.configuration.estimators.tracker.known_surfaces == curves
    assert max(map(len, path.read_text().splitlines())) < 398
    assert kept_curves_to_lines(0, ()) == ""


@pytest.mark.parametrize("text", ["[[1,2]]", "[[0.3,60,nan]]", "[[0.3,60,99999]]", "{}", "[", "7"])
def test_kept_surfaces_that_are_damaged_are_an_error(tmp_path, text):
    (path := tmp_path / "a.log").write_text(
        f"#1.000000# adhesion-can-surfaces:{text} 000#\n" + format_frame(drive()[0])
    )
    with pytest.raises(RecordingError, match="surfaces with which the service began"):
        ReplayedModels([Recording(path)])
