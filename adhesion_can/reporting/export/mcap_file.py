"""MCAP: a channel a message and bus, in JSON with a schema each, and the frames as they came."""

import json
from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer

from adhesion_can.bus.block import EXTENDED, Block, Kind
from adhesion_can.files import OutputFile
from adhesion_can.reporting.export.layout import Field, Frames, Group, GroupRows, Sink
from adhesion_can.reporting.export.number_texts import FloatTexts
from adhesion_can.version import __version__

_SCHEMA = "jsonschema"
_CHUNK = 1 << 20

_Message = tuple[int, int, bytes]  # channel, stamp in ns, document
_NOTHING: _Message = (0, 0, b"")

FRAME_SCHEMA = "can.Frame"
"""Name of the schema of frames; its fields are named as in ROS' can_msgs/msg/Frame."""

_FRAME_FIELDS = {
    "id": {"type": "integer", "description": "arbitration id"},
    "is_extended": {"type": "boolean", "description": "id of 29 bits"},
    "is_rtr": {"type": "boolean", "description": "remote request"},
    "is_error": {"type": "boolean", "description": "error frame"},
    "is_fd": {"type": "boolean", "description": "CAN FD"},
    "dlc": {"type": "integer", "description": "length of data [byte]"},
    "data": {"type": "string", "contentEncoding": "base64", "description": "payload"},
}


class McapFile(Sink):
    """Writes each message on the topic /BUS/MESSAGE, and all frames of a bus on /frames/BUS.

    Args:
        path: Path of the finished file.
        origin: Version, inputs and the like, by name, for the metadata record 'origin'.

    """

    def __init__(self, path: Path, origin: Mapping[str, str]) -> None:
        self._out = OutputFile(path, random_access=True)
        self._writer: Any = Writer(self._out.file, _CHUNK, CompressionType.ZSTD)
        self._writer.start(library=f"adhesion-can {__version__}")
        self._writer.add_metadata("origin", dict(origin))
        self._channel: dict[tuple[str, str], int] = {}
        self._frame_schema: int | None = None
        self._early = 0
        self._texts = FloatTexts("null")

    def write(self, rows: Sequence[GroupRows], frames: Frames | None = None) -> None:
        """Append rows, and the frames behind them."""
        messages: list[_Message] = [_NOTHING] * sum(len(part.t_ns) for part in rows)
        for part in rows:
            channel = self._message_channel(part.group)
            documents = _documents(part, self._texts)
            places, stamps = part.position.tolist(), part.t_ns.tolist()
            for place, t_ns, document in zip(places, stamps, documents, strict=True):
                messages[place] = channel, t_ns, document
        if frames is None:
            for message in messages:
                self._add(*message)
            return
        decoded = iter(zip(frames.place.tolist(), messages, strict=True))
        place, following = next(decoded, (-1, _NOTHING))
        for row, frame in self._frames(frames.block):
            self._add(*frame)
            if row == place:
                self._add(*following)
                place, following = next(decoded, (-1, _NOTHING))

    def problems(self) -> list[str]:
        """Sentence about stamps that the format does not have."""
        return [f"{self._early} stamps before 1970 are written as 1970"] if self._early else []

    def close(self) -> None:
        """Finish the file, which then gets its name."""
        self._writer.finish()
        self._out.finish()

    def abandon(self) -> None:
        """Delete what has been written so far."""
        self._out.abandon()

    def _add(self, channel: int, t_ns: int, data: bytes) -> None:
        if t_ns < 0:
            t_ns, self._early = 0, self._early + 1
        self._writer.add_message(channel, t_ns, data, t_ns)

    def _message_channel(self, group: Group) -> int:
        key = group.channel, group.name
        if key not in self._channel:
            schema = self._writer.register_schema(group.name, _SCHEMA, message_schema(group))
            topic = "/".join(("", *filter(None, key)))
            self._channel[key] = self._writer.register_channel(topic, "json", schema)
        return self._channel[key]

    def _frame_channel(self, channel: str) -> int:
        key = channel, ""
        if key not in self._channel:
            if self._frame_schema is None:
                schema = _object(FRAME_SCHEMA, "CAN frame as it was recorded", _FRAME_FIELDS)
                self._frame_schema = self._writer.register_schema(FRAME_SCHEMA, _SCHEMA, schema)
            topic = "/".join(("/frames", *filter(None, (channel,))))
            self._channel[key] = self._writer.register_channel(topic, "json", self._frame_schema)
        return self._channel[key]

    def _frames(self, block: Block) -> Iterator[tuple[int, _Message]]:
        """(row, message) of each frame of a block, without marks."""
        is_frame = block.kind <= Kind.ERROR
        rows = np.flatnonzero(is_frame)
        part = block if len(rows) == len(block) else block.select(rows)
        numbers = [
            self._frame_channel(name) if (part.channel == place).any() else 0
            for place, name in enumerate(part.channels)
        ]
        payload, width = part.payload.tobytes(), part.payload.shape[1]
        heads: dict[tuple[int, int, int], bytes] = {}
        columns = (rows, part.t_ns, part.channel, part.key, part.kind, part.length)
        for number, (row, t_ns, bus, *what) in enumerate(
            zip(*(column.tolist() for column in columns), strict=True)
        ):
            key = tuple(what)
            if key not in heads:
                heads[key] = _frame_head(*key)
            begin = number * width
            data = b64encode(payload[begin : begin + key[2]])
            yield row, (numbers[bus], t_ns, b'%b"%b"}' % (heads[key], data))


