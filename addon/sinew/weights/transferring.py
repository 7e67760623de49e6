"""Copies the weights of meshes to other meshes, as from a body to clothes."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..blender import armatures, bounds
from ..deform import influences
from ..native import sinew_native
from ..plan import bindable
from . import checks, parenting, reports, solid, table
from .entries import Entries, stacked
from .weight_settings import TransferSettings


@dataclass(frozen=True)
class Fit:
    """What one mesh has got."""

    name: str
    vertices: int
    matched: int  # vertices that have the weights of the closest point
    islands: int  # parts without such a vertex, which follow their nearest point
    unweighted: int  # vertices that have got nothing, because that point has no weights
    kept: tuple[str, ...]  # names of locked groups


@dataclass(frozen=True)
class Report:
    """The result of a transfer."""

    sources: tuple[str, ...]
    fits: tuple[Fit, ...]
    parented: tuple[str, ...] = ()  # names of targets that have got an Armature modifier
    unfollowing: tuple[str, ...] = ()  # names of targets that have none

    @property
    def unweighted(self) -> int:
        """How many vertices have got no weights."""
        return sum(fit.unweighted for fit in self.fits)

    def sentence(self) -> str:
        """Returns the report for people."""
        vertices, matched = sum(fit.vertices for fit in self.fits), sum(fit.matched for fit in self.fits)
        islands, kept = sum(fit.islands for fit in self.fits), sum(len(fit.kept) for fit in self.fits)
        text = f"{reports.counted(vertices, 'vertex', 'vertices')}: {matched:,} matched"
        if matched < vertices:
            text += f", {vertices - matched:,} filled in"
        if islands:
            text += f", {reports.counted(islands, 'island')} {'follows its' if islands == 1 else 'follow their'} "
            text += "nearest point"
        text += f", {self.unweighted:,} without weights" if self.unweighted else ""
        text += f", {reports.counted(kept, 'locked group')} kept" if kept else ""
        if self.parented:
            text += f"; {', '.join(self.parented)}: Armature modifier added"
        if self.unfollowing:
            text += f"; {', '.join(self.unfollowing)}: no Armature modifier, so nothing follows the bones"
        return text

    def document(self) -> dict[str, Any]:
        """Returns the report for JSON."""
        return {
            "sources": list(self.sources),
            "parented": list(self.parented),
            "without_modifier": list(self.unfollowing),
            "objects": [
                {**reports.document(fit, kept="locked_groups_kept"), "filled": fit.vertices - fit.matched}
                for fit in self.fits
            ],
        }


class Transfer:
    """Weights of mesh objects from those of other mesh objects, at rest in world space. It is made and written in the
    main thread; in between, `compute` may run in any thread, because it does not touch Blender's data."""

    def __init__(
        self,
        sources: Sequence[bpy.types.Object],
        targets: Sequence[bpy.types.Object],
        settings: TransferSettings | None = None,
        add_modifier: bool = False,
    ) -> None:
        """Reads everything. add_modifier: whether targets that nothing deforms get an Armature modifier, and become
        children of its armature: their own parent, else the first source's. Raises ValueError."""
        refuse(sources, targets)
        self.sources, self.targets, self._settings = list(sources), list(targets), settings or TransferSettings()
        of_sources = dict.fromkeys(map(table.armature_of, self.sources))
        self.armature = next(iter(of_sources))
        bones = tuple(dict.fromkeys(name for each in of_sources for name in table.deforming(each)))
        own_names = [table.used_names(ob, bones) for ob in self.sources]
        for ob, names in zip(self.sources, own_names):
            if not names:
                raise ValueError(f"no vertex of {ob.name} has weight in a deforming bone: make its weights first")
        self._source_names = tuple(name for name in bones if any(name in names for names in own_names))
        self._refuse_other_bones(of_sources)
        self._add_modifier = add_modifier
        for ob in self._to_parent():
            parenting.refuse(ob, self._armature_for(ob))
        self._from = solid.collect(self.sources)
        if not len(self._from.face_vertices):
            raise ValueError(f"{_names(self.sources)} has no faces: weights are copied from the points of faces")
        rows = [Entries.of(table.read(ob, self._source_names).weights) for ob in self.sources]
        self._weights = stacked(rows, self._from.starts)
        self._to = [solid.collect([ob]) for ob in self.targets]
        more = [tuple(name for name in bones if name not in self._source_names) for _ in self.targets]
        self._tables = [
            table.read(ob, (*self._source_names, *table.used_names(ob, own))) for ob, own in zip(self.targets, more)
        ]
        for ob, own in zip(self.targets, self._tables):
            if own.locked[: len(self._source_names)].all():
                raise ValueError(f"all vertex groups of {ob.name} that would get weights are locked: unlock some")
        self._made: list[tuple[Any, np.ndarray]] = []  # what `held` returns, for each target
        self.matched: list[np.ndarray] = []  # (V,) bool for each target

    def _to_parent(self) -> list[bpy.types.Object]:
        """Returns the targets that get an Armature modifier: not those that hang on a bone, which would move twice."""
        return [ob for ob in self.targets if self._add_modifier and ob.parent_type == "OBJECT" and not _is_deformed(ob)]

    def _armature_for(self, ob: bpy.types.Object) -> bpy.types.Object:
        return bindable.find_armature(ob) or self.armature

    def _refuse_other_bones(self, of_sources: Any) -> None:
        """Raises ValueError if a target's own armatures lack bones of the source. of_sources: armatures, a dict."""
        for ob in self.targets:
            own = bindable.armatures_of(ob)
            if not own or not of_sources.keys().isdisjoint(own):
                continue
            there = {name for each in own for name in table.deforming(each)}
            missing = [name for name in self._source_names if name not in there]
            if missing:
                listed = ", ".join(missing[:3]) + (f" and {len(missing) - 3:,} more" if len(missing) > 3 else "")
                raise ValueError(
                    f"{ob.name} belongs to {_names(own)}, which lacks deforming bones that move "
                    f"{_names(self.sources)}: {listed}. Give it the Armature modifier of {self.armature.name}"
                )

    def compute(self, progress: Any = None) -> bool:
        """Computes the weights. progress: a sinew_native.Progress. Returns False if it was cancelled: there is nothing
        to write."""
        self._made, self.matched = [], []
        for own, to in zip(self._tables, self._to):
            if progress is not None and progress.is_cancelled:
                return False
            # Locked bones are left out: where they alone move the source, the target follows the others around.
            made = sinew_native.transfer_weights(
                self._from.positions,
                self._from.face_offsets,
                self._from.face_vertices,
                self._normalized(own.locked),
                to.positions,
                to.face_offsets,
                to.face_vertices,
                progress=progress,
                **dataclasses.asdict(self._settings),
            )
            if made is None:
                return False
            self._made.append(table.held(own, made[0]))
            self.matched.append(np.asarray(made[1], bool))
        return progress is None or not progress.is_cancelled

    def _normalized(self, locked: np.ndarray) -> Any:
        """Returns the source's weights, a sinew_native.WeightTable with the columns of a target whose groups are
        locked, (B,) bool, without these, as the Armature modifier takes them: they sum to 1, or to 0."""
        own, count = self._weights.where(~locked[self._weights.bones]), len(self._from.positions)
        return own.summing_to(np.ones(count)).table(count, len(locked))

    def report(self) -> Report:
        """Returns what was computed, for people."""
        fits = tuple(
            Fit(
                ob.name,
                len(matched),
                int(matched.sum()),
                _unmatched_islands(to, matched),
                int(np.count_nonzero(Entries.of(made).sums(len(matched)) <= influences.SMALLEST_WEIGHT_SUM)),
                own.locked_names,
            )
            for ob, to, matched, (made, _changed), own in zip(
                self.targets, self._to, self.matched, self._made, self._tables
            )
        )
        return Report(tuple(ob.name for ob in self.sources), fits)

    def write(self) -> Report:
        """Writes what was computed: once into each mesh. Returns the report."""
        report = self.report()
        for ob, own, made in zip(self.targets, self._tables, self._made):
            table.write(ob, own, *made)
        to_parent = self._to_parent()
        for ob in to_parent:
            parenting.parent(ob, self._armature_for(ob))
        reports.forget()  # it is about the weights of before
        return dataclasses.replace(
            report,
            parented=tuple(ob.name for ob in to_parent),
            unfollowing=tuple(ob.name for ob in self.targets if not _is_deformed(ob)),
        )


