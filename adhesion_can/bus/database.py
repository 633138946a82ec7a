"""Loading of CAN databases: the packaged one and the user's."""

import re
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

import cantools
from cantools.database import UnsupportedDatabaseFormatError  # type: ignore[attr-defined]
from cantools.database.can import Database, Message, Signal
from cantools.database.errors import Error as CantoolsError

from adhesion_can.bus.lenient_database import is_unused, load_without_faulty_messages
from adhesion_can.errors import DatabaseError, suggest
from adhesion_can.input_files import read_small_file

INPUT_MESSAGES = (
    "WheelSpeeds1", "WheelSpeeds2", "VehicleSpeed", "TractiveEffort1", "TractiveEffort2",
    "AxleLoads1", "AxleLoads2", "Environment", "TrackGeometry",
)  # fmt: skip
OUTPUT_MESSAGES = (
    "AdhesionSetpoint", "AdhesionModel", "AdhesionQuality", "AxleSetpoint", "ServiceStatus",
)  # fmt: skip

DEMAND_MESSAGES = ("EffortDemand1", "EffortDemand2")
"""Messages of a bench's creep controller to the simulated locomotive."""
SAND_DEMAND = "SandDemand"
"""Signal of the first of these messages that demands sand."""

LARGEST_FILE = 256 << 20
"""Size of a database that is read, bytes; those of whole vehicles have some 10 MiB."""
DATABASE_SUFFIXES = frozenset({".dbc", ".kcd", ".arxml", ".sym", ".cdd"})
"""Suffixes of the formats of databases."""
_GIVE_DATABASE = "give a .dbc, .kcd, .arxml or .sym file"
LONGEST_CYCLE_MS = 86_400_000
"""Longest cycle of a message, ms: a day."""


def packaged_path() -> Path:
    """Path of the packaged DBC: inside the installed package, else beside it in a source tree.

    Raises:
        DatabaseError: The file is in neither place; the installation is broken.

    """
    package = Path(__file__).resolve().parent.parent
    candidates = (package / "dbc" / "adhesion.dbc", package.parent / "dbc" / "adhesion.dbc")
    for path in candidates:
        if path.is_file():
            return path
    raise DatabaseError(str(candidates[0]), "the packaged DBC is missing", "reinstall adhesion-can")


@dataclass(frozen=True)
class CanDatabase:
    """Loaded database with its file.

    Attributes:
        path: Path of the database file.
        sha256: SHA-256 hash of the file, hex.
        db: Database as cantools parses it.
        left_out: Sentence for each message that was left out for a fault.

    """

    path: Path
    sha256: str
    db: Database
    left_out: tuple[str, ...] = ()

    def message(self, name: str) -> Message:
        """The message of that name.

        Raises:
            DatabaseError: No message has that name.

        """
        for message in self.db.messages:
            if message.name == name:
                return message
        raise DatabaseError(
            self.path.name,
            f"no message {name}",
            "pass another database with --dbc, or map the role to your message with --config",
        )

    def signal(self, message_name: str, signal_name: str, role: str) -> tuple[Message, Signal]:
        """A signal by names.

        Args:
            message_name: Name of the message.
            signal_name: Name of the signal in the message.
            role: Name of the role that needs the signal, for the error.

        Raises:
            DatabaseError: No message or signal has that name.

        """
        where = f"{self.path.name}: {message_name}.{signal_name}"
        message = next((m for m in self.db.messages if m.name == message_name), None)
        signals = message.signals if message else []
        signal = next((s for s in signals if s.name == signal_name), None)
        if message is None or signal is None:
            there = [f"{m.name}.{s.name}" for m in self.db.messages for s in m.signals]
            near = suggest(f"{message_name}.{signal_name}", there)
            raise DatabaseError(
                where,
                f"no such {'message' if message is None else 'signal'}; the role {role} needs it",
                f"{near or 'cantools dump lists what there is'}; map the role to your own "
                "Message.Signal in a file for --config",
            )
        return message, signal


