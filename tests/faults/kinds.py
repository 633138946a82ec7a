"""What a kind of fault is; the kinds stand in modules named after what they strike."""

from collections.abc import Callable
from dataclasses import dataclass

from tests.faults.case import Case, Queues, Sents, Spoil
from tests.faults.locomotive import World


@dataclass(frozen=True)
class Kind:
    """A kind of fault: it spoils readings, frames before they are packed, or frames.

    Attributes:
        sizes: Typical and double size; one where it has none.
        unit: What a size means.
        spoil: Change of the readings.
        queue: Change of the frames before they are packed.
        wire: Change of the frames.
        event: Change of the world: what is no fault at all and must not be taken for one.
        unseen: Whether it cannot be seen in principle, so that only a ceiling bounds it.

    """

    sizes: tuple[float, ...] = (1.0,)
    unit: str = ""
    spoil: Spoil | None = None
    queue: Callable[[Queues, Case], Queues] | None = None
    wire: Callable[[Sents, Case], Sents] | None = None
    event: Callable[[World, Case], World] | None = None
    unseen: bool = False
