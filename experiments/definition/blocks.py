"""How a participant's trials are cut into blocks, and the practice before them."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration, Name


class Blocks(Declaration):
    """How a participant's trials are cut into blocks.

    `split_by` puts each level of a factor into a block of its own; without it a block holds every clip.
    `repeats` shows each such block that often. `order` is drawn per participant: `random` shuffles the
    blocks, `alternating` cycles through the levels from a random (or counterbalanced) start,
    `counterbalanced` deals block orders evenly over participants, `fixed` keeps the declared order.
    """

    split_by: Name | None = None
    """Factor each level of which makes a block; without it every block holds all clips."""
    repeats: Annotated[int, Field(ge=1, le=20)] = 1
    """How often each block is shown. A participant's cell mean is taken over the repeats."""
    order: Literal["random", "alternating", "counterbalanced", "fixed"] = "random"
    """Order of the blocks: shuffled for each participant, cycling through the levels, orders dealt evenly
    over participants (every order up to five blocks, a balanced Latin square beyond), or as declared."""
    trial_order: Literal["random", "fixed"] = "random"
    """Order of the clips in a block: shuffled for each participant, or cell by cell as declared."""
    break_seconds_min: Annotated[int, Field(ge=0, le=600)] = 0
    """Seconds a break between blocks lasts at least; the participant may take longer."""


class Practice(Declaration):
    """Practice trials before the first block; their clips are drawn over all cells by the run's seed."""

    trials: Annotated[int, Field(ge=0, le=50)] = 4
    """How many practice trials there are. They are stored with kind `practice` and never analysed."""
