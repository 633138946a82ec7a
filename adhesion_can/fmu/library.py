"""The library of an FMU: C that is compiled once for each platform and kept in the user's cache.

The compiler is Zig's, which compiles for other platforms too (the extra `fmu`), else the machine's
own `cc`, for this platform alone.
"""

import os
import platform
import shutil
import struct
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from adhesion_can.errors import InputError
from adhesion_can.extras import install_extra
from adhesion_can.files import whole_file

SOURCE = Path(__file__).parent / "source"
LONGEST_S = 600.0
"""Time that a compiler may take, s: Zig builds its own C library the first time."""
_FLAGS = ("-shared", "-O2", "-std=c99", "-fvisibility=hidden")
_POSIX, _WINDOWS = ("fmu.c", "process_posix.c"), ("fmu.c", "process_windows.c")


@dataclass(frozen=True, slots=True)
class TargetPlatform:
    """A platform, by the name of its folder in an FMU.

    Attributes:
        name: Name in FMI 2.0.
        suffix: Suffix of its libraries.
        sources: Names of the files to compile.
        targets: Zig's targets; of several, one library is made.
        flags: Further flags of the compiler.

    """

    name: str
    suffix: str
    sources: tuple[str, ...]
    targets: tuple[str, ...]
    flags: tuple[str, ...] = ()


_LINUX_MACHINE = (
    platform.machine()
    if sys.platform == "linux" and platform.machine() in ("x86_64", "aarch64")
    else "x86_64"
)
PLATFORMS: Mapping[str, TargetPlatform] = {
    target.name: target
    for target in (
        # A machine on ARM calls itself linux64, too: there its own processor is the target.
        TargetPlatform(
            "linux64", ".so", _POSIX, (f"{_LINUX_MACHINE}-linux-gnu.2.17",), ("-fPIC", "-lm")
        ),
        TargetPlatform("win64", ".dll", _WINDOWS, ("x86_64-windows-gnu",)),
        TargetPlatform("darwin64", ".dylib", _POSIX, ("x86_64-macos", "aarch64-macos")),
    )
}
"""Platforms that can be compiled for, by name."""


def own_platform() -> str | None:
    """Name of this machine's platform; None where FMI 2.0 has none that can be compiled for."""
    names = {"linux": "linux64", "win32": "win64", "darwin": "darwin64"}
    return names.get(sys.platform) if sys.maxsize > 1 << 32 else None


def possible_platforms() -> list[str]:
    """Platforms that can be compiled for with what is installed.

    Raises:
        InputError: There is no compiler.

    """
    if _has_zig():
        return list(PLATFORMS)
    own_name = own_platform()
    if own_name is not None and _own_compiler() is not None:
        return [own_name]
    raise InputError("export", "there is no C compiler here", install_extra("fmu"))


def build_library(name: str) -> bytes:
    """Library for a platform, from the cache where it is there.

    Args:
        name: Name of the platform, a key of `PLATFORMS`.

    Raises:
        InputError: There is no compiler for it, or it fails.

    """
    target = PLATFORMS[name]
    compilers = _find_compilers(target)
    sources = [
        *sorted(SOURCE.glob("*.h")),
        *(SOURCE / source_name for source_name in target.sources),
    ]
    # A home may be shared by machines of several kinds.
    digest = sha256(repr((compilers, _FLAGS, target.flags, platform.machine())).encode())
    for source in sources:
        digest.update(source.read_bytes())
    cached = cache_folder() / "fmu" / f"{name}-{digest.hexdigest()[:32]}{target.suffix}"
    with suppress(OSError):  # it is not there yet, or cannot be read: it is made
        return cached.read_bytes()
    library = _compile(target, compilers)
    with suppress(OSError, InputError):  # else it is compiled again next time
        cached.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(cached, "wb", own_name=True) as file:
            file.write(library)
    return library


def cache_folder() -> Path:
    """Folder of this user's caches of this package; it may not exist."""
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or str(Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = str(Path.home() / "Library" / "Caches")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "adhesion-can"


def _has_zig() -> bool:
    return find_spec("ziglang") is not None


def _own_compiler() -> str | None:
    return shutil.which("cc")


def _find_compilers(target: TargetPlatform) -> list[list[str]]:
    """Start of the command line for each processor of a platform."""
    if _has_zig():
        zig = [sys.executable, "-m", "ziglang", "cc", "-s"]
        return [[*zig, "-target", zig_target] for zig_target in target.targets]
    compiler = _own_compiler()
    if compiler is not None and target.name == own_platform():
        return [[compiler]]
    raise InputError(
        f"--platform {target.name}", "there is no C compiler for it here", install_extra("fmu")
    )


def _compile(target: TargetPlatform, compilers: Sequence[Sequence[str]]) -> bytes:
    with TemporaryDirectory() as folder:
        libraries = []
        for number, compiler in enumerate(compilers):
            out = Path(folder) / f"{number}{target.suffix}"
            files = [str(SOURCE / name) for name in target.sources]
            words = [*compiler, *_FLAGS, *files, *target.flags, "-o", str(out)]
            _run(words, target.name, folder)
            libraries.append(out.read_bytes())
    return libraries[0] if len(libraries) == 1 else join_mach_o(libraries)


def _run(words: Sequence[str], name: str, folder: str) -> None:
    where = f"--platform {name}"
    try:
        done = subprocess.run(  # noqa: S603  the compiler of this machine, on our own files
            words,
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=LONGEST_S,
            check=False,
            stdin=subprocess.DEVNULL,
        )
    except OSError as error:
        raise InputError(where, f"the compiler: {error}", "check the compiler") from error
    except subprocess.TimeoutExpired as error:
        what = f"the compiler had not finished after {LONGEST_S:g} s"
        fix = "export again: Zig continues where it was; one --platform takes less time than all"
        raise InputError(where, what, fix) from error
    if done.returncode:
        said = done.stderr.strip().splitlines() or ["no message"]
        raise InputError(where, f"the compiler failed: {said[0]}", "check the compiler")


_FAT_MAGIC, _ALIGN_BITS = 0xCAFEBABE, 14


def join_mach_o(libraries: Sequence[bytes]) -> bytes:
    """One library of macOS for several processors, from one for each (a universal binary)."""
    align = 1 << _ALIGN_BITS
    head = struct.pack(">II", _FAT_MAGIC, len(libraries))
    place, parts = align, b""
    for library in libraries:
        processor, variant = struct.unpack_from("<II", library, 4)
        head += struct.pack(">IIIII", processor, variant, place, len(library), _ALIGN_BITS)
        padded = library + bytes(-len(library) % align)
        parts += padded
        place += len(padded)
    return head + bytes(align - len(head)) + parts
