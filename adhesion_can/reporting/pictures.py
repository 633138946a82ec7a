"""Figures of a page as pictures for papers: PNG or SVG, drawn by Matplotlib.

A figure is the same plain data as in the page: traces and a layout of Plotly, of which this draws
what our figures use: lines, points, filled outlines, error bars and bars, in panels one under the
other. Matplotlib comes with the extra `report`.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.extras import needing_extra
from adhesion_can.files import whole_file
from adhesion_can.reporting.page import Figure, Page

WIDTH_IN, PX_PER_IN = 7.2, 130.0
"""Width of a picture, two columns of a journal, and pixels of a page on one inch."""
DPI = 200
DASHES = {"dash": (0, (4, 3)), "dot": (0, (1, 2)), "solid": "-"}
SYMBOLS = {"circle": "o", "circle-open": "o", "diamond": "D", "x": "x"}
POINTS = 0.7
"""Points (1/72 inch) for a pixel of a line or a mark."""


def require_pictures(where: str) -> None:
    """Raise where Matplotlib is missing, before work that would end in a picture.

    Args:
        where: Option or file that asks for the picture.

    Raises:
        InputError: The extra is not installed.

    """
    with needing_extra("report", where, "pictures need Matplotlib"):
        import matplotlib as mpl  # noqa: F401  whether it is there


def write_pictures(page: Page, path: Path) -> list[Path]:
    """Write all figures of a page.

    Args:
        page: Page.
        path: File of the first figure; the others have '-2', '-3' and so on before the suffix.

    Returns:
        Files in the order of the figures.

    Raises:
        InputError: The extra is not installed, or a file cannot be written.

    """
    require_pictures(str(path))
    import matplotlib as mpl

    written = []
    # One file twice the same: no date, and ids of SVG that do not depend on chance.
    settings: Any = {"svg.hashsalt": "adhesion-can", "font.size": 8, "axes.spines.top": False,
                "axes.spines.right": False, "svg.fonttype": "none"}  # fmt: skip
    form = path.suffix[1:].lower()
    for number, figure in enumerate(page.figures, start=1):
        target = path if number == 1 else path.with_stem(f"{path.stem}-{number}")
        with mpl.rc_context(settings), whole_file(target, "wb", own_name=number > 1) as file:
            drawn = _draw(figure)
            metadata = {"Date": None} if form == "svg" else {}
            drawn.savefig(file, format=form, dpi=DPI, bbox_inches="tight", metadata=metadata)
        written.append(target)
    return written


def _draw(figure: Figure) -> Any:
    from matplotlib.figure import Figure as Canvas

    layout = figure.layout
    numbers = sorted({_number(name) for name in layout if name.startswith("yaxis")} or {1})
    canvas = Canvas(figsize=(WIDTH_IN, max(figure.height, 200) / PX_PER_IN))
    panels: dict[int, Any] = {}
    for number in numbers:
        y = layout.get(f"yaxis{_suffix(number)}", {})
        bottom, top = y.get("domain", (0.0, 1.0))
        shared = panels.get(1) if _x(layout, number).get("matches") else None
        panels[number] = canvas.add_axes((0.0, bottom, 1.0, top - bottom), sharex=shared)
    for trace in figure.data:
        if trace.get("visible") != "legendonly":
            axes = panels[_number(trace.get("yaxis", "y"))]
            _draw_trace(axes, trace)
    for number, axes in panels.items():
        _style_axes(axes, _x(layout, number), layout.get(f"yaxis{_suffix(number)}", {}))
    for shape in layout.get("shapes", ()):
        axes = panels[_number(str(shape["yref"]).split()[0])]
        style = _line_style(shape.get("line", {}))
        axes.axvline(shape["x0"], **style)
    for note in layout.get("annotations", ()):
        axes = panels[_number(str(note["yref"]).split()[0])]
        place = axes.get_xaxis_transform()
        style = {"ha": "center", "va": note.get("yanchor", "bottom"), "transform": place}
        axes.text(note["x"], note["y"], _text(note["text"]), **style)
    _add_legend(canvas, panels[numbers[-1]], figure)
    return canvas


def _add_legend(canvas: Any, last: Any, figure: Figure) -> None:
    """Legend of all panels, below them."""
    seen: dict[str, Any] = {}
    for axes in canvas.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            seen.setdefault(label, handle)
    if len(seen) > 1:
        below = 60.0 / max(figure.height, 200) / max(last.get_position().height, 1e-3)
        last.legend(seen.values(), seen.keys(), loc="upper center", ncols=min(len(seen), 4),
                    bbox_to_anchor=(0.5, -below), frameon=False)  # fmt: skip


def _number(name: str) -> int:
    """Number of an axis by its name, as 'yaxis3' or 'y3'; the first has none."""
    match = re.search(r"\d+$", name)
    return int(match.group()) if match else 1


def _suffix(number: int) -> str:
    return "" if number == 1 else str(number)


def _x(layout: Mapping[str, Any], number: int) -> Mapping[str, Any]:
    abscissa: Mapping[str, Any] = layout.get(f"xaxis{_suffix(number)}", {})
    return abscissa


def _text(text: str) -> str:
    """A text of Plotly as one of Matplotlib: subscripts become its own."""
    text = re.sub(r"(\w)<sub>(\w+)</sub>", r"$\\mathregular{\1_{\2}}$", text)
    return text.replace("<br>", "\n")


def _floats(values: Sequence[Any]) -> Array:
    return np.array([np.nan if v is None else v for v in values], dtype=np.float64)


def _draw_trace(axes: Any, trace: Mapping[str, Any]) -> None:
    name = _text(str(trace.get("name", "")))
    label = name if name and trace.get("showlegend", True) else None
    if trace.get("type") == "bar":
        _draw_bars(axes, trace)
        return
    y = list(trace["y"])
    is_category = any(isinstance(v, str) for v in y)
    x = _floats(trace["x"])
    if is_category:
        # A gap has the category of the row; the abscissa cuts the line.
        first = next(v for v in y if isinstance(v, str))
        y = [first if v is None else v for v in y]
    else:
        y = _floats(y)  # type: ignore[assignment]
    if trace.get("fill") == "toself":
        axes.fill(*_outlines(x, np.asarray(y)), label=label, **_area_style(trace))
        return
    error = {
        f"{axis}err": _floats(trace[f"error_{axis}"]["array"])
        for axis in "xy"
        if f"error_{axis}" in trace and "arrayminus" not in trace[f"error_{axis}"]
    }
    style = _line_style(trace.get("line", {})) if "lines" in trace.get("mode", "lines") else {}
    if "markers" in trace.get("mode", "lines"):
        style |= _marker_style(trace.get("marker", {}))
    if error:
        axes.errorbar(x, y, **error, label=label, **({"linestyle": ""} | style))
    else:
        axes.plot(x, y, label=label, **({"linestyle": ""} | style))


def _outlines(x: Array, y: Array) -> list[Array]:
    """Arguments for a filled outline of several parts, which NaN separate; joined at no width."""
    known = np.isfinite(x) & np.isfinite(y)
    ends = np.flatnonzero(np.diff(known.astype(np.int8), prepend=0, append=0))
    parts: list[Array] = []
    for first, end in zip(ends[::2], ends[1::2], strict=True):
        parts += [x[first:end], y[first:end]]
    return parts or [np.empty(0), np.empty(0)]


def _area_style(trace: Mapping[str, Any]) -> dict[str, Any]:
    numbers = re.findall(r"[\d.]+", str(trace.get("fillcolor", "rgba(0,0,0,0.1)")))
    red, green, blue, alpha = (float(n) for n in numbers)
    # On paper the area needs more colour than on a screen.
    colour = (red / 255, green / 255, blue / 255, min(1.8 * alpha, 1.0))
    return {"facecolor": colour, "linewidth": 0}


def _line_style(line: Mapping[str, Any]) -> dict[str, Any]:
    style: dict[str, Any] = {"linestyle": DASHES[line.get("dash", "solid")]}
    style["linewidth"] = POINTS * line.get("width", 1.5)
    if "color" in line:
        style["color"] = line["color"]
    if line.get("shape") == "hvh":
        style["drawstyle"] = "steps-mid"
    if line.get("width", 0) > 5:
        style["solid_capstyle"] = "butt"
    return style


def _marker_style(marker: Mapping[str, Any]) -> dict[str, Any]:
    symbol = str(marker.get("symbol", "circle"))
    style: dict[str, Any] = {"marker": SYMBOLS.get(symbol, "o")}
    style["markersize"] = POINTS * marker.get("size", 5)
    style["alpha"] = marker.get("opacity", 1.0)
    if isinstance(marker.get("color"), str):
        style["color"] = marker["color"]
    if symbol.endswith("-open"):
        style["markerfacecolor"] = "none"
    elif marker.get("size", 5) < 6 and symbol != "x":
        style["markeredgewidth"] = 0
    return style


def _draw_bars(axes: Any, trace: Mapping[str, Any]) -> None:
    colours = trace.get("marker", {}).get("color")
    across = trace.get("orientation") == "h"
    names, sizes = (trace["y"], trace["x"]) if across else (trace["x"], trace["y"])
    options: dict[str, Any] = {"color": colours}
    error = trace.get("error_x" if across else "error_y")
    if error is not None:
        both = [[v or 0.0 for v in error[key]] for key in ("arrayminus", "array")]
        options |= {"xerr" if across else "yerr": both, "ecolor": error.get("color")}
    label = trace.get("name")
    if across:
        axes.barh(list(names), list(sizes), label=label, **options)
    else:
        width = float(np.median(np.diff(_floats(names)))) if len(names) > 1 else 0.8
        axes.bar(list(names), list(sizes), width=width, label=label, **options)


def _style_axes(axes: Any, x: Mapping[str, Any], y: Mapping[str, Any]) -> None:
    for which, axis in (("x", x), ("y", y)):
        set_ = {key: getattr(axes, f"set_{which}{key}") for key in ("label", "scale", "lim")}
        set_["label"](_text(axis.get("title", {}).get("text", "")))
        if axis.get("type") == "log":
            set_["scale"]("log")
        if "range" in axis:
            ends = np.asarray(axis["range"], dtype=np.float64)
            set_["lim"](*(10.0**ends if axis.get("type") == "log" else ends))
        elif axis.get("rangemode") == "tozero":
            low = getattr(axes, f"get_{which}lim")()[0]
            set_["lim"](min(low, 0.0))
        if "tickvals" in axis:
            getattr(axes, f"set_{which}ticks")(axis["tickvals"], labels=axis.get("ticktext"))
            if axis.get("type") == "log":
                getattr(axes, f"{which}axis").minorticks_off()
    if y.get("autorange") == "reversed":
        axes.invert_yaxis()
    if x.get("showticklabels") is False:
        axes.tick_params(labelbottom=False)
    axes.grid(color="#e6eaef", linewidth=0.5)
    axes.set_axisbelow(True)
