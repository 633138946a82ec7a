"""What mkdocs does not do by itself: equations as MathML, pages from outside docs/, the decisions.

MathML is drawn by browsers without a script, so the site needs none and works from disk.
"""

import base64
import html
import json
import posixpath
import re
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parent.parent
OUTSIDE = {
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "dbc/adhesion.dbc": "dbc/adhesion.dbc",
}
"""Files of the repository outside docs/ that the site has, and their places there."""
NOTEBOOK = "examples/tour.ipynb"
"""The notebook, which becomes the page `tour.md` beside it."""
NOT_SHOWN = (".py", ".toml", ".csv")
"""Endings of files that the site does not have: a link to one becomes its text."""

_EQUATION = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', flags=re.DOTALL)
_LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)#\s]*)(#[^)\s]*)?\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Pages and files that do not stand in docs/ as the site shows them."""

    def add(place: str, content: str | bytes) -> None:
        files.append(File.generated(config, place, content=content))

    for source, place in OUTSIDE.items():
        add(place, (ROOT / source).read_bytes())
    add("decisions/index.md", decisions_page())
    for script in _scripts():
        code = f"# {script.name}\n\n```python\n{script.read_text()}```\n"
        add(f"examples/{script.stem}.md", code)
    text, pictures = notebook_page(ROOT / "docs" / NOTEBOOK)
    add(NOTEBOOK.replace(".ipynb", ".md"), text)
    for name, content in pictures.items():
        add(f"{posixpath.dirname(NOTEBOOK)}/{name}", content)
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Links as the site needs them: see `site_link`."""
    here = page.file.src_uri
    sources = {place: source for source, place in OUTSIDE.items()}
    source = sources.get(here, f"docs/{here}")
    return _LINK.sub(lambda link: site_link(link, here, source), markdown)


def on_page_content(content: str, **_: object) -> str:
    """Equations as MathML."""
    return _EQUATION.sub(_drawn, content)


def site_link(link: re.Match[str], here: str, source: str) -> str:
    """A link of the repository as one of the site.

    What leaves docs/ leads to the site's copy, a folder to its first page, an example to its page;
    a file that the site does not have loses its link.

    Args:
        link: Link with text, path and anchor as groups.
        here: Place of the page in the site.
        source: File of the page in the repository.

    """
    text, address, anchor = link[1], link[2], link[3] or ""
    if not address or ":" in address:
        return link[0]
    target = posixpath.normpath(posixpath.join(posixpath.dirname(source), address))
    if (ROOT / target).is_dir():
        target += "/index.md" if target == "docs/decisions" else "/README.md"
    if target == f"docs/{NOTEBOOK}" or ROOT / target in _scripts():
        target = str(Path(target).with_suffix(".md"))
    place = OUTSIDE.get(target, target.removeprefix("docs/"))
    if target.endswith(NOT_SHOWN) or (place == target and target not in OUTSIDE):
        return text
    return f"[{text}]({posixpath.relpath(place, posixpath.dirname(here))}{anchor})"


def _drawn(equation: re.Match[str]) -> str:
    block = equation[1] == "div"
    math = convert(html.unescape(equation[2]), display="block" if block else "inline")
    return f"<div>{math}</div>" if block else math


def _scripts() -> list[Path]:
    return sorted((ROOT / "docs" / "examples").glob("*.py"))


def _decisions() -> list[Path]:
    return sorted((ROOT / "docs" / "decisions").glob("[0-9]*.md"))


def decisions_page() -> str:
    """List of the decisions."""
    titles = [
        (path.name, path.read_text().partition("\n")[0].lstrip("# ")) for path in _decisions()
    ]
    rows = [f"- [{title}]({name})" for name, title in titles]
    about = "Choices that one may want to undo: what was decided, what else was possible, and why."
    return "\n".join(["# Decisions", "", about, "", *rows, ""])


def notebook_page(path: Path) -> tuple[str, dict[str, bytes]]:
    """A notebook as Markdown, and its pictures by name."""
    parts: list[str] = []
    pictures: dict[str, bytes] = {}
    for cell in json.loads(path.read_text())["cells"]:
        text = "".join(cell["source"])
        parts.append(f"```python\n{text}\n```" if cell["cell_type"] == "code" else text)
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "image/png" in data:
                name = f"{path.stem}-{len(pictures) + 1}.png"
                pictures[name] = base64.b64decode("".join(data["image/png"]))
                parts.append(f"![output of the cell above]({name})")
            elif "text/plain" in data or "text" in output:
                shown = "".join(data.get("text/plain", output.get("text", "")))
                parts.append(f"```text\n{shown.rstrip()}\n```")
    return "\n\n".join(parts) + "\n", pictures