def refuse(sources: Sequence[bpy.types.Object], targets: Sequence[bpy.types.Object]) -> None:
    """Raises ValueError if weights cannot be copied from the sources, or written to the targets."""
    if not sources or not targets:
        raise ValueError("nothing to copy between: select the clothes, then the body last, so that it is active")
    for ob in sources:
        if ob.type != "MESH":
            raise ValueError(f"{ob.name} is not a mesh: choose the mesh to copy weights from")
        if ob.data.is_editmode:
            raise ValueError(f"{ob.name} is in Edit Mode; leave it first")
    for ob in targets:
        if ob in sources:
            raise ValueError(f"{ob.name} is both where weights come from and where they go: choose another mesh")
        table.refuse(ob)


def _is_deformed(ob: bpy.types.Object) -> bool:
    """Whether an armature deforms a mesh object."""
    return ob.parent_type == "ARMATURE" or bool(armatures.of_modifiers(ob))


def _names(objects):
    return ", ".join(ob.name for ob in objects)


def _unmatched_islands(mesh: solid.Solid, matched: np.ndarray) -> int:
    """Returns how many parts of a mesh have no matched vertex."""
    size = bounds.diagonal(mesh.positions)
    weld = checks.welded(mesh.positions, size)
    label = checks.islands(len(weld), weld[mesh.edges()])[weld]
    return len(np.setdiff1d(label, label[matched]))
