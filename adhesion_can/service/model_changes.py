"""Changes of the extended model while a service runs, and their lines in its log."""

import base64
import binascii
import re
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from adhesion_can.config.model_file import model_text, parse_model
from adhesion_can.errors import RecordingError
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.printable import printable

_LINE = re.compile(rb"#(\d{1,15})\.(\d{6})# adhesion-can-model:(\S+) 000#\s*$")
_NAME = b" adhesion-can-model:"
_NONE = b"-"
_LONGEST = 1 << 16
"""Most bytes of a model's text: more is none that a service wrote."""


@dataclass(frozen=True, slots=True)
class ModelChange:
    """A model that the service is to use from a time on.

    Attributes:
        t_us: Time from which it runs beside the one in use, µs.
        model: The model; None: the plain estimator again, at once.

    """

    t_us: int
    model: ExtendedModel | None

    def to_line(self) -> str:
        """A line for the service's log: a comment to candump's readers.

        python-can's, which knows no comments, reads an empty frame.
        """
        seconds, micros = divmod(self.t_us, 1_000_000)
        packed = _NONE if self.model is None else _packed(model_text(self.model))
        return f"#{seconds}.{micros:06d}#{_NAME.decode()}{packed.decode()} 000#\n"


def read_model_changes(comments: Iterable[bytes], where: str) -> Iterator[ModelChange]:
    """Changes of the model that a service wrote into its log.

    Args:
        comments: Comment lines of the log, or all its lines.
        where: Name of the log, for errors.

    Raises:
        RecordingError: A line is damaged: without its model the log cannot be replayed.

    """
    for line in comments:
        if _NAME in line[:60]:
            try:
                yield _parse(line, where)
            except ValueError as error:
                raise RecordingError(
                    where,
                    f"the model to which the service changed is damaged ({error}): "
                    f"{printable(line[:50].decode('latin-1'))}",
                    "copy the log again, or replay the part before that line with --to",
                ) from error


def _parse(line: bytes, where: str) -> ModelChange:
    """Change that a line holds; ValueError, which a ConfigError is not, where it is damaged."""
    match = _LINE.match(line)
    if match is None:
        raise ValueError("no time and model")
    t_us = int(match[1]) * 1_000_000 + int(match[2])
    model = None if match[3] == _NONE else parse_model(_unpacked(match[3]), f"{where}: its model")
    return ModelChange(t_us, model)


def _packed(text: str) -> bytes:
    return base64.b64encode(zlib.compress(text.encode(), 9))


def _unpacked(packed: bytes) -> str:
    """Text of a packed model; ValueError where it is damaged."""
    try:
        unpack = zlib.decompressobj()
        text = unpack.decompress(base64.b64decode(packed, validate=True), _LONGEST)
    except (binascii.Error, zlib.error) as error:
        raise ValueError(str(error)) from error
    if not unpack.eof:
        raise ValueError("it is cut off")
    return text.decode()
