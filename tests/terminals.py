"""The benches of the documents, run as printed: each line of a block is a terminal."""

import multiprocessing
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BENCH_GUIDE = ROOT / "docs" / "guides" / "bench.md"


def bench_lines(name, document):
    """Command lines of the block that a document marks with <!-- bench: name -->."""
    text = document.read_text()
    block = re.search(rf"<!-- bench: {name} -->\n```sh\n(.*?)```", text, re.DOTALL)
    return block[1].strip().splitlines()


def in_path(command):
    """The command with the interpreter that runs this test, and its scripts, in front."""
    words = shlex.split(command)
    folder = Path(sys.executable).parent
    return [str(folder / words[0]) if (folder / words[0]).exists() else words[0], *words[1:]]


class Terminal:
    """One command, its output in files."""

    def __init__(self, command, folder, name):
        self.out, self.err = folder / f"{name}.out", folder / f"{name}.err"
        self.files = [self.out.open("wb"), self.err.open("wb")]
        self.process = self._started(command, folder)

    def _started(self, command, folder):
        # What a shell runs in the background ignores SIGINT, and so would the command. And tools of
        # others show a line at once on a terminal alone.
        words = ["env", "--default-signal=INT", "PYTHONUNBUFFERED=1"]
        return subprocess.Popen(
            [*words, *in_path(command)], cwd=folder,
            stdout=self.files[0], stderr=self.files[1], stdin=subprocess.DEVNULL,
        )  # fmt: skip

    def wait_for(self, text, timeout=60.0):
        """Until the command has printed a text, on either stream."""
        self.until(lambda: text in self.out.read_text() + self.err.read_text(), timeout, text)

    def until(self, ready, timeout, what):
        end = time.monotonic() + timeout
        while not ready():
            assert self.process.poll() in (None, 0), self.err.read_text()
            assert time.monotonic() < end, f"no {what!r} within {timeout} s"
            time.sleep(0.1)

    def wait(self, timeout):
        code = self.process.wait(timeout)
        self._close()
        return code

    def interrupt(self, timeout=30.0, *, again=False):
        """Ctrl-C; returns the exit status. `again`: once more for another's tool that missed it."""
        self.process.send_signal(signal.SIGINT)
        if again:
            with suppress(subprocess.TimeoutExpired):
                return self.wait(timeout / 3)
            self.process.send_signal(signal.SIGINT)
        return self.wait(timeout)

    def kill(self):
        self.process.kill()
        self.process.wait(10)
        self._close()

    def _close(self):
        for file in self.files:
            file.close()


class ForkedTerminal(Terminal):
    """An `adhesion-can` command in a fork of this process.

    It finds everything imported, which costs an emulated machine up to a minute a process.
    """

    def _started(self, command, folder):
        return ForkedProcess(shlex.split(command)[1:], folder, self.files)


class ForkedProcess:
    """What a terminal needs of `subprocess.Popen`, for a command of this package."""

    def __init__(self, arguments, folder, files):
        self._process = multiprocessing.get_context("fork").Process(
            target=_run_command, args=(arguments, folder, [file.fileno() for file in files])
        )
        self._process.start()

    def poll(self):
        return self._process.exitcode

    def wait(self, timeout):
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise subprocess.TimeoutExpired("adhesion-can", timeout)
        return self._process.exitcode

    def send_signal(self, number):
        os.kill(self._process.pid, number)

    def kill(self):
        self._process.kill()


def _run_command(arguments, folder, outputs):
    """In the fork: the command, with its outputs in files instead of the test run's."""
    os.chdir(folder)
    for target, source in zip((1, 2), outputs, strict=True):
        os.dup2(source, target)
    sys.stdout, sys.stderr = (os.fdopen(number, "w", closefd=False) for number in (1, 2))
    from adhesion_can.cli.main import main

    sys.exit(main(arguments))
