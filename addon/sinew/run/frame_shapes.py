"""Keeps the shape that Sinew has given to an evaluated object, for whoever asks, and takes a known shape in place of
computing it again.

A shape is known together with a digest of all that it was computed from: the deformer, the stages and their settings,
the poses, the places and the values of shape keys. It is taken only if all of that is the same to the bit.
"""

from dataclasses import dataclass
from typing import Any

from ..native import sinew_native


@dataclass
class Keeper:
    """Asks for the shape of one evaluated object, in each evaluation. Its GraphCopy has it."""

    known: Any = None  # sinew_native.host.FrameShape that may be taken, or None
    is_keeping: bool = False  # otherwise a shape that has to be computed is not kept
    found: Any = None  # the FrameShape of the last evaluation, or None
    identity: int = 0  # of what computed it, see chain.Chain.identity

    def ask(self, known: Any, is_keeping: bool) -> None:
        """Says what the next evaluation may take, and whether to keep its shape."""
        self.known, self.is_keeping, self.found = known, is_keeping, None

    def note(self, identity: int, *computed: Any) -> None:
        """Keeps the shape that the full path has just computed. computed: the other arguments of
        sinew_native.host.shape_of."""
        self.identity, self.found = identity, None
        if self.is_keeping or self.known is not None:
            found = sinew_native.host.shape_of(identity, *computed)
            is_known = found is not None and self.known is not None and self.known.is_of_same(found)
            self.found = self.known if is_known else found
