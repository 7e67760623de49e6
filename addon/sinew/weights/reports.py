"""What the last assignment or check of weights has found, for the panel and for other programs."""

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Report:
    """The result of an assignment."""

    armature: str  # its name
    objects: tuple[str, ...]  # names of the meshes
    vertices: int  # of all meshes
    parts: int  # that are not connected with each other
    unweighted: int
    ways: dict[str, int]  # how many vertices have got their weights in which way
    bones: int  # that weights were made for
    bones_outside: tuple[str, ...]  # names of those that are wholly outside the meshes
    bones_without_vertices: tuple[str, ...]
    seconds: float
    kept: tuple[str, ...] = field(default=())  # names of locked groups of these bones

    def sentence(self) -> str:
        """Returns the report for people."""
        none = "none without weights" if not self.unweighted else f"{self.unweighted:,} without weights"
        outside = len(self.bones_outside)
        parts = [
            f"{counted(self.vertices, 'vertex', 'vertices')} in {counted(self.parts, 'part')}",
            none,
            *([f"{counted(outside, 'bone')} outside the mesh"] if outside else []),
            *([f"{counted(len(self.kept), 'locked group')} kept"] if self.kept else []),
            f"{self.seconds:.1f} s",
        ]
        return ", ".join(parts)

    most_influences = 4  # for the buttons that the panel shows beside a problem

    def problems(self) -> list[tuple[str, str, int]]:
        """Returns (problem, what the vertices are, how many), as a checkup does."""
        return [("UNWEIGHTED", "without weights", self.unweighted)] if self.unweighted else []

    def document(self) -> dict[str, Any]:
        """Returns the report for JSON."""
        return document(self, kept="locked_groups_kept")


def document(report: Any, **names: str) -> dict[str, Any]:
    """Returns what a report holds, for JSON. names: of what has another one there, "" for what is left out."""
    every = {names.get(name, name): value for name, value in vars(report).items()}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in every.items() if name}


def counted(count: int, one: str, many: str = "") -> str:
    """Returns a number and what it counts: "1 bone", "2,000 vertices"."""
    return f"{count:,} {one if count == 1 else many or one + 's'}"


_last: Any = None


def remember(report: Any) -> None:
    """Stores the last report or checkup of some meshes."""
    global _last
    _last = report


def last(names: Any) -> Any:
    """Returns the last report or checkup if it is about one of the objects of these names, otherwise None."""
    return _last if _last is not None and {*_last.objects, _last.armature} & set(names) else None


def forget() -> None:
    """Discards the last report: another file was opened, or steps were undone."""
    remember(None)
