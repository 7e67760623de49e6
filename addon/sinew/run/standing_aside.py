"""Whether Blender's own modifiers deform all meshes for now."""

_is_on = False


def is_on() -> bool:
    return _is_on


class StandAside:
    """Has Blender's own modifiers deform all meshes in evaluations inside the `with` block."""

    def __enter__(self) -> None:
        global _is_on
        _is_on = True

    def __exit__(self, *_: object) -> None:
        global _is_on
        _is_on = False
