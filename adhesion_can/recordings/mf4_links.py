"""The links of an MDF 4 file, looked at before asammdf follows them.

asammdf follows a chain of blocks until a link is 0, and gives each block that it meets a place in
memory: a chain that runs into itself never ends. Here no block of a chain may be met twice. A link
that leaves the file or leads to a block of another kind is left to asammdf, which reads a file
that was cut as far as it goes, but for the groups of data and channels.
"""

import mmap
import struct
from pathlib import Path

_HEAD = struct.Struct("<4s4xQQ")
_LINK = struct.Struct("<Q")
_ZIPPED = struct.Struct("<2sBxIQQ")
_FIRST_BLOCK = 64
_VERSION_AT = 8  # as text, by which asammdf goes, too
_DEFLATED = (0, 1)
"""Ways of packing whose unpacked size has a bound: deflate, and deflate of transposed rows."""
_BEST = 1032
"""Largest ratio that deflate reaches."""
_DATA = ("DT", "DV", "DI", "DZ", "DL", "LD", "HL", "SD", "RD", "RV", "RI", "SR")
_LISTS = ("DL", "LD")
_COUNTED = ("DG", "CG")
"""Chains whose links asammdf counts without a look at the blocks, and needs whole."""
_INNER = ("CN", "CA", "DS", "CL", "CV", "CU")

_FOLLOWED: dict[str, tuple[tuple[int, tuple[str, ...]], ...]] = {
    "HD": (
        (0, ("DG",)),
        (1, ("FH",)),
        (2, ("CH",)),
        (3, ("AT",)),
        (4, ("EV",)),
    ),
    "DG": ((0, ("DG",)), (1, ("CG",)), (2, _DATA)),
    "CG": ((0, ("CG",)), (1, ("CN",)), (4, ("SR",))),
    "CN": ((0, ("CN",)), (1, _INNER), (5, _DATA)),
    "CA": ((0, _INNER),),
    "DS": ((0, _DATA), (1, _INNER)),
    "CL": ((0, _INNER),),
    "FH": ((0, ("FH",)),),
    "CH": ((0, ("CH",)), (1, ("CH",))),
    "AT": ((0, ("AT",)),),
    "EV": ((0, ("EV",)),),
    "SR": ((0, ("SR",)), (1, _DATA)),
    "HL": ((0, ("DL", "LD")),),
    "DL": ((0, ("DL",)),),
    "LD": ((0, ("LD",)),),
}
"""Links that lead on, by the kind of the block: place of the link, and kinds that it may lead to.
All links of a list of data but the first one lead to data."""


class LinkError(Exception):
    """A chain of blocks without an end, or a size that cannot be."""


def require_sound_links(path: Path) -> None:
    """Raise a LinkError where a chain of blocks has no end, or a packed block an impossible size.

    MDF 3, whose blocks are others, is passed over.

    Args:
        path: Path of the file, which is not packed.

    """
    with path.open("rb") as file:
        head = file.read(_FIRST_BLOCK)
        if len(head) < _FIRST_BLOCK or head[:3] not in (b"MDF", b"UnF"):
            raise LinkError("it does not start like an MDF file")
        if head[_VERSION_AT : _VERSION_AT + 1] < b"4":
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            _follow(data)


def _follow(data: mmap.mmap) -> None:
    seen: set[int] = set()
    waiting: list[tuple[int, tuple[str, ...]]] = [(_FIRST_BLOCK, ("HD",))]
    while waiting:
        at, kinds = waiting.pop()
        kind, links = _block(data, at)
        body = at + _HEAD.size + 8 * links
        if kind not in kinds or body > len(data):
            if kinds[0] in _COUNTED:
                raise LinkError(f"a link points to {at}, where there is no {kinds[0]} block")
            continue
        if kind == "DZ":
            _require_size(data, at, body)
        if kind not in _FOLLOWED:
            continue
        if at in seen:
            raise LinkError(f"two links point to the {kind} block at {at}: its chain is a loop")
        seen.add(at)
        places = _FOLLOWED[kind]
        if kind in _LISTS:
            places = (*places, *((place, _DATA) for place in range(1, links)))
        for place, next_kinds in places:
            if place < links and (
                target := _LINK.unpack_from(data, at + _HEAD.size + 8 * place)[0]
            ):
                waiting.append((target, next_kinds))


def _block(data: mmap.mmap, at: int) -> tuple[str, int]:
    """Kind of the block at a place and number of its links; '' where none is."""
    if at + _HEAD.size > len(data):
        return "", 0
    tag, _, links = _HEAD.unpack_from(data, at)
    return (tag[2:].decode("ascii", "replace") if tag[:2] == b"##" else ""), links


def _require_size(data: mmap.mmap, at: int, body: int) -> None:
    """Raise a LinkError where a packed block claims to hold more than it can."""
    if body + _ZIPPED.size > len(data):
        return
    _, way, _, unpacked, packed = _ZIPPED.unpack_from(data, body)
    if way in _DEFLATED and unpacked > _BEST * (min(packed, len(data)) + 16):
        raise LinkError(f"the DZ block at {at} cannot hold {unpacked} bytes")