def load_database(path: Path | None = None, *, lenient: bool = False) -> CanDatabase:
    """Load a database.

    Args:
        path: Path of a file of any format that cantools reads; None: the packaged DBC.
        lenient: Whether messages with a fault are left out of a DBC, and reported; else it is
            refused.

    Raises:
        DatabaseError: The file is missing or is not a database.

    """
    return _load_packaged() if path is None else _load_file(path, lenient=lenient)


@cache
def _load_packaged() -> CanDatabase:
    """The packaged DBC: it does not change while the process runs, and nobody changes it."""
    return _load_file(packaged_path())


def _load_file(path: Path, *, lenient: bool = False) -> CanDatabase:
    """A database from its file; errors as in `load_database`."""
    # It is read twice, and what a device gives may have no end: a file alone will do.
    fix = (
        f"check the path ({path.absolute()}); a path in [bus] is relative to the configuration file"
    )
    content = read_small_file(path, LARGEST_FILE, kind=DatabaseError, fix=fix)
    if path.suffix.lower() not in DATABASE_SUFFIXES:
        raise DatabaseError(str(path), "not a CAN database, judging by its name", _GIVE_DATABASE)
    require_small_ranges(_as_bytes(content), str(path))
    left_out: tuple[str, ...] = ()
    database: object
    try:
        # Not strict: real databases have overlapping signals, and the layout that we use is checked
        # signal by signal.
        if lenient and path.suffix.lower() == ".dbc":
            text = content.decode(_encoding(content) or "cp1252")
            database, left_out = load_without_faulty_messages(text)
        else:
            database = cantools.database.load_file(path, encoding=_encoding(content), strict=False)
    except (UnsupportedDatabaseFormatError, CantoolsError) as error:
        reason = " ".join(str(error).split())[:200]
        fix = _GIVE_DATABASE
        if "in message" in reason and not lenient:
            fix = "fix the message, or pass --lenient to skip it"
        if is_unused(reason) and not lenient:
            fix = "remove these statements, or pass --lenient to skip them"
        raise DatabaseError(str(path), f"not a CAN database ({reason})", fix) from error
    except (ValueError, UnicodeError, KeyError, TypeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise DatabaseError(
            str(path),
            f"not a readable CAN database ({reason})",
            "check the file with 'cantools dump'",
        ) from error
    if not isinstance(database, Database):
        raise DatabaseError(str(path), "a diagnostics database, not a CAN database", "give a .dbc")
    _require_messages(database, path)
    return CanDatabase(path, sha256(content).hexdigest(), database, left_out)


def database_with(names: Collection[str], database: CanDatabase) -> CanDatabase:
    """The user's database where it defines all of these messages, else the packaged one."""
    present = {message.name for message in database.db.messages}
    return database if present.issuperset(names) else load_database()


def _require_messages(db: Database, path: Path) -> None:
    """DatabaseError where a message has no name, or an id or a length below 0.

    cantools lets pass both, and columns are called by the names.
    """
    for message in db.messages:
        where = f"{path}: message {message.frame_id:#x}"
        if not _is_name(message.name):
            raise DatabaseError(where, "has no name", "give it one in the database")
        if not all(_is_name(signal.name) for signal in message.signals):
            raise DatabaseError(where, "has a signal without a name", "give it one in the database")
        for what, number in (("id", message.frame_id), ("length", message.length)):
            if number < 0:
                raise DatabaseError(
                    f"{path}: {message.name}", f"its {what} is {number}", "write 0 or more"
                )


def _is_name(name: str | None) -> bool:
    return bool(name and name.strip())


def _encoding(content: bytes) -> str | None:
    """Encoding of a database; None: the one of its format, which is cp1252 for most.

    Text of that encoding with other letters than ASCII's is hardly ever UTF-8 by chance.
    """
    if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return "utf-16"
    if content.isascii() or content.removeprefix(BOM_UTF8).lstrip().startswith(b"<"):
        return None  # XML declares its own
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return None
    return "utf-8-sig"


def _as_bytes(content: bytes) -> bytes:
    """A database's content with ASCII's letters as single bytes."""
    if _encoding(content) != "utf-16":
        return content
    return content.decode("utf-16", errors="replace").encode()


def e2e_data_id(message: Message) -> int | None:
    """Attribute E2EDataId of a message; None where the database has none.

    Raises:
        DatabaseError: The attribute is no number from 0 to 65535.

    """
    attribute = message.dbc.attributes.get("E2EDataId") if message.dbc else None
    if attribute is None:
        return None
    try:
        number = int(attribute.value)
    except (ValueError, OverflowError):
        number = -1
    if isinstance(attribute.value, float) and number != attribute.value:
        number = -1
    if not 0 <= number <= 0xFFFF:
        raise DatabaseError(
            f"{message.name}: E2EDataId",
            f"{attribute.value!r} is not a data id",
            "write 0 to 65535",
        )
    return number


def cycle_us(message: Message) -> int | None:
    """Cycle of a message, µs; None where the database states none from 1 µs to a day."""
    cycle_ms: object = message.cycle_time  # of the type that the attribute has
    if not isinstance(cycle_ms, int | float) or not 0 < cycle_ms <= LONGEST_CYCLE_MS:
        return None
    return round(cycle_ms * 1000) or None


MOST_SELECTORS = 1 << 20
"""Most values of multiplexers in all ranges of a DBC; each takes some 40 bytes."""
MOST_IDS = 1 << 16
"""Most identifiers in all ranges of a .sym file; each is a message of its own."""
_NO_STATEMENT = re.compile(rb'"(?:\\"|[^"])*?"|//[^\n]*\n')
"""Strings and comments, in which a keyword is none."""
_SELECTORS = re.compile(
    rb"SG_MUL_VAL_(?!\w)\s*[-+]?\d[\d.eE+-]*\s*[A-Za-z_]\w*\s+\w+(?P<ranges>[^;]*)", re.ASCII
)
"""`SG_MUL_VAL_ 256 Signal Selector 1-3, 5-5;`: the bare keyword is in the list NS_ as well."""
_NUMBER = re.compile(rb"[-+]?\d+")
_LONGEST_NUMBER = 30
"""Most digits of a number whose value is looked at."""
_ID_RANGE = re.compile(rb"\bID\s*=\s*([0-9A-Fa-f]{1,16})h\s*\S([0-9A-Fa-f]{1,64})h")


def require_small_ranges(content: bytes, where: str) -> None:
    """Refuse a database whose ranges would fill the memory.

    Args:
        content: Content of a file of any format.
        where: Path of the file, for the error.

    Raises:
        DatabaseError: The ranges of multiplexer values (DBC) or identifiers (.sym) are too wide.

    """
    for what, counts, most in (
        ("of multiplexer values (SG_MUL_VAL_)", _selectors(content), MOST_SELECTORS),
        ("of identifiers (ID=)", _identifiers(content), MOST_IDS),
    ):
        numbers = sum(max(count, 0) for count in counts)
        if numbers > most:
            raise DatabaseError(
                where, f"ranges {what} contain {numbers} numbers", f"write at most {most} in all"
            )


def _selectors(content: bytes) -> Iterator[int]:
    """Number of values of each range of a DBC's statements `SG_MUL_VAL_`."""
    if b"SG_MUL_VAL_" not in content:
        return
    for statement in _SELECTORS.finditer(_NO_STATEMENT.sub(b" ", content)):
        numbers = _NUMBER.findall(statement["ranges"])
        for first, last in zip(numbers[::2], numbers[1::2], strict=False):
            if max(len(first), len(last)) > _LONGEST_NUMBER:
                yield MOST_SELECTORS + 1
            else:
                yield int(last[1:] or b"0") - int(first) + 1  # the first character is the dash


def _identifiers(content: bytes) -> Iterator[int]:
    """Number of identifiers of each range of a .sym file, as in `ID=100h-10Fh`."""
    for first, last in _ID_RANGE.findall(content):
        yield int(last, 16) - int(first, 16) + 1
