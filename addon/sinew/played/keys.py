"""What is stored in an action."""

from typing import Any, NamedTuple

from ..blender import animation, dependencies
from ..host import keyframes


class Keys(NamedTuple):
    """What is stored in an action."""

    curves: Any  # sinew_native.host.StoredCurves
    others: dict[int, Any]  # of the curves with modifiers or samples, by number
    settings: Any  # of all else

    def is_like(self, other: "Keys") -> bool:
        """Whether two have the same curves."""
        is_same = (self.others, self.settings) == (other.others, other.settings)
        return is_same and self.curves.differing(other.curves) == []


def keys_of(action: Any) -> Keys:
    """Returns what is stored in an action. Raises contract.Broken."""
    curves = animation.action_curves(action)
    stored = keyframes.read(curves)
    others = {i: dependencies.plain(each) for i, each in enumerate(curves) if not stored.is_local(i)}
    layers = [dependencies.plain(each) for each in getattr(action, "layers", ())]
    return Keys(stored, others, (layers, animation.in_muted_groups(action)))
