"""Files on this machine or behind an URL, by fsspec."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from shutil import disk_usage
from tempfile import TemporaryDirectory
from typing import Any

import fsspec

from adhesion_can.errors import InputError
from adhesion_can.extras import install_package
from adhesion_can.input_files import file_sha256

_PACKAGES = {"s3": "s3fs", "s3a": "s3fs", "gs": "gcsfs", "gcs": "gcsfs", "abfs": "adlfs",
             "az": "adlfs", "http": "aiohttp", "https": "aiohttp", "hdfs": "pyarrow"}  # fmt: skip
"""Package that a scheme of URLs needs."""


def is_url(text: str) -> bool:
    """Whether a text is an URL rather than a path."""
    return "://" in text


@dataclass(frozen=True, slots=True)
class Place:
    """A path within a file system.

    Attributes:
        system: File system of fsspec.
        inner: Path as the file system has it.
        given: Path or URL as it was given.

    """

    system: Any
    inner: str
    given: str

    @property
    def is_local(self) -> bool:
        """Whether it is on this machine."""
        protocol = self.system.protocol
        return "file" in ((protocol,) if isinstance(protocol, str) else protocol)

    @property
    def name(self) -> str:
        """Absolute path, or URL."""
        return self.full(self.inner)

    def full(self, inner: str) -> str:
        """Absolute path, or URL, of a path of the file system."""
        return inner if self.is_local else str(self.system.unstrip_protocol(inner))

    def info(self) -> Mapping[str, Any] | None:
        """What the file system says of it; None where it is not there."""
        with self.errors():
            try:
                return self._with_time(self.system.info(self.inner))
            except FileNotFoundError:
                return None

    def files(self, *, pattern: bool = False) -> Iterator[tuple[str, Mapping[str, Any]]]:
        """Names of all files below, or that fit the pattern, with what the file system says."""
        search = self.system.glob if pattern else self.system.find
        with self.errors():
            infos = search(self.inner, detail=True)
        for name, info in infos.items():
            if info["type"] != "directory":
                yield self.full(name), self._with_time(info)

    def _with_time(self, info: Mapping[str, Any]) -> Mapping[str, Any]:
        """With the time of the last change in ns: as a float of seconds it is not exact."""
        if self.is_local:
            return {**info, "mtime": Path(info["name"]).stat().st_mtime_ns}
        return info

    @contextmanager
    def errors(self) -> Iterator[None]:
        """What a server answers becomes an InputError."""
        try:
            yield
        except InputError:
            raise
        # Each file system has errors of its own, of libraries that may not be installed.
        except Exception as error:
            reason = " ".join(str(error).split())[:200] or type(error).__name__
            fix = "check URL, network and credentials" if not self.is_local else "check the path"
            raise InputError(self.given, f"cannot be read ({reason})", fix) from error

    @contextmanager
    def fetched(self) -> Iterator[tuple[Path, str]]:
        """The file on this machine, and its hash; what was fetched for it is removed again.

        Raises:
            InputError: It cannot be read, or the disk has no room for it.

        """
        if self.is_local:
            path = Path(self.inner)
            with self.errors():
                digest = file_sha256(path)
            yield path, digest
            return
        with TemporaryDirectory(prefix="adhesion-can-") as folder:
            path = Path(folder) / (self.inner.rstrip("/").rsplit("/", 1)[-1] or "recording")
            with self.errors():
                self._require_room(path.parent)
                # In a stream: `open` asks for ranges, which not all servers give.
                self.system.get_file(self.inner, str(path))
            yield path, file_sha256(path)

    def _require_room(self, folder: Path) -> None:
        size = self.system.info(self.inner).get("size")
        if size is not None and size > disk_usage(folder).free:
            what = f"its {size / 1e9:.1f} GB do not fit into {folder.parent}"
            raise InputError(self.given, what, "make room, or set TMPDIR to another disk")


def open_place(given: str) -> Place:
    """File or folder of a path or an URL.

    Raises:
        InputError: The scheme is unknown, or its package is not installed.

    """
    scheme = given.partition("://")[0] if is_url(given) else ""
    try:
        system, inner = fsspec.core.url_to_fs(given)
    except ImportError as error:
        package = _PACKAGES.get(scheme, error.name or "its package")
        fix = install_package(package)
        raise InputError(given, f"{scheme}:// needs another package", fix) from error
    except ValueError as error:
        known = ", ".join(sorted(set(_PACKAGES)))
        raise InputError(
            given, f"no file system {scheme}:// is known", f"such as {known}"
        ) from error
    system.invalidate_cache()  # of listings: other workers write, too
    return Place(system, inner, given)
