"""The service's own log: rotation, and disks that take no more."""

import errno
import gzip
import io
import os
import threading

import pytest
from can.io.canutils import CanutilsLogReader

from adhesion_can.errors import InputError
from adhesion_can.recordings.candump import ReadReport, read_candump
from adhesion_can.service import frame_log
from adhesion_can.service.frame_log import FrameLog, LogBehind
from adhesion_can.service.log_comments import stamp_of


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
    assert notices == [f"--log: continues in a.{n}.log" for n in (2, 3, 4)]
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
    assert "continues" in again


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


LINE = "(1.000000) can0 101#00\n"


@pytest.fixture
def pipe(tmp_path):
    """A pipe, and the descriptor of a reader that has opened it and reads nothing."""
    path = tmp_path / "a.log"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    yield path, reader
    os.close(reader)


def read_all(reader):
    parts = []
    while True:
        try:
            part = os.read(reader, 1 << 16)
        except BlockingIOError:
            return b"".join(parts)
        if not part:
            return b"".join(parts)
        parts.append(part)


def test_a_stalled_reader_loses_whole_lines_and_a_comment_says_how_many(pipe, monkeypatch):
    path, reader = pipe
    monkeypatch.setattr(frame_log, "WAITING_LINES", 100)
    notices = []
    log = LogBehind(path, notices.append)
    given = 0
    # 64 KiB in the pipe, 1024 lines in hand, 100 that wait: then there is no room.
    while not log.lost:
        log.write(LINE)
        given += 1
    for _ in range(50):
        log.write(LINE)
        given += 1
    parts = []
    while len(notices) < 2:
        parts.append(read_all(reader))
        log.write(LINE)
        given += 1
    lost = log.lost
    log.end()
    while log._lines._thread.is_alive():
        parts.append(read_all(reader))
    assert log.wait()
    parts.append(read_all(reader))
    lines = b"".join(parts).splitlines(keepends=True)
    report = ReadReport()
    assert len(list(read_candump(lines, report))) == given - lost
    assert lost >= 51
    assert report.passed_over == 0
    assert report.kinds["comment"] == 1
    # The stamp is that of the line behind the hole.
    (comment,) = (line.decode() for line in lines if line.startswith(b"#"))
    text = f"{lost}_lines_lost:_the_disk_or_the_reader_was_too_slow"
    assert comment == f"#{stamp_of(LINE)}# log:{text} 000#\n"
    assert len(list(CanutilsLogReader(io.StringIO(comment + LINE)))) == 2
    assert [line.split(";")[0] for line in notices] == [
        "--log: losing lines: the disk or the reader is too slow",
        "--log: continues",
    ]


def test_a_reader_that_takes_nothing_by_the_end_is_told_and_counted(pipe, monkeypatch):
    path, _ = pipe
    monkeypatch.setattr(frame_log, "STREAM_END_S", 0.05)
    notices = []
    log = LogBehind(path, notices.append)
    for _ in range(10_000):
        log.write(LINE)
    log.end()
    assert not log.wait()
    assert 10_000 - log.lost <= (1 << 16) / len(LINE)
    assert notices == [
        f"--log: {log.lost} lines lost: they were not written before the service ended"
    ]


def test_a_reader_that_has_gone_ends_the_log_and_a_request_opens_it_again(pipe):
    path, reader = pipe
    notices = []
    with FrameLog(path, notices.append) as log:
        null = os.open(os.devnull, os.O_RDONLY)
        os.dup2(null, reader)
        os.close(null)
        log.write(LINE)
        assert log.lost == 1
        assert "SIGHUP starts a new log" in notices[0]
        again = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        log.request_next()
        log.write(LINE)
        assert read_all(again) == LINE.encode()
        os.close(again)
    assert notices[1] == "--log: continues in a.log"


def test_lines_behind_reach_their_file(tmp_path):
    log = LogBehind(tmp_path / "a.log", print)
    writer = threading.Thread(target=lambda: [log.write(LINE) for _ in range(3000)])
    writer.start()
    writer.join()
    log.end()
    assert log.wait()
    assert (tmp_path / "a.log").read_text() == LINE * 3000


@pytest.mark.parametrize("suffix", ["", ".gz"])
def test_a_pipe_that_nobody_reads_is_an_error_in_a_bounded_time(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"a.log{suffix}"
    os.mkfifo(path)
    monkeypatch.setattr("adhesion_can.pipes.READER_S", 0.1)
    with pytest.raises(InputError, match="without a reader"):
        LogBehind(path, print)


def test_a_packed_log_goes_through_a_pipe(tmp_path):
    path = tmp_path / "a.log.gz"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    with FrameLog(path, print) as log:
        log.write(LINE)
    assert gzip.decompress(read_all(reader)) == LINE.encode()
    os.close(reader)
