"""Authenticated setpoints of a running service; the files of the key and of the trip counter."""

import os
import stat
import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import pytest

from adhesion_can.bus.frame import Frame
from adhesion_can.bus.secoc import MOST_TRIPS, FrameAuthenticator, FrameVerifier, Refusal
from adhesion_can.cli.extras_of_run import read_secoc
from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.errors import InputError
from adhesion_can.recordings.candump import ReadReport, read_candump
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.secoc_files import TripFile, read_key
from tests.service.test_core import FixedEstimator
from tests.service.test_live import Running, everything, opened, owned, send_drive, wait_until

KEY = bytes(range(16))
FRAME = Frame(0, 0x201, bytes(8))
unless_root = pytest.mark.skipif(os.geteuid() == 0, reason="root may read and write everything")


@pytest.fixture
def key(tmp_path):
    path = tmp_path / "key"
    path.write_text(KEY.hex() + "\n")
    path.chmod(0o600)
    return path


def test_every_frame_of_a_service_is_authentic_and_its_log_is_the_plain_one(tmp_path):
    trips = TripFile(tmp_path / "trip")
    secure = FrameAuthenticator(KEY, trips.next_trip).secure
    with opened("secured") as sender, opened("secured") as listener:
        core = ServiceCore(load_configuration(), FixedEstimator)
        with Running(core, opened("secured"), secure=secure) as live:
            send_drive(sender, 0.3)
            received = []
            wait_until(lambda: received.extend(owned(everything(listener))) or len(received) > 100)
        received += owned(everything(listener))
    drive = FrameVerifier(KEY)
    payloads = [(frame.arbitration_id, drive.accept(frame)) for frame in received]
    assert all(isinstance(payload, bytes) for _, payload in payloads)
    assert all(frame.is_fd for frame in received)
    items = read_candump([line.encode() for line in live.lines], ReadReport())
    logged = owned(item for item in items if isinstance(item, Frame))
    assert payloads == [(frame.arbitration_id, frame.data) for frame in logged]
    # The next start is fresher than all of this one; what was recorded is refused.
    again = FrameAuthenticator(KEY, trips.next_trip).secure(logged[0])
    assert drive.accept(again) == logged[0].data
    assert drive.accept(received[-1]) is Refusal.FRESHNESS


def test_echoes_of_secured_frames_are_no_second_service():
    secure = FrameAuthenticator(KEY, iter(range(1, 9)).__next__).secure
    with opened("secured-echo") as sender:
        echoing = opened("secured-echo", receive_own_messages=True)
        core = ServiceCore(load_configuration(), FixedEstimator)
        with Running(core, echoing, secure=secure) as live:
            send_drive(sender, 0.2)
            wait_until(lambda: live.service.counts.echoes > 20)
    assert live.service.counts.foreign_outputs == 0


# --- the files -----------------------------------------------------------------------------------


def test_a_key_is_32_hexadecimal_digits(key):
    assert read_key(key) == KEY


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o601, 0o666])
def test_a_key_on_which_others_have_rights_is_refused(key, mode):
    key.chmod(mode)
    with pytest.raises(InputError, match="users other than its owner can access it; chmod 600"):
        read_key(key)


@pytest.mark.parametrize("text", ["", "00" * 15, "00" * 17, "0g" * 16, "00" * 16 + " 1", "é" * 32])
def test_what_is_no_key_is_refused(key, text):
    key.write_text(text)
    with pytest.raises(InputError, match="openssl rand -hex 16") as error:
        read_key(key)
    assert not text or text not in str(error.value)


def test_a_device_is_no_key():
    with pytest.raises(InputError, match="is a pipe or a device, not a file"):
        read_key(Path(os.devnull))


def test_a_trip_is_on_the_disk_before_it_is_used(tmp_path):
    path = tmp_path / "trip"
    assert [TripFile(path).next_trip() for _ in range(3)] == [1, 2, 3]
    assert path.read_text() == "3\n"
    assert sorted(one.name for one in tmp_path.iterdir()) == ["trip", "trip.lock"]


