"""Changes of the extended model while a service runs, and their comments in its log."""

import base64
import binascii
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from adhesion_can.config.model_file import model_text, parse_model
from adhesion_can.errors import RecordingError
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.printable import printable
from adhesion_can.service.log_comments import format_comment, format_stamp, read_comments

_NAME = "adhesion-can-model"
_NONE = b"-"
_LONGEST = 1 << 16
"""Largest size of a model's text, bytes; a service writes none that is larger."""


@dataclass(frozen=True, slots=True)
class ModelChange:
    """A model that the service is to use from a time on.

    Attributes:
        t_us: Time from which it runs beside the one in use, µs.
        model: The model; None: the plain estimator again, at once.

    """

    t_us: int
    model: ExtendedModel | None

    def to_lines(self) -> str:
        """A comment of one or more lines for the service's log."""
        packed = _NONE if self.model is None else _packed(model_text(self.model))
        return format_comment(format_stamp(self.t_us), _NAME, packed.decode())


def read_model_changes(comments: Iterable[bytes], where: str) -> Iterator[ModelChange]:
    """Changes of the model that a service wrote into its log.

    Args:
        comments: Comment lines of the log, or all its lines.
        where: Name of the log, for errors.

    Raises:
        RecordingError: A change is damaged: without its model the log cannot be replayed.

    """
    try:
        for comment in read_comments(comments, _NAME):
            yield ModelChange(comment.t_us, _model(comment.text, where))
    except ValueError as error:
        raise RecordingError(
            where,
            f"a model to which the service changed is damaged: {printable(str(error))}",
            "copy the log again, or delete that line: behind it other setpoints come out",
        ) from error


def _model(packed: bytes, where: str) -> ExtendedModel | None:
    """Model that a comment holds; ValueError, which a ConfigError is not, where it is damaged."""
    return None if packed == _NONE else parse_model(_unpacked(packed), f"{where}: its model")


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
