"""Cells of CSV that a spreadsheet would compute: an apostrophe in front makes them text.

Names come from databases and tables of strangers, and a spreadsheet takes what starts with one of
`= + - @` for a formula, which may start programs or send cells away. Spreadsheets and OWASP know
the apostrophe; a reader of our files has to remove it.
"""

import re

_FORMULA = re.compile(r"'*[=+\-@＝＋－＠]")
_QUOTED = re.compile(r"'+[=+\-@＝＋－＠]")
_NUMBER = re.compile(r"'*[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?")


def quote_formula(cell: str) -> str:
    """The cell, with an apostrophe in front where a spreadsheet would compute it.

    Numbers stay; a cell that has such apostrophes gets one more, so that none is lost.

    Args:
        cell: Text of a cell without blanks around it.

    """
    return f"'{cell}" if _FORMULA.match(cell) and not _NUMBER.fullmatch(cell) else cell


def unquote_formula(cell: str) -> str:
    """The cell as `quote_formula` got it."""
    return cell[1:] if _QUOTED.match(cell) and not _NUMBER.fullmatch(cell) else cell