@pytest.mark.parametrize("text", ["", "x", "-1", "1.5", "1" * 11, "1\n2"])
def test_a_damaged_trip_counter_is_refused_and_kept(tmp_path, text):
    path = tmp_path / "trip"
    path.write_text(text)
    with pytest.raises(InputError, match="write a number larger than any that was used"):
        TripFile(path).next_trip()
    assert path.read_text() == text


def test_a_trip_counter_that_is_used_up_asks_for_another_key(tmp_path):
    path = tmp_path / "trip"
    path.write_text(str(MOST_TRIPS - 1))
    assert TripFile(path).next_trip() == MOST_TRIPS
    with pytest.raises(InputError, match="take another key"):
        TripFile(path).next_trip()


@unless_root
def test_a_trip_counter_that_cannot_be_written_ends_the_start(tmp_path):
    tmp_path.chmod(stat.S_IRUSR | stat.S_IXUSR)
    with pytest.raises(InputError):
        TripFile(tmp_path / "trip").next_trip()


# --- the command ---------------------------------------------------------------------------------


def run(capsys, *words):
    status = main(["run", "-i", "virtual", "-c", "secoc", "--duration", "0.1", *map(str, words)])
    return status, capsys.readouterr().err


def test_what_is_missing_is_said(capsys, key, tmp_path):
    trip = tmp_path / "trip"
    status, said = run(capsys, "--secoc-key", key, "--fd")
    assert (status, "pass --secoc-trip FILE" in said) == (2, True)
    status, said = run(capsys, "--secoc-trip", trip)
    assert (status, "pass --secoc-key FILE" in said) == (2, True)
    status, said = run(capsys, "--secoc-key", key, "--secoc-trip", trip)
    assert (status, "open the bus with --fd" in said) == (2, True)
    status, said = run(capsys, "--secoc-key", key, "--secoc-trip", key, "--fd")
    assert (status, "one of the inputs" in said) == (2, True)
    assert not trip.exists()


@pytest.mark.parametrize(("size", "fits"), [(8, True), (32, True), (7, False), (64, False)])
def test_a_message_without_room_for_the_authenticator_is_told(key, tmp_path, size, fits):
    trip = tmp_path / "trip"
    options = Namespace(secoc_key=key, secoc_trip=trip, fd=True)
    if fits:
        assert read_secoc(options, {"AdhesionSetpoint": size})(FRAME).is_fd
        return
    with pytest.raises(InputError, match=f"AdhesionSetpoint has {size} bytes"):
        read_secoc(options, {"AdhesionSetpoint": size})
    assert not trip.exists()


@pytest.mark.usefixtures("restored_signals")
def test_each_start_takes_a_trip(capsys, key, tmp_path):
    trip = tmp_path / "trip"
    for number in (1, 2):
        status, said = run(capsys, "--secoc-key", key, "--secoc-trip", trip, "--fd")
        assert (status, trip.read_text()) == (1, f"{number}\n"), said  # no frame came
    assert KEY.hex() not in said


STARTS = """
import sys, time
from pathlib import Path
from adhesion_can.service.secoc_files import TripFile
print("ready", flush=True)
sys.stdin.readline()
for _ in range(50):
    print(TripFile(Path(sys.argv[1])).next_trip(), flush=True)
"""


def test_no_two_starts_get_the_same_trip(tmp_path):
    path = tmp_path / "trip"
    words = [sys.executable, "-c", STARTS, str(path)]
    pipe = subprocess.PIPE
    services = [
        subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=pipe, text=True) for _ in range(4)
    ]
    for service in services:
        assert service.stdout.readline() == "ready\n"
    for service in services:
        service.stdin.write("go\n")
        service.stdin.flush()
    said = [service.communicate(timeout=500) for service in services]
    assert [err for _, err in said] == [""] * 4
    trips = [[int(line) for line in out.split()] for out, _ in said]
    assert all(own == sorted(own) for own in trips)
    assert sorted(trip for own in trips for trip in own) == list(range(1, 201))
    assert path.read_text() == "200\n"


def test_a_trip_behind_a_link_is_counted_where_it_is(tmp_path):
    (tmp_path / "there").mkdir()
    path = tmp_path / "trip"
    path.symlink_to(tmp_path / "there" / "real")
    assert [TripFile(path).next_trip(), TripFile(tmp_path / "there" / "real").next_trip()] == [1, 2]
    assert path.is_symlink()
