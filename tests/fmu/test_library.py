"""Libraries of FMUs: compiled once, for one processor or two, or an error that says what to do."""

import struct
import subprocess
from pathlib import Path

import pytest

from adhesion_can.errors import InputError
from adhesion_can.fmu import library
from adhesion_can.fmu.library import PLATFORMS, build_library, join_mach_o, possible_platforms

ROOT = Path(__file__).resolve().parents[2]
FUNCTIONS = """
GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment
EnterInitializationMode ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean
GetString SetReal SetInteger SetBoolean SetString GetFMUstate SetFMUstate FreeFMUstate
SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate GetDirectionalDerivative
SetRealInputDerivatives
GetRealOutputDerivatives DoStep CancelStep GetStatus GetRealStatus GetIntegerStatus GetBooleanStatus
GetStringStatus
""".split()  # noqa: SIM905


@pytest.fixture
def no_compiler(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(library, "_has_zig", lambda: False)
    monkeypatch.setattr(library, "_own_compiler", lambda: None)


@pytest.mark.usefixtures("no_compiler")
def test_without_a_compiler_the_extra_is_named():
    with pytest.raises(InputError, match=r"no C compiler here; .*\[fmu\]"):
        possible_platforms()
    with pytest.raises(InputError, match=r"--platform win64: there is no C compiler.*\[fmu\]"):
        build_library("win64")


@pytest.mark.usefixtures("no_compiler")
def test_the_machines_own_compiler_serves_the_machine_alone(monkeypatch):
    monkeypatch.setattr(library, "_own_compiler", lambda: "/usr/bin/cc")
    monkeypatch.setattr(library, "own_platform", lambda: "linux64")
    assert possible_platforms() == ["linux64"]
    with pytest.raises(InputError, match=r"--platform darwin64.*\[fmu\]"):
        build_library("darwin64")


def write_compiler(path, text):
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return str(path)


@pytest.mark.usefixtures("no_compiler")
def test_a_library_is_compiled_once(monkeypatch, tmp_path):
    count = tmp_path / "count"
    # The last word names the file to write.
    text = f'echo >> {count}; for last; do :; done; printf library > "$last"'
    compiler = write_compiler(tmp_path / "cc", text)
    monkeypatch.setattr(library, "_own_compiler", lambda: compiler)
    monkeypatch.setattr(library, "own_platform", lambda: "linux64")
    assert build_library("linux64") == build_library("linux64") == b"library"
    assert len(count.read_text().splitlines()) == 1
    cached = list((tmp_path / "adhesion-can" / "fmu").iterdir())
    assert [one.suffix for one in cached] == [".so"]
    monkeypatch.setattr(library, "_FLAGS", (*library._FLAGS, "-g"))
    other = tmp_path / "source"
    other.mkdir()
    for source in library.SOURCE.iterdir():
        (other / source.name).write_text(source.read_text() + "\n")
    monkeypatch.setattr(library, "SOURCE", other)
    build_library("linux64")
    assert len(count.read_text().splitlines()) == 2


@pytest.mark.usefixtures("no_compiler")
def test_where_nothing_can_be_kept_it_is_compiled_all_the_same(monkeypatch, tmp_path):
    (tmp_path / "adhesion-can").write_text("a file, not a folder")
    compiler = write_compiler(tmp_path / "cc", 'for last; do :; done; printf x > "$last"')
    monkeypatch.setattr(library, "_own_compiler", lambda: compiler)
    monkeypatch.setattr(library, "own_platform", lambda: "linux64")
    assert build_library("linux64") == b"x"


@pytest.mark.usefixtures("no_compiler")
@pytest.mark.parametrize("text", ["echo fmu.c: no such thing >&2; exit 1", "exit 3"])
def test_what_a_compiler_says_is_reported(monkeypatch, tmp_path, text):
    compiler = write_compiler(tmp_path / "cc", text)
    monkeypatch.setattr(library, "_own_compiler", lambda: compiler)
    monkeypatch.setattr(library, "own_platform", lambda: "linux64")
    with pytest.raises(InputError, match=r"the compiler failed: (fmu.c: no such thing|no message)"):
        build_library("linux64")


@pytest.mark.usefixtures("no_compiler")
def test_a_compiler_that_takes_too_long(monkeypatch, tmp_path):
    compiler = write_compiler(tmp_path / "cc", "exec sleep 60")
    monkeypatch.setattr(library, "_own_compiler", lambda: compiler)
    monkeypatch.setattr(library, "own_platform", lambda: "linux64")
    monkeypatch.setattr(library, "LONGEST_S", 0.2)
    with pytest.raises(InputError, match=r"not finished after 0.2 s; export again") as raised:
        build_library("linux64")
    assert compiler not in str(raised.value)


def test_a_library_of_two_processors_has_both():
    first = struct.pack("<III", 0xFEEDFACF, 0x01000007, 3) + b"intel" * 1000
    second = struct.pack("<III", 0xFEEDFACF, 0x0100000C, 0) + b"arm" * 9000
    joined = join_mach_o([first, second])
    magic, count = struct.unpack_from(">II", joined)
    assert (magic, count) == (0xCAFEBABE, 2)
    for number, (part, processor) in enumerate(((first, 0x01000007), (second, 0x0100000C))):
        kind, _, place, size, align = struct.unpack_from(">IIIII", joined, 8 + 20 * number)
        assert kind == processor
        assert place % (1 << align) == 0
        assert joined[place : place + size] == part


def test_every_function_of_the_interface_is_exported_and_nothing_else(unpacked):
    (found,) = (unpacked["service"] / "binaries").rglob("*.so")
    done = subprocess.run(
        ["nm", "-D", "--defined-only", found], capture_output=True, text=True, check=False
    )
    if done.returncode:
        pytest.skip("needs nm and a library of Linux")
    names = {line.split()[-1] for line in done.stdout.splitlines() if " T " in line}
    assert names - {"_init", "_fini"} == {f"fmi2{name}" for name in FUNCTIONS}


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("name", PLATFORMS)
def test_zig_compiles_for_every_platform(name, monkeypatch, tmp_path):
    pytest.importorskip("ziglang", reason="needs the extra 'fmu'")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    magic = {"linux64": b"\x7fELF", "win64": b"MZ", "darwin64": b"\xca\xfe\xba\xbe"}[name]
    found = build_library(name)
    assert found.startswith(magic)
    assert all(f"fmi2{function}".encode() in found for function in FUNCTIONS)
