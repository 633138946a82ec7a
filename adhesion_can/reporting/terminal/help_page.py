"""The help of the view: what every key does, and what every sign, letter and count means."""

from rich.text import Text

from adhesion_can.reporting.terminal.boxes import boxed, wrapped

KEY_WIDTH = 8
"""Width of the keys, cells."""
LEAST_COLUMNS = 40
"""Smallest width in which the keys have a column, cells."""
KEYS = (
    ("q", "quit"),
    ("m", "list of messages; the arrow keys select one"),
    ("Enter", "open the list, and from it the signals of the selected message"),
    ("esc", "one page back"),
    ("f", "filter messages by part of the name or id; empty: all"),
    ("w", "words only: all sentences"),
    ("space", "pause: a recording stops; a bus continues in the background"),
    (".", "one step of 0.1 s while paused"),
    ("+ -", "double or halve the speed of a recording; beyond x64: max"),
    ("g", "jump to a time in a recording: 90 or 1:30; +10, -10 are relative"),
    ("r", "record as candump from now on; press again to stop"),
)
"""Keys and what they do."""
SIGNS = (
    (
        "First line",
        (
            "REC recording; PAUSED; 'estimated here': the service runs in the monitor; time; x2 "
            "speed of a recording, END its end; frames/s: frames of any kind in the last second."
        ),
    ),
    (
        "Curve",
        (
            "line: identified curve; ░ its 95 % band, from the standard deviations of the peak; ◆ "
            "peak; ┊ creep setpoint as slip; dots: samples of the last 5 s on this surface; "
            "digits: axles now."
        ),
    ),
    (
        "History",
        (
            "mu_max above, lam (lambda_m) below, ░ their 95 % bands, and the status: T TRACKING, l "
            "LOW_EXCITATION, C SURFACE_CHANGE, i INIT, s STALE_INPUT, F FAULT."
        ),
    ),
    (
        "Axles",
        (
            "slip ratio, adhesion and creep speed, medians of 0.2 s; lambda_m and creep setpoint "
            "(set) that the service sends for the axle; - not available."
        ),
    ),
    (
        "Messages",
        (
            "! rejected or lost frames in the last 10 s; x silent for three cycles; - never "
            "received. age ms: since the last accepted frame; 1/s: accepted frames; bad: rejected "
            "and lost frames since the start. +9 more: m: key m shows them."
        ),
    ),
    (
        "Signals",
        (
            "value in its unit, raw value, age of the frame that carried it, and the name of the "
            "value, or the role that the configuration gives to the signal."
        ),
    ),
    ("Sentences", "(+2 more: w): key w shows them."),
    ("Sending", "the monitor never sends."),
)
"""What the parts of the view show."""


def help_lines(width: int) -> list[Text]:
    """All lines of the help, broken at a width, cells; in a narrow one the keys are no column."""
    lines: list[Text] = []
    for key, meaning in KEYS:
        if width < LEAST_COLUMNS:
            lines += wrapped([Text(f"{key}: {meaning}")], width, 99)
            continue
        parts = wrapped([Text(meaning)], width - KEY_WIDTH, 99)
        names = [key, *[""] * (len(parts) - 1)]
        for name, part in zip(names, parts, strict=True):
            lines.append(Text.assemble((f"{name:>{KEY_WIDTH - 2}}  ", "bold"), part))
    for name, meaning in SIGNS:
        lines += wrapped([Text.assemble((f"{name}:", "bold"), f" {meaning}")], width, 99)
    return lines


def help_page(width: int, height: int, first_row: int) -> list[Text]:
    """The help in a frame, from a line on; at most as far as its last line.

    Args:
        width: Width of the page, cells; 50 or more.
        height: Height of the page, lines; 5 or more.
        first_row: Number of lines that are scrolled past.

    """
    lines, room = help_lines(width - 2), height - 2
    if len(lines) <= room:
        return boxed("help", lines, width, height)
    first = min(first_row, last_help_row(width, height))
    shown = lines[first : first + room - 1]
    span = f"lines {first + 1} to {first + len(shown)} of {len(lines)}: arrow keys"
    return boxed("help", [*shown, Text(span, "dim")], width, height)


def last_help_row(width: int, height: int) -> int:
    """Largest number of lines that can be scrolled past on a page of this size, cells."""
    count, room = len(help_lines(width - 2)), height - 2
    return 0 if count <= room else count - (room - 1)
