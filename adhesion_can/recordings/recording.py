"""Recordings of any format as frames and as blocks of frames."""

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from itertools import islice
from pathlib import Path

import can

from adhesion_can.bus.block import Block
from adhesion_can.bus.frame import Frame, Mark
from adhesion_can.errors import RecordingError
from adhesion_can.extras import install_extra
from adhesion_can.input_files import file_sha256
from adhesion_can.recordings.candump import (
    DIFFERENCES,
    HEAD_LINES,
    ReadReport,
    frame_kind,
    read_candump,
    times_are_differences,
)
from adhesion_can.recordings.formats import (
    CANDUMP,
    COLUMNS,
    FORMAT_NAMES,
    FRAME_TABLE,
    HEAD,
    MF4,
    SQLITE,
    detect_format,
    is_misnamed,
)
from adhesion_can.recordings.frame_rows import join_blocks
from adhesion_can.recordings.limited import LimitError, read_limited
from adhesion_can.recordings.limited_work import Limits
from adhesion_can.recordings.mf4_links import require_sound_links
from adhesion_can.recordings.python_can_messages import from_message
from adhesion_can.recordings.python_can_readers import (
    collect_python_can_warnings,
    open_reader,
    position_of,
    require_valid,
)
from adhesion_can.recordings.sqlite_frames import read_sqlite
from adhesion_can.recordings.text_columns.candump_form import CandumpForm
from adhesion_can.recordings.text_columns.parse import read_text
from adhesion_can.recordings.text_columns.text_source import LINE_LIMIT, Packing, TextSource

_CHUNK = 1 << 20  # columns of so much text stay in a core's cache
_ROWS = 50_000  # of a block of a format that is read frame by frame
_MF4_FIX = "write it again with the tool that made it, or export its frames as candump text"

_Read = tuple[Block, int, ReadReport]
"""Block, with the position and the report behind it."""


