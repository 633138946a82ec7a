"""Texts that users read, and the wordings in them that sound translated.

A text is a paragraph of a document or of a page's template, a string of the code with `{}` for
what is filled in, or a public docstring. Code in backticks and link targets are not text.
"""

import ast
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CODE = re.compile(r"``.*?``|`[^`\n]*`|\]\([^)]*\)|https?://\S+")

EVERYWHERE = {
    r"told": "reported, shown",
    r"tells?|telling": "reports, shows, distinguishes",
    r"(go|goes|going) with": "depends on",
    r"(?<!\.)mend(s|ed|ing)?(?!:)": "fix",
    r"(a|the|its|each|every|one|since) begin(?! \w)": "start",
    r"begins? anew|anew": "again",
    r"for who": "for users who",
    r"stands(?! (still|for))": "is",
    r"of these(?! \w)": "of these drives",
    r"such (a )?ones?": "such a drive",
    r"all that (was|were|is|are|has|have)": "everything that",
    r"as long as \.\.|so long as": "while",
    r"at a time (at|in) which|at a time when": "when",
    r"in vain": "without effect",
    r"lets itself|let themselves": "can be",
    r"is what": "name it",
    r"in the manner of": "like, based on",
    r"one's own": "your own",
    r"reckon(s|ed|ing)?": "compute, count",
    r"chance alone": "p < 0.001, corrected for all effects tested",
    r"as (its|the|a) file has it": "as written",
}
"""Wordings of no text: regular expression, and what to write instead."""

SHOWN = {
    **EVERYWHERE,
    r"begins?": "start",
    r"whoever|nobody|somebody": "name who acts, or use the passive",
    r"goes on|go on|gone on": "continues",
    r"(is|are) wanted|wanted": "the target is, selected, needed",
    r"not one (?!of|file|place|that)": "no",
    r"whatever": "any",
    r"passed over|passes over": "skipped",
    r"(is|are|were|was) left out": "dropped, skipped, omitted",
    r"taken out": "removed",
    r"looks? to be": "seems to be",
    r"(does|do) harm": "makes worse",
    r"a (file|row|line) a (message|frame|value|sample|setpoint|surface)": "one file per message",
    r"in front of (it|them|that)": "before",
    r"say --": "pass --",
    r"let .{1,30} make": "use .. to make",
    r"leave .{1,30} away": "remove",
    r"for (there|it|they) (is|are|has|have)": "because",
    r"comes? out (as|right|too)": "is",
    r"by (itself|themselves)": "on its own, separately",
    r"anywhere else than": "except",
    r"swings?": "oscillates",
}
"""Wordings of no sentence on a terminal, on a page or in `--help`, likewise."""

EXCEPTIONS = {
    "docs/style.md": "lists the wordings",
    "Begin Triggerblock": "Vector's tools write it into .asc files",
    "import can, cantools": "code of a benchmark, which no user reads",
}
"""Files, and parts of texts, that keep a wording, and why."""


@dataclass(frozen=True)
class Text:
    """A text with its place.

    Attributes:
        path: File, relative to the repository.
        line: Number of its line.
        text: Text on one line.

    """

    path: str
    line: int
    text: str


def documents() -> Iterator[Text]:
    """Paragraphs of all documents."""
    for path in sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]):
        yield from _paragraphs(path, CODE.sub(_blank, path.read_text()))


def templates() -> Iterator[Text]:
    """Paragraphs of the templates of pages, without style and script."""
    for path in sorted((ROOT / "adhesion_can" / "reporting" / "templates").iterdir()):
        cut = re.compile(r"<(style|script)\b.*?</\1>|<[^>]*>|\{[{%#].*?[}%#]\}", re.DOTALL)
        yield from _paragraphs(path, cut.sub(_blank, path.read_text()))


