"""The mechanisms as a table: name, half, sizes, unit, what is physically the same."""

from tests.worlds.outside.kinds import ASIDE_NAMES
from tests.worlds.outside.registry import MECHANISMS

for name, one in MECHANISMS.items():
    half = "aside" if name in ASIDE_NAMES else "open"
    sizes = " / ".join(f"{size:g}" for size in one.sizes)
    print(f"{name} | {half} | {sizes} {one.unit} | {', '.join(one.same) or '-'}")  # noqa: T201
