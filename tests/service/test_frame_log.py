"""The service's own log: rotation, and disks that take no more."""

import errno
import gzip
import os

import pytest

from adhesion_can.errors import InputError
from adhesion_can.service.frame_log import FrameLog


class FullDisk:
    """A file that takes so many lines, and no more."""

    def __init__(self, file, lines, code=errno.ENOSPC):
        self.file, self.left, self.code = file, lines, code

    def write(self, line):
        if not self.left:
            raise OSError(self.code, os.strerror(self.code))
        self.left -= 1
        self.file.write(line)


def test_lines_are_in_one_file_after_the_other_and_nothing_is_overwritten(tmp_path):
    (tmp_path / "a.1.log").write_text("of another run\n")
    notices = []
    with FrameLog(tmp_path / "a.log", notices.append) as log:
        for number in range(3):
            log.write(f"{number}\n")
            log.request_next()
        log.write("3\n")
    found = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert found == {
        "a.log": "0\n",
        "a.1.log": "of another run\n",
        "a.2.log": "1\n",
        "a.3.log": "2\n",
        "a.4.log": "3\n",
    }
    assert notices == [f"--log: goes on in a.{n}.log" for n in (2, 3, 4)]
    assert log.lost == 0


def test_packed_files_keep_both_suffixes(tmp_path):
    with FrameLog(tmp_path / "a.log.gz", print) as log:
        log.write("0\n")
        log.request_next()
        log.write("1\n")
    for name, text in (("a.log.gz", "0\n"), ("a.1.log.gz", "1\n")):
        with gzip.open(tmp_path / name, "rt") as file:
            assert file.read() == text


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO, errno.EROFS])
def test_a_disk_that_takes_no_more_ends_the_file_and_not_the_service(tmp_path, code):
    notices = []
    with FrameLog(tmp_path / "a.log", notices.append) as log:
        log._file = FullDisk(log._file, 2, code)
        for number in range(5):
            log.write(f"{number}\n")
        assert log.lost == 3
        assert (tmp_path / "a.log.part").read_text() == "0\n1\n"
        log.request_next()
        log.write("5\n")
    assert (tmp_path / "a.log").read_text() == "5\n"
    told, again = notices
    assert os.strerror(code) in told
    assert "SIGHUP" in told
    assert "goes on" in again


def test_a_folder_that_vanished_is_told_and_the_service_goes_on(tmp_path):
    folder = tmp_path / "logs"
    folder.mkdir()
    notices = []
    with FrameLog(folder / "a.log", notices.append) as log:
        log.write("0\n")
        (part,) = folder.iterdir()
        part.unlink()
        folder.rmdir()
        log.request_next()
        log.write("1\n")
        log.write("2\n")
    assert log.lost == 2
    assert len(notices) == 2
    assert "without a log" in notices[1]


def test_a_crash_leaves_a_part(tmp_path):
    def crash():
        with FrameLog(tmp_path / "a.log", print) as log:
            log.write("0\n")
            raise RuntimeError("crash")

    with pytest.raises(RuntimeError, match="crash"):
        crash()
    assert (tmp_path / "a.log.part").read_text() == "0\n"
    assert not (tmp_path / "a.log").exists()


def test_a_first_file_that_cannot_be_written_is_an_error(tmp_path):
    with pytest.raises(InputError):
        FrameLog(tmp_path / "nowhere" / "a.log", print)
