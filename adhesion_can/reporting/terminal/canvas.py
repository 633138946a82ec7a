"""Plots of characters: dots of braille, shades behind them, marks in front of them.

A cell of braille has two dots across and four down (Unicode 2800 to 28FF). No library: those that
plot in terminals draw axes and legends of their own, and leave no room for them in 80 columns.
"""

from collections.abc import Sequence
from math import floor, isfinite, log10

from rich.text import Text

DOTS_ACROSS, DOTS_DOWN = 2, 4
_BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
_BRAILLE = 0x2800
SHADE = "░"
"""Character of a band."""
_LADDER = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)


class Canvas:
    """Drawing area of cells, whose coordinates run from 0 to 1: x to the right, y upwards.

    What lies outside is not drawn.

    Args:
        width: Width, cells.
        height: Height, cells.

    """

    def __init__(self, width: int, height: int) -> None:
        self.width = width
        self.height = height
        self._dots = [[0] * width for _ in range(height)]
        self._dot_styles = [[""] * width for _ in range(height)]
        self._shades: dict[tuple[int, int], tuple[str, str]] = {}
        self._marks: dict[tuple[int, int], tuple[str, str]] = {}

    def dot(self, x: float, y: float, style: str = "") -> None:
        """Set the dot nearest to a point."""
        if not (0.0 <= x <= 1.0 and 0.0 <= y <= 1.0):
            return
        column = min(int(x * self.width * DOTS_ACROSS), self.width * DOTS_ACROSS - 1)
        row = min(int((1.0 - y) * self.height * DOTS_DOWN), self.height * DOTS_DOWN - 1)
        cell_x, cell_y = column // DOTS_ACROSS, row // DOTS_DOWN
        self._dots[cell_y][cell_x] |= _BITS[row % DOTS_DOWN][column % DOTS_ACROSS]
        self._dot_styles[cell_y][cell_x] = style

    def line(self, xs: Sequence[float], ys: Sequence[float], style: str = "") -> None:
        """Join points by straight lines; one that is not finite interrupts them."""
        if len(xs) == 1:
            self.dot(xs[0], ys[0], style)
        for k in range(1, len(xs)):
            ends = (xs[k - 1], ys[k - 1], xs[k], ys[k])
            if not all(map(isfinite, ends)):
                continue
            across = abs(xs[k] - xs[k - 1]) * self.width * DOTS_ACROSS
            down = abs(ys[k] - ys[k - 1]) * self.height * DOTS_DOWN
            steps = max(int(max(across, down)) + 1, 1)
            for step in range(steps + 1):
                share = step / steps
                x = xs[k - 1] + share * (xs[k] - xs[k - 1])
                self.dot(x, ys[k - 1] + share * (ys[k] - ys[k - 1]), style)

    def shade(self, column: int, low: float, high: float, style: str = "") -> None:
        """Shade the cells of a column between two heights; at least one where these lie inside."""
        if not (isfinite(low) and isfinite(high)) or high < 0.0 or low > 1.0:
            return
        first = min(floor((1.0 - min(high, 1.0)) * self.height), self.height - 1)
        last = min(floor((1.0 - max(low, 0.0)) * self.height), self.height - 1)
        for row in range(first, last + 1):
            self._shades[column, row] = (SHADE, style)

    def mark(self, x: float, y: float, character: str, style: str = "") -> None:
        """Put a character of one cell at a point; the first one there stays."""
        if 0.0 <= x <= 1.0 and 0.0 <= y <= 1.0:
            column = min(int(x * self.width), self.width - 1)
            row = min(int((1.0 - y) * self.height), self.height - 1)
            self._marks.setdefault((column, row), (character, style))

    def upright(self, x: float, character: str, style: str = "") -> None:
        """Put a character into each cell of the column at x that carries no mark."""
        if 0.0 <= x <= 1.0:
            column = min(int(x * self.width), self.width - 1)
            for row in range(self.height):
                self._marks.setdefault((column, row), (character, style))

    def rows(self) -> list[Text]:
        """Lines of the drawing, from the top."""
        return [self._row(row) for row in range(self.height)]

    def _row(self, row: int) -> Text:
        text = Text()
        for column in range(self.width):
            place = (column, row)
            if place in self._marks:
                character, style = self._marks[place]
            elif self._dots[row][column]:
                character = chr(_BRAILLE + self._dots[row][column])
                style = self._dot_styles[row][column]
            else:
                character, style = self._shades.get(place, (" ", ""))
            text.append(character, style)
        return text


def nice_ceiling(value: float) -> float:
    """Smallest round number that is not below a positive value: an axis that seldom changes."""
    if not (isfinite(value) and value > 0.0):
        return 1.0
    power = 10.0 ** floor(log10(value))
    return next((step * power for step in _LADDER if step * power >= value * 0.999999), 10 * power)
