"""What a plan is made from: an object's modifiers, shape keys and hook, as plain data. Does not use Blender; survey.py
reads it."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Driven:
    """One setting of a modifier that a driver sets."""

    name: str  # of the property
    variables: tuple[Any, ...] = ()  # of its driver, each as returned by driven.variable_description
    trouble: str = ""  # why Sinew cannot evaluate its driver, a clause


@dataclass(frozen=True)
class Tail:
    """Modifiers right behind the run, whose result Sinew computes with stencils."""

    names: tuple[str, ...]  # in stack order
    digest: str  # of what their stencils depend on, as returned by tails.digest
    simplification: str  # as in canvas_survey.Surroundings
    stencils: tuple[Any, Any]  # sinew_native.Stencils in viewports and in renders; None where Blender evaluates them

    @property
    def shown(self) -> tuple[bool, bool]:
        """Whether the canvas evaluates them, in viewports and in renders."""
        viewport, render = self.stencils
        return viewport is not None, render is not None


@dataclass(frozen=True)
class Modifier:
    """One modifier of an object, with the settings that the user made."""

    name: str
    type: str
    title: str = ""  # of its type, in Blender's menus
    identity: int = 0  # as returned by nodes.identity
    is_own: bool = False  # Sinew's
    has_old_group: bool = False  # Sinew's, with the node group of an older version
    shown: tuple[bool, bool] = (True, True)  # in the viewport, in renders
    is_switched: bool = False  # drivers or keyframes set `shown`
    switch_drivers: frozenset[tuple[int, str]] = frozenset()  # of those that drivers set: (key of the object, path)
    driven: tuple[Driven, ...] = ()  # other settings that drivers set, except for the hook's
    lacks_target: bool = False  # it has no effect without an object, and has none
    awaits: tuple[int, str] | None = None  # what it needs, as returned by survey.awaited_by
    binds: tuple[bool, bool] = (False, False)  # of an Armature modifier: use_vertex_groups, use_bone_envelopes
    is_mixed: bool = False  # an Armature modifier, with the one before it (Multi Modifier)
    may_be_mixed: bool = False  # the same, on some frames: drivers or keyframes set Multi Modifier
    picks_by_index: bool = False  # a Hook whose vertices are chosen by index
    trouble: str = ""  # why Sinew cannot evaluate it with its settings, a clause
    animation_trouble: str = ""  # of an Armature modifier: the same of its bones, a part of `trouble`
    keeps_shape: bool = False  # it changes neither the vertices nor their positions
    reads_shape: bool = True  # what it does depends on the positions
    feeds: str = ""  # name of a vertex group that it changes and by which Sinew would deform the mesh
    is_fixed: bool = False  # of a library override's library: it can be neither moved nor removed
    comes_first: bool = False  # Blender adds a new one of this type before all that do more than deform
    likeness: tuple[Any, ...] = ()  # of a Hook: what it has in common with its copies
    is_animated: bool = False  # drivers or keyframes set any of its properties, except for the hook's
    front_trouble: str = ""  # why Sinew cannot begin with the result of a modifier of FRONTS, a clause
    tail_trouble: str = (
        "its result is no weighted sum of the vertices before it"  # why it is of no tail, a clause; or ""
    )
    reads_canvas: bool = False  # Sinew's, with a node group that reads a canvas
    reads_front: bool = False  # Sinew's, with the one that takes all from it
    canvas: int | None = None  # key of the canvas that it reads

    @property
    def is_shown(self) -> bool:
        """Whether it is switched on in the viewport or in renders, or may be on some frame."""
        return any(self.shown) or self.is_switched

    @property
    def does_nothing(self) -> bool:
        """Whether it is switched off, or lacks the object that it needs to have an effect."""
        return not self.is_shown or self.lacks_target

    @property
    def is_beside_shape(self) -> bool:
        """Whether it makes no difference if it comes before or after what Sinew replaces."""
        return self.keeps_shape and not self.reads_shape and not self.feeds

    @property
    def full_name(self) -> str:
        """Its name as shown in the stack, followed by its type unless the name begins with it."""
        return self.name if self.name.startswith(self.title) else f"{self.name} ({self.title})"


@dataclass(frozen=True)
class Keys:
    """The shape keys of a mesh."""

    identity: int  # as returned by values.key_of
    count: int  # the reference key included
    is_relative: bool = True
    is_one_shown: bool = False  # only the active one


@dataclass(frozen=True)
class Hook:
    """The driver through which Blender's evaluation calls Sinew, see wiring.py."""

    path: str  # of the property that it drives
    carrier: str = ""  # name of the modifier with that property
    mesh: int | None = None  # key of the mesh that it waits for
    keys: int | None = None  # key of the shape keys that it waits for
    targets: frozenset[tuple[int, str]] = frozenset()  # that it waits for, see wiring.Waits
    has_lost_target: bool = False  # an object or a bone that it waits for was deleted
    awaited: frozenset[tuple[int, str]] = frozenset()  # see wiring.Waits
    canvas: int | None = None  # key of the canvas that it waits for
    copied: int | None = None  # key of the canvas's copy of the mesh that it waits for
    driven: tuple[Any, ...] = ()  # descriptions of its copies of other drivers' variables, in order


