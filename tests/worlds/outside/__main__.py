"""The mechanisms as a Markdown table: `python -m tests.worlds.outside`."""

from tests.worlds.outside.kinds import ASIDE_NAMES
from tests.worlds.outside.registry import LABELS, MECHANISMS, Mechanism

HEAD = ("mechanism", "group", *LABELS, "size is", "no false name")


def describe(one: Mechanism) -> tuple[str, ...]:
    """Cells of a mechanism."""
    sentence = one.source.partition("\n")[0].rstrip(".")
    group = "second" if one.second else "aside" if one.name in ASIDE_NAMES else "open"
    sizes = (f"{size:g}" for size in one.sizes)
    same = ", ".join(f"`{name}`" for name in sorted(one.acceptable)) or "-"
    return (f"`{one.name}`: {sentence}", group, *sizes, one.unit, same)


def mechanism_table() -> str:
    """Every mechanism with its group, sizes and what it is no false name to call it."""
    rows = [
        HEAD,
        ("---",) * len(HEAD),
        *(describe(MECHANISMS[name]) for name in sorted(MECHANISMS)),
    ]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


if __name__ == "__main__":
    print(mechanism_table())  # noqa: T201