class Recording:
    """A file of frames.

    Args:
        path: Path of candump text, .asc, .blf or .trc (gzip and zstd too), or of any other format
            that python-can reads by its suffix.

    Raises:
        RecordingError: The file is missing, no file but a pipe, or of no known format.

    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.report = ReadReport()
        """Statistics, filled while the frames are read."""
        self.position = 0
        """Number of bytes of the file, as stored, behind the blocks given so far."""
        self._reader: can.io.generic.MessageReader | None = None
        if str(path) == "-":
            raise RecordingError(
                "-",
                "standard input cannot be read: a recording is read twice",
                "write it to a file",
            )
        try:
            if path.exists() and not (path.is_file() or path.is_dir()):
                # It is read several times: for its format, its frames and its hash.
                raise RecordingError(
                    str(path), "is a pipe or a device, not a file", "write it to a file first"
                )
            with path.open("rb") as file:
                self._packing = Packing.from_head(file.read(4))
        except OSError as error:
            raise RecordingError(
                str(path), error.strerror or "cannot be read", "check the path"
            ) from error
        self._format = detect_format(path, self._head())
        if is_misnamed(path, self._format):
            self.report.remarks.append(f"{FORMAT_NAMES[self._format]}, judging by its content")
        if self._packing is Packing.ZSTD and self._format not in (CANDUMP, FRAME_TABLE, *COLUMNS):
            raise RecordingError(
                str(path), "python-can reads no zstd", "unpack it with 'zstd -d', or use gzip"
            )

    def __iter__(self) -> Iterator[Frame | Mark]:
        """Frames in the order of the file."""
        if self._format == CANDUMP:
            with self._source(self.report) as source:
                yield from read_candump(source.lines(), self.report)
        elif self._format in COLUMNS:
            for block in self._column_blocks(_CHUNK):
                yield from block.items()
        elif self._format == MF4:
            for block in self._limited(_mf4_columns):
                yield from block.items()
        else:
            yield from self._python_can()

    @property
    def kind(self) -> str:
        """What the file is, in words."""
        return FORMAT_NAMES[self._format]

    @property
    def head_date_us(self) -> int | None:
        """Date in the head of a file whose stamps count from it, µs since 1970; None without one.

        The clock has no zone.
        """
        if self._format != ".asc":
            return None
        from adhesion_can.recordings.text_columns.asc import head_date_us  # noqa: PLC0415

        return head_date_us(self._first_lines())

    @property
    def sha256(self) -> str:
        """SHA-256 hash of the file, hex."""
        return file_sha256(self.path)

    @property
    def size(self) -> int:
        """Size of the file, bytes."""
        return self.path.stat().st_size

    def blocks(self, size: int = 4 * _CHUNK) -> Iterator[Block]:
        """Frames and marks in columns: as by iterating, many times as fast, in little memory.

        The channels of each block start with those of the one before. `report` and `position` are
        those of the blocks given so far.

        Args:
            size: Number of bytes of text in a block, to within a line.

        Raises:
            RecordingError: The file cannot be read to its end; blocks in front of the fault are
                given first.

        """
        self.position = 0
        if self._format == CANDUMP:
            yield from self._candump_blocks(size)
        elif self._format in COLUMNS:
            yield from self._column_blocks(size)
        elif self._format == MF4:
            yield from self._limited(_mf4_columns)
        else:
            yield from self.python_can_blocks()
        self.position = self.size

    def comments(self) -> Iterator[bytes]:
        """Whole lines of candump text that begin with '#'; other formats have none."""
        if self._format != CANDUMP:
            return
        with self._source(ReadReport()) as source:
            yield from source.comments(_CHUNK)

    def _source(self, report: ReadReport) -> TextSource:
        return TextSource(self.path, self._packing, report)

    def _head(self) -> bytes:
        """First bytes, unpacked; none where they cannot be unpacked: reading raises the error."""
        try:
            with self._source(ReadReport()) as source:
                return source.head(HEAD)
        except OSError:
            return b""

    def _candump_blocks(self, size: int) -> Iterator[Block]:
        with self._source(ReadReport()) as source:
            differences = times_are_differences(islice(source.lines(), HEAD_LINES))
        if differences:
            self.report.notes.insert(0, DIFFERENCES)
        with self._source(self.report) as source:
            chunks = source.chunks(min(size, _CHUNK))
            blocks = read_text(chunks, CandumpForm(differences=differences), self.report)
            for block, self.position in join_blocks(blocks, size // _CHUNK):
                yield block

    def _column_blocks(self, size: int) -> Iterator[Block]:
        """Blocks of the formats in `COLUMNS`."""
        # Imported here: most recordings are of other formats.
        from adhesion_can.recordings.blf_columns.read import read_blf  # noqa: PLC0415
        from adhesion_can.recordings.text_columns.asc import AscForm  # noqa: PLC0415
        from adhesion_can.recordings.text_columns.trc import TrcForm  # noqa: PLC0415

        with (
            collect_python_can_warnings(self.report.notes),
            self._source(self.report) as source,
        ):
            placed_blocks: Iterator[tuple[Block, int]]
            try:
                if self._format == ".blf":
                    plain = self.size if self._packing is Packing.NONE else None
                    blocks = read_blf(source.read, self.report, plain, min(size, _CHUNK))
                    placed_blocks = ((block, source.position) for block in blocks)
                else:
                    form = {".asc": AscForm, ".trc": TrcForm}[self._format](self._first_lines())
                    placed_blocks = read_text(source.chunks(min(size, _CHUNK)), form, self.report)
            except Exception as error:  # of a head; python-can's parsers raise whatever they meet
                raise RecordingError(
                    str(self.path),
                    f"its header cannot be read ({_reason(error)})",
                    "record or export it again",
                ) from error
            for block, self.position in join_blocks(placed_blocks, size // _CHUNK):
                yield block

    def _first_lines(self) -> list[bytes]:
        with self._source(ReadReport()) as source:
            lines = list(islice(source.lines(), HEAD_LINES))
        first = lines[0] if lines else b""
        if len(first) == LINE_LIMIT and b"\r" in first:
            raise ValueError("its lines do not end with a line feed")
        return [piece for line in lines for piece in line.splitlines(keepends=True)]

    def _limited(self, work: Callable[[Path], Iterator[_Read]]) -> Iterator[Block]:
        """Blocks that a process of its own reads.

        Args:
            work: Function from the path to blocks, each with the position and the report behind it.

        """
        blocks = read_limited(partial(work, self.path), Limits.of_file(self.size), "asammdf")
        with closing(blocks):
            try:
                for block, self.position, report in blocks:
                    self.report.take(report)
                    if len(block):
                        yield block
            except LimitError as error:
                raise RecordingError(str(self.path), str(error), _MF4_FIX) from error

    def mf4_blocks(self) -> Iterator[Block]:
        """Blocks of a file of MF4, read in this process."""
        if self._packing is not Packing.NONE:
            yield from self.python_can_blocks()
            return
        # Imported here: most recordings are of other formats.
        from adhesion_can.recordings.mf4 import (  # noqa: PLC0415
            NotInColumnsError,
            mf4_blocks,
            open_mf4,
        )

        given = 0
        channels: tuple[str, ...] = ()
        try:
            mdf = open_mf4(self.path)
        except Exception as error:
            raise self._reader_error(error) from error
        with closing(mdf):
            try:
                for block, share in mf4_blocks(mdf, self.report, _ROWS):
                    given, channels = given + len(block), block.channels
                    self.position = int(share * self.size)
                    yield block
            except NotInColumnsError as error:
                self.report.notes.append(f"read frame by frame: {error}")
            else:
                return
        # Slower, and the same frames: python-can's reader knows more layouts, and its errors name
        # what is wrong with a file.
        yield from self.python_can_blocks(given, channels)

    def python_can_blocks(self, given: int = 0, channels: tuple[str, ...] = ()) -> Iterator[Block]:
        """Blocks of the frames behind those that were given, which were on these channels.

        They are read in this process by python-can.
        """
        frames = self._python_can(given)
        stopped: RecordingError | None = None
        while not stopped:
            rows: list[Frame] = []
            try:
                rows.extend(islice(frames, _ROWS))
            except RecordingError as error:
                stopped = error  # raised when what came before it is given
            if not rows:
                break
            block = Block.from_frames(rows, channels)
            channels = block.channels
            self.position = position_of(self._reader)
            yield block
        if stopped:
            raise stopped

    def _python_can(self, given: int = 0) -> Iterator[Frame]:
        # python-can's readers stop at what they cannot read, with whatever their parser raises;
        # what was read until then is kept and the rest is reported.
        last = count = 0
        try:
            with self._opened() as frames:
                for frame in frames:
                    require_valid(frame)
                    count += 1
                    if count > given:
                        self.report.kinds[frame_kind(frame)] += 1
                        self.report.backwards += frame.t_us < last
                        yield frame
                    last = frame.t_us
        except RecordingError:
            raise
        except Exception as error:
            raise self._reader_error(error) from error

    @contextmanager
    def _opened(self) -> Iterator[Iterator[Frame]]:
        """Frames one by one, of a file that is closed behind them."""
        if self._format == FRAME_TABLE:
            with self._frame_table() as frames:
                yield frames
            return
        if self._format == SQLITE and self._packing is Packing.NONE:
            with closing(read_sqlite(self.path)) as frames:
                yield frames
            return
        if self._format == MF4 and self._packing is Packing.NONE:
            require_sound_links(self.path)
        with (
            collect_python_can_warnings(self.report.notes),
            open_reader(self.path, self._format, self._packing) as self._reader,
        ):
            yield map(from_message, self._reader)

    @contextmanager
    def _frame_table(self) -> Iterator[Iterator[Frame]]:
        """Frames of a log of another tool."""
        # Imported here: most recordings are of other formats.
        from adhesion_can.recordings.frame_tables.forms import find_form  # noqa: PLC0415
        from adhesion_can.recordings.frame_tables.read import read_frame_table  # noqa: PLC0415

        with self._source(ReadReport()) as source:
            head = source.head(HEAD)
        form = find_form(head.splitlines()[:HEAD_LINES])
        if form is None or not form.has_times:
            raise RecordingError(
                str(self.path), "a table of frames without their times", "export it with them"
            )
        with self._source(self.report) as source:
            yield read_frame_table(source.lines(), form, self.report)

    def _reader_error(self, error: Exception) -> RecordingError:
        """Error for the user, of any exception of a parser, struct.error too."""
        if isinstance(error, NotImplementedError | ImportError):
            return RecordingError(str(self.path), "this format needs asammdf", install_extra("mf4"))
        who = "reading" if self._format == SQLITE else "python-can"
        return RecordingError(
            str(self.path),
            f"{who} stops after {sum(self.report.kinds.values())} frames ({_reason(error)})",
            "convert the file to candump text, where bad lines are skipped",
        )


def _mf4_columns(path: Path) -> Iterator[_Read]:
    recording = Recording(path)
    return _with_report(recording, recording.mf4_blocks())


def _with_report(recording: Recording, blocks: Iterator[Block]) -> Iterator[_Read]:
    """Blocks, each with the position and the report behind it; no rows for those of the end."""
    stopped: RecordingError | None = None
    try:
        for block in blocks:
            yield block, recording.position, recording.report
    except RecordingError as error:
        stopped = error  # raised when the report has what was noted of it
    yield Block.from_frames([]), recording.position, recording.report
    if stopped:
        raise stopped


def _reason(error: Exception) -> str:
    """Text of an error on one line, of any length that can be read."""
    return " ".join(str(error).split())[:120] or type(error).__name__