@dataclass(frozen=True)
class Situation:
    """One object as a plan sees it. Keys of data-blocks are those of values.key_of."""

    mesh: int = 0  # key of the object's mesh
    vertex_count: int = 0
    modifiers: tuple[Modifier, ...] = ()  # in stack order
    taken: tuple[str, ...] = ()  # names of the Armature modifiers that Sinew replaces, or would replace
    hook: Hook | None = None
    keys: Keys | None = None
    is_bound: bool = True  # otherwise the plan is for if it were
    gets_armature: bool = False  # it has no Armature modifier, but gets one when it is bound
    sharer_count: int = 1  # objects that have the mesh, without canvases
    canvas: int | None = None  # key of the object's own canvas, if it has one with the right mesh and front
    copied: int | None = None  # key of that canvas's mesh, if it is a copy
    front_trouble: str = ""  # why the result cannot be all of a canvas's, a sentence; "" if not asked
    tail: Tail | None = None  # what was found for the modifiers of these names
    is_followed: bool = False  # others may read its evaluated vertices in a viewport
    generated_in: str = ""  # of a mesh with shape keys: name of a material with Generated coordinates
    deforming_parent: str = ""  # name of the parent, if it deforms the mesh directly
    moves_against_armature: bool = False  # mesh and armature were seen to move relative to each other frame by frame
    weights_follow_shape: bool = False  # see survey.weights_follow_shape; False if neither keys nor motion ask for it
    wants_more: bool = False  # it uses something that Blender's modifiers cannot do, or do slowly
    has_attribute: bool = False  # the mesh has the attribute of deformed positions
    is_linked: bool = False
    misses_bones: bool = False  # it is linked, and its hook does not wait for all bones by which the mesh moves
    is_mesh_linked: bool = False
    is_canvas_slow: bool = False  # in this version of Blender, slower than the Armature modifier
    may_be_single_user: bool = True  # it can be given its own copy of its mesh
    trouble: str = ""  # why this version of Blender cannot be read, a sentence
    key_trouble: str = ""  # the same of shape keys
    attribute_trouble: str = ""  # the same of attributes
    animation_trouble: str = ""  # what animation may change unseen of the object, its mesh and its keys, a sentence
    tells_renders: bool = True  # an evaluation can tell whether it is for a render

    def modifier(self, name: str) -> Modifier:
        """Returns the modifier of that name. Raises KeyError."""
        for modifier in self.modifiers:
            if modifier.name == name:
                return modifier
        raise KeyError(name)

    @property
    def own(self) -> Modifier | None:
        """Sinew's modifier."""
        return next((modifier for modifier in self.modifiers if modifier.is_own), None)

    @property
    def carrier(self) -> Modifier | None:
        """The modifier with the hook."""
        return self.modifier(self.hook.carrier) if self.hook is not None else None

    @property
    def animation_troubles(self) -> frozenset[str]:
        """All sentences of that kind."""
        found = self.animation_trouble, *(modifier.animation_trouble for modifier in self.modifiers)
        return frozenset(filter(None, found))
