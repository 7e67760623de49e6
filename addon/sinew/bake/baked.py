"""The result of a bake. Pure."""

from dataclasses import dataclass


@dataclass
class Baked:
    """The state of one object's cache after a bake."""

    name: str
    path: str
    vertices: int
    frames: int  # number of frames of the whole cache
    baked: int = 0  # frames baked in this run
    found: int = 0  # frames baked before this run
    missing: int = 0  # frames that other runs still have to bake
    remark: str = ""

    def sentence(self) -> str:
        text = f"{self.path}: {self.vertices:,} vertices, {self.baked} of {self.frames} frames baked"
        if self.found:
            text += f", {self.found} already baked"
        text += f"; {self.missing} are missing" if self.missing else ""
        return f"{text}; {self.remark}" if self.remark else text
