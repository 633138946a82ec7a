"""The messages of the packaged database, signal by signal."""

from cantools.database.can import Message, Signal

from adhesion_can.bus.database import INPUT_MESSAGES, OUTPUT_MESSAGES, load_database
from reference_pages.markdown import GENERATED, code, page, plain, table

INTRODUCTION = """
Classic CAN of {rate} kbit/s, 11-bit ids, little-endian signals, 8 bytes a message. Value = raw ·
factor + offset; bits that are not named are 0. The database is
[dbc/adhesion.dbc](../../dbc/adhesion.dbc); in an installed package it is
`adhesion_can/dbc/adhesion.dbc`, which `python -c "from adhesion_can.bus.database import
packaged_path; print(packaged_path())"` prints in full.

Every message starts with `Crc` (0|8) and `Alive` (8|4) of AUTOSAR E2E profile 1: CRC-8, polynomial
0x1D, start value 0x00, no final xor, over the low and the high byte of the data id and bytes 1 to
7; `Alive` counts 0 to 14, one sequence a message. The data id is the attribute `E2EDataId`, equal
to the id of the message.

**Not available** is all ones in the raw value (0x7FFF where the signal is signed), for every signal
of 8 bits or more. Test the raw value before you scale it.
"""
HEAD = ("signal", "start, length", "factor", "offset", "range", "unit", "meaning")


def messages_page() -> str:
    """Every message of the packaged database."""
    database = load_database().db
    rate = int(database.dbc.attributes["Baudrate"].value) // 1000  # type: ignore[union-attr]
    overview = [
        [
            f"0x{m.frame_id:03X}",
            f"[`{m.name}`](#{m.name.lower()})",
            f"{m.cycle_time} ms",
            ", ".join(m.senders),
            plain(m.comment),
        ]
        for m in database.messages
    ]
    parts = [
        "# Messages",
        GENERATED,
        INTRODUCTION.format(rate=rate),
        table(["id", "message", "cycle", "from", "content"], overview),
    ]
    for message in database.messages:
        signals = [s for s in message.signals if s.name not in ("Crc", "Alive")]
        parts += [
            f"## `{message.name}`",
            about(message),
            table(HEAD, map(signal_row, signals)),
            *(values_of(signal) for signal in signals if len(signal.choices or {}) > 1),
        ]
    return page(parts)


def about(message: Message) -> str:
    """Id, cycle, sender and content of a message."""
    kind = "bench"
    if message.name in INPUT_MESSAGES:
        kind = "input of the service"
    elif message.name in OUTPUT_MESSAGES:
        kind = "output of the service"
    senders = ", ".join(message.senders)
    head = f"0x{message.frame_id:03X}, each {message.cycle_time} ms, sent by {senders}; {kind}."
    return f"{head} {plain(message.comment)}"


def signal_row(signal: Signal) -> list[str]:
    """Layout and meaning of a signal."""
    name = code(signal.name)
    if signal.is_multiplexer:
        name += " (multiplexor)"
    elif signal.multiplexer_ids:
        name += f" (where it is {signal.multiplexer_ids[0]})"
    return [
        name,
        f"{signal.start}, {signal.length} {'signed' if signal.is_signed else ''}",
        f"{signal.scale:g}",
        f"{signal.offset:g}",
        f"{signal.minimum:.10g} .. {signal.maximum:.10g}",
        "" if signal.unit in (None, "-") else str(signal.unit),
        plain(signal.comment),
    ]


def values_of(signal: Signal) -> str:
    """Sentence with the named values of a signal."""
    named = {int(raw): str(text) for raw, text in (signal.choices or {}).items()}
    listed = ", ".join(f"{raw} {text}" for raw, text in sorted(named.items()))
    return f"{code(signal.name)}: {listed}."
