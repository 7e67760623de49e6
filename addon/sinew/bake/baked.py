"""What a bake has done. Pure."""

from dataclasses import dataclass


@dataclass
class Baked:
    """What has become of one object's cache."""

    name: str
    path: str
    vertices: int
    frames: int  # of the whole cache
    baked: int = 0  # in this run
    found: int = 0  # that were there before it
    missing: int = 0  # that other runs have yet to bake
    remark: str = ""

    def sentence(self):
        text = f"{self.path}: {self.vertices:,} vertices, {self.baked} of {self.frames} frames baked"
        if self.found:
            text += f", {self.found} were there"
        text += f"; {self.missing} are missing" if self.missing else ""
        return f"{text}; {self.remark}" if self.remark else text