def _frame_head(key: int, kind: int, length: int) -> bytes:
    """Document of a frame up to its payload."""
    is_error = kind == Kind.ERROR
    head = {
        "id": key & ~EXTENDED,
        "is_extended": bool(key & EXTENDED) and not is_error,
        "is_rtr": kind == Kind.REMOTE,
        "is_error": is_error,
        "is_fd": kind == Kind.FD,
        "dlc": length,
        "data": "",
    }
    return json.dumps(head, separators=(",", ":")).encode().removesuffix(b'""}')


def _documents(rows: GroupRows, texts: FloatTexts) -> list[bytes]:
    """A document a row, with the fields that the row has."""
    names = [json.dumps(field.name, ensure_ascii=False) for field in rows.group.fields]
    cells = [
        texts.of(column.values)
        if field.dtype.kind == "f"
        else list(map(str, column.values.tolist()))
        for field, column in zip(rows.group.fields, rows.columns, strict=True)
    ]
    masks = [column.missing for column in rows.columns]
    if all(mask is None for mask in masks):
        template = _template(names)
        return [(template % row).encode() for row in zip(*cells, strict=True)]
    # The pages of a multiplexer are few.
    whole = np.zeros(len(rows.t_ns), dtype=np.bool_)
    missing = np.stack([whole if mask is None else mask for mask in masks], axis=1)
    pages, page = np.unique(missing, axis=0, return_inverse=True)
    documents = np.empty(len(rows.t_ns), dtype=object)
    for number, lacks in enumerate(pages):
        here = np.flatnonzero(page.ravel() == number)
        held = np.flatnonzero(~lacks).tolist()
        template = _template([names[place] for place in held])
        parts = [[cells[place][row] for row in here.tolist()] for place in held]
        written = [(template % row).encode() for row in zip(*parts, strict=True)]
        documents[here] = written or [b"{}"] * len(here)
    return documents.tolist()


def _template(names: Sequence[str]) -> str:
    fields = ",".join(name.replace("%", "%%") + ":%s" for name in names)
    return f"{{{fields}}}"


def message_schema(group: Group) -> bytes:
    """JSON schema of a message, with comments, units and the names of values."""
    fields = {field.name: _property(field) for field in group.fields}
    return _object(group.name, group.comment, fields)


def _object(title: str, description: str, fields: Mapping[str, Any]) -> bytes:
    schema = {"title": title, "description": description, "type": "object", "properties": fields}
    return json.dumps(schema, ensure_ascii=False).encode()


def _property(field: Field) -> dict[str, str]:
    kind = "number" if field.dtype.kind == "f" else "integer"
    unit = f"[{field.unit}]" if field.unit not in ("", "-") else ""
    named = ", ".join(f"{number} = {text}" for number, text in sorted(field.names.items()))
    description = "; ".join(filter(None, (f"{field.comment} {unit}".strip(), named)))
    return {"type": kind, "description": description} if description else {"type": kind}


def open_sink(
    path: Path, origin: Mapping[str, str], _groups: Sequence[Group], _decimals: int
) -> McapFile:
    """Start an MCAP file."""
    return McapFile(path, origin)