@cache
def strings() -> list[Text]:
    """Strings of package and tools that may reach a user, f-strings with `{}` for values."""
    texts: list[Text] = []
    for path, tree in _modules():
        skipped = {id(node) for _, node in _docstrings(tree)}
        texts += [
            Text(str(path.relative_to(ROOT)), node.lineno, text)
            for node in _strings(tree, skipped)
            if " " in (text := _flat(_joined(node)))  # else a name
        ]
    return texts


def public_docstrings() -> Iterator[Text]:
    """Docstrings of public modules, classes, functions and constants of the package."""
    for path, tree in _modules():
        if path.is_relative_to(ROOT / "adhesion_can"):
            for owner, node in _docstrings(tree):
                if not owner.startswith("_"):
                    text = CODE.sub("_", _joined(node))
                    yield Text(str(path.relative_to(ROOT)), node.lineno, _flat(text))


def odd_wordings(texts: Iterable[Text], patterns: dict[str, str]) -> list[str]:
    """A line for each odd wording: place, wording in its context, and what to write."""
    any_of_them = _whole_words("|".join(patterns))
    compiled = [(_whole_words(pattern), instead) for pattern, instead in patterns.items()]
    return [
        f"{one.path}:{one.line}: '{one.text[max(0, m.start() - 40) : m.end() + 30]}': {instead}"
        for one in texts
        if one.path not in EXCEPTIONS and any_of_them.search(one.text)
        for pattern, instead in compiled
        for m in pattern.finditer(one.text)
        if not any(part in one.text for part in EXCEPTIONS)
    ]


def _whole_words(pattern: str) -> re.Pattern[str]:
    return re.compile(rf"(?<![\w-])(?:{pattern})(?![\w-])", re.IGNORECASE)


def _blank(found: re.Match[str]) -> str:
    """A sign for what is no text, with its line breaks."""
    return "_" + "\n" * found[0].count("\n")


def _paragraphs(path: Path, text: str) -> Iterator[Text]:
    for found in re.finditer(r"(?:.+\n?)+", text):
        line = text.count("\n", 0, found.start()) + 1
        yield Text(str(path.relative_to(ROOT)), line, _flat(found[0]))


def _flat(text: str) -> str:
    return " ".join(text.split())


@cache
def _modules() -> list[tuple[Path, ast.Module]]:
    paths = sorted([*(ROOT / "adhesion_can").rglob("*"), *(ROOT / "tools").rglob("*")])
    scripts = [p for p in paths if p.suffix == ".py" or (p.is_file() and _is_script(p))]
    return [(path, ast.parse(path.read_text())) for path in scripts]


def _is_script(path: Path) -> bool:
    with path.open("rb") as file:
        return b"python" in file.readline()


def _docstrings(tree: ast.AST) -> Iterator[tuple[str, ast.Constant]]:
    """Docstrings with the name of their owner; '' of the module."""
    for owner in ast.walk(tree):
        if isinstance(owner, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            name = getattr(owner, "name", "")
            for before, node in zip([None, *owner.body], owner.body, strict=False):
                value = node.value if isinstance(node, ast.Expr) else None
                if isinstance(value, ast.Constant) and isinstance(value.value, str):
                    yield _assigned(before) or name, value


def _assigned(node: ast.stmt | None) -> str:
    """Name that a statement assigns, whose docstring is the string below; '' for others."""
    target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
    return target.id if isinstance(target, ast.Name) else ""


def _strings(node: ast.AST, skipped: set[int]) -> Iterator[ast.Constant | ast.JoinedStr]:
    if id(node) in skipped:
        return
    if isinstance(node, ast.JoinedStr):
        yield node
        for part in node.values:
            if isinstance(part, ast.FormattedValue):
                yield from _strings(part.value, skipped)
    elif isinstance(node, ast.Constant):
        if isinstance(node.value, str):
            yield node
    else:
        for child in ast.iter_child_nodes(node):
            yield from _strings(child, skipped)


def _joined(node: ast.Constant | ast.JoinedStr) -> str:
    if isinstance(node, ast.Constant):
        return str(node.value)
    return "".join(_joined(v) if isinstance(v, ast.Constant) else "{}" for v in node.values)
