"""Rigs whose drivers read other data-blocks than objects: a master control of the scene, the lens of a camera, a light,
a material, shape keys. The first character of the cast is accelerated; the second one is live and reads the same."""

from typing import Any, NamedTuple

import bpy
import numpy as np
import pytest

from characters import make_armature
from helpers import addon_module, needs_memory, needs_rig_programs, select
from test_accelerated_rigs import accelerating as accelerating
from test_accelerated_rigs import keep_live, refused, wait
from test_played import FRAMES, Cast, layer
from test_played_who import both
from test_rigs_that_follow_objects import assert_blender_evaluates_no_bones

pytestmark = [needs_rig_programs, needs_memory]


class Read(NamedTuple):
    """A number that drivers read."""

    block: Any  # the data-block that the driver names
    path: str
    owner: Any = None  # what has the number, if that is another data-block, or has another path
    own_path: str = ""
    low: float = 0.2
    high: float = 0.9


def shown(cast, data, name="Other"):
    """Links an object with this data to the scene."""
    ob = bpy.data.objects.new(name, data)
    cast.scene.collection.objects.link(ob)
    return ob


def with_property(block):
    block["drive"] = 0.5
    block.update_tag()
    return Read(block, '["drive"]')


def camera(cast):
    found = bpy.data.cameras.new("Camera")
    shown(cast, found)
    return found


def light(cast):
    found = bpy.data.lights.new("Lamp", "POINT")
    shown(cast, found)
    return found


def material(cast):
    found = bpy.data.materials.new("Paint")
    found.use_nodes = True
    mesh = bpy.data.meshes.new("Painted")
    mesh.materials.append(found)
    shown(cast, mesh)
    return found


def socket(cast):
    found = material(cast)
    value = found.node_tree.nodes.new("ShaderNodeValue").outputs[0]
    path = value.path_from_id("default_value")
    return Read(found, f"node_tree.{path}", found.node_tree, path)


def world(cast):
    cast.scene.world = bpy.data.worlds.new("World")
    return cast.scene.world


def mesh(cast):
    found = bpy.data.meshes.new("Mesh")
    shown(cast, found)
    return found


def shape_key(cast):
    found = mesh(cast)
    found.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    ob = next(each for each in bpy.data.objects if each.data == found)
    ob.shape_key_add(name="Basis")
    ob.shape_key_add(name="Smile")
    return Read(found.shape_keys, 'key_blocks["Smile"].value')


def other_armature(_cast):
    return with_property(make_armature().data)


def collection(cast):
    found = bpy.data.collections.new("Set")
    cast.scene.collection.children.link(found)
    return found


def texture(cast):
    found = bpy.data.textures.new("Clouds", "CLOUDS")
    ob = shown(cast, bpy.data.meshes.new("Mesh"))
    ob.modifiers.new("Displace", "DISPLACE").texture = found
    return found


def curve(cast):
    found = bpy.data.curves.new("Curve", "CURVE")
    shown(cast, found)
    return found


def lattice(cast):
    found = bpy.data.lattices.new("Lattice")
    shown(cast, found)
    return found


def data_of_an_object(cast):
    found = camera(cast)
    ob = next(each for each in bpy.data.objects if each.data == found)
    return Read(ob, "data.lens", found, "lens", 30, 80)


KINDS = {
    "a property of the scene": lambda cast: with_property(cast.scene),
    "a colour of an object": lambda cast: Read(shown(cast, None), "color[1]", None, "color"),
    "gravity": lambda cast: Read(cast.scene, "gravity[0]", cast.scene, "gravity"),
    "the height of pictures": lambda cast: Read(cast.scene, "render.resolution_y", low=100, high=140),
    "a lens": lambda cast: Read(camera(cast), "lens", low=30, high=80),
    "a lens, by its object": data_of_an_object,
    "the distance in focus": lambda cast: Read(camera(cast), "dof.focus_distance"),
    "a property of a camera": lambda cast: with_property(camera(cast)),
    "an angle": lambda cast: Read(camera(cast), "angle", low=0.6, high=1.3),
    "a lamp's power": lambda cast: Read(light(cast), "energy"),
    "a lamp's colour": lambda cast: Read(light(cast), "color[1]", None, "color"),
    "a property of a lamp": lambda cast: with_property(light(cast)),
    "a material": lambda cast: Read(material(cast), "roughness"),
    "a property of a material": lambda cast: with_property(material(cast)),
    "a world": lambda cast: Read(world(cast), "color[0]", None, "color"),
    "a property of a world": lambda cast: with_property(world(cast)),
    "a property of a mesh": lambda cast: with_property(mesh(cast)),
    "a shape key": shape_key,
    "a property of an armature": other_armature,
    "a property of a collection": lambda cast: with_property(collection(cast)),
    "a texture": lambda cast: Read(texture(cast), "intensity"),
    "a curve": lambda cast: Read(curve(cast), "bevel_depth"),
    "a property of a lattice": lambda cast: with_property(lattice(cast)),
}


class Driven(Cast):
    def __init__(self, scene, kind, is_keyed, has_own_keys=True):
        super().__init__(scene)
        self.read, self.is_keyed = KINDS[kind](self), is_keyed
        if is_keyed:
            for frame, number in ((1, self.read.low), (5, self.read.high), (10, self.read.low)):
                self.set(number)
                self.owner.keyframe_insert(self.own_path, frame=frame)
        else:
            self.set(self.read.low)
        for armature, *_ in both(self):
            drive(armature, self.read)
            if not has_own_keys:
                armature.animation_data.action = None
        select()
        scene.frame_set(2)
        scene.frame_set(1)
        keep_live(self)

    @property
    def owner(self):
        return self.read.owner or self.read.block

    @property
    def own_path(self):
        return self.read.own_path or self.read.path

    def set(self, number):
        """Without a tag of custom properties."""
        if self.own_path.startswith('["'):
            self.owner[self.own_path[2:-2]] = number
            return
        holder, _, name = self.own_path.rpartition(".")
        holder = self.owner.path_resolve(holder) if holder else self.owner
        value = getattr(holder, name)
        if hasattr(value, "__len__"):
            value[:] = [number] * len(value)
        else:
            setattr(holder, name, type(value)(number))

    def accelerate(self):
        wait(self)
        assert self.rig.is_played and self.rig.trial.needs_program, self.rig.reason


def drive(armature, read, kind="SINGLE_PROP"):
    driver = armature.pose.bones["bone3"].driver_add("location", 0).driver
    driver.type, variable = "SCRIPTED", driver.variables.new()
    driver.expression, variable.name, variable.type = f"a / {read.high}", "a", kind
    target = variable.targets[0]
    if kind == "SINGLE_PROP":
        target.id_type = read.block.id_type
        target.id = read.block
    target.data_path = read.path


@pytest.fixture
def cast_of(fresh_scene, monkeypatch):
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 0)
    fresh_scene.frame_start, fresh_scene.frame_end = 1, 10
    return lambda *arguments, **settings: Driven(fresh_scene, *arguments, **settings)


def set_value(cast):
    cast.set((cast.read.low + 2 * cast.read.high) / 3)
    cast.owner.update_tag()


def set_without_a_tag(cast):
    """Blender sees that of custom properties only when it copies the data-block again."""
    cast.set((cast.read.low + cast.read.high) / 2)


def edit_a_key(cast):
    curve = addon_module("blender.animation").slot_curves(cast.owner)[0]
    curve.keyframe_points[1].co.y *= 0.7
    curve.update()
    cast.owner.animation_data.action.update_tag()


def key(cast):
    cast.set((2 * cast.read.low + cast.read.high) / 3)
    cast.owner.keyframe_insert(cast.own_path, frame=7)


def clear_keys(cast):
    cast.owner.animation_data_clear()


def drive_it(cast):
    """What is read follows from the frame from now on."""
    curves = cast.owner.driver_add(cast.own_path)
    for each in curves if isinstance(curves, list) else [curves]:
        each.driver.expression = f"{cast.read.low} + {cast.read.high - cast.read.low} * frame / 20"


def pose(cast):
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].location.x += 0.3


EDITS = {False: (set_value, set_without_a_tag, key), True: (set_value, set_without_a_tag, edit_a_key, key, clear_keys)}
NOT_KEYED = ("the height of pictures", "an angle", "a property of a collection")  # Blender keys none of these
SOURCES = [(kind, is_keyed) for kind in KINDS for is_keyed in (False, True) if not (is_keyed and kind in NOT_KEYED)]


def play_natively(cast, frames=FRAMES):
    cast.accelerate()
    shapes = cast.play(frames)
    cast.scene.frame_set(4, subframe=0.5)
    cast.assert_same()
    assert cast.rig.is_played
    return shapes


@pytest.mark.parametrize("state", ("played", "posed", "seen on the next frame"))
@pytest.mark.parametrize(("kind", "is_keyed"), SOURCES)
def test_edits(cast_of, kind, is_keyed, state):
    """Of what is read, on a frame that is played, or on which the bones were posed just before."""
    cast = cast_of(kind, is_keyed)
    play_natively(cast, [*FRAMES, -7, 400, 3])
    for edit in EDITS[is_keyed]:
        if edit is key and kind in NOT_KEYED:
            continue
        cast.scene.frame_set(3)
        if state == "posed":
            pose(cast)
            layer().update()
            cast.assert_same()
        edit(cast)
        if state != "seen on the next frame":
            layer().update()
            cast.assert_same()
        cast.play([4, 6])
        cast.accelerate()
        cast.play([5, 2])
        assert cast.rig.is_played


@pytest.mark.parametrize(("kind", "is_keyed"), SOURCES)
def test_undo(cast_of, kind, is_keyed):
    cast = cast_of(kind, is_keyed)
    cast.accelerate()
    bpy.ops.ed.undo_push(message="before")
    cast.scene.frame_set(3)
    cast.play([3, 4])
    (edit_a_key if is_keyed else set_value)(cast)
    layer().update()
    cast.play([4, 5])
    bpy.ops.ed.undo_push(message="edit")
    cast.undo()
    cast.assert_same()
    cast.play([5, 4])
    cast.accelerate()
    cast.play([3, 6])


@pytest.mark.parametrize("kind", [kind for kind, is_keyed in SOURCES if is_keyed])
def test_a_rig_without_keyframes_of_its_own(cast_of, kind):
    cast = cast_of(kind, True, has_own_keys=False)
    assert np.ptp(play_natively(cast), axis=0).max() > 0.1
    edit_a_key(cast)
    layer().update()
    cast.assert_same()
    cast.play([4, 8])
    cast.accelerate()
    cast.play([3, 5])


@pytest.mark.parametrize("kind", [kind for kind, is_keyed in SOURCES if is_keyed])
def test_blender_does_not_evaluate_the_bones_because_of_it(cast_of, kind, monkeypatch):
    cast = cast_of(kind, True)
    assert_blender_evaluates_no_bones(cast, monkeypatch)


@pytest.mark.parametrize("kind", ["a property of the scene", "a lamp's power", "a shape key"])
def test_what_is_driven_keeps_it_live(cast_of, kind):
    cast = cast_of(kind, False)
    play_natively(cast, [2])
    drive_it(cast)
    layer().update()
    cast.assert_same()
    cast.play([3, 5])
    refused(cast, "has a driver: bake it into keyframes")


@pytest.mark.parametrize("is_keyed", [False, True])
def test_a_node_keeps_it_live(cast_of, is_keyed, monkeypatch):
    monkeypatch.setitem(KINDS, "a socket", socket)
    cast = cast_of("a socket", is_keyed)
    refused(cast, "after an edit of which Blender evaluates no bones")


@pytest.mark.parametrize("kind", ["a property of the scene", "a lamp's power"])
def test_what_strips_animate_keeps_it_live(cast_of, kind):
    cast = cast_of(kind, True)
    data = cast.owner.animation_data
    data.nla_tracks.new().strips.new("strip", 1, data.action)
    data.action = None
    cast.play([2, 3])
    refused(cast, "is animated by NLA strips")


def test_what_follows_from_keyframes_of_something_else_keeps_it_live(cast_of):
    """A lens is keyed, and its angle read."""
    cast = cast_of("an angle", False)
    for frame, lens in ((1, 30), (9, 80)):
        cast.owner.lens = lens
        cast.owner.keyframe_insert("lens", frame=frame)
    cast.play([2, 3])
    refused(cast, "follows from others")


def test_something_else_of_it_may_be_keyed(cast_of):
    cast = cast_of("a property of a camera", False)
    for frame, lens in ((1, 30), (9, 80)):
        cast.owner.lens = lens
        cast.owner.keyframe_insert("lens", frame=frame)
    cast.play([2, 3])
    play_natively(cast)


def test_another_scene_with_keyframes_keeps_it_live(cast_of, monkeypatch):
    def other(_cast):
        return with_property(bpy.data.scenes.new("Other"))

    monkeypatch.setitem(KINDS, "another scene", other)
    play_natively(cast_of("another scene", False))
    cast = cast_of("another scene", True)
    refused(cast, "another scene, which has keyframes")


def test_drivers_of_shape_keys_read_it_beside_bones(cast_of):
    """These follow the bones, and are computed with them."""
    cast = cast_of("a property of the scene", True)
    for armature, mesh, *_ in both(cast):
        mesh.shape_key_add(name="Basis")
        key = mesh.shape_key_add(name="Wide")
        for point in key.data:
            point.co *= 1.3
        driver = key.driver_add("value").driver
        driver.expression = "a + b"
        for name in "ab":
            driver.variables.new().name = name
        first, second = (variable.targets[0] for variable in driver.variables)
        first.id_type, first.id, first.data_path = "SCENE", cast.scene, '["drive"]'
        second.id, second.data_path = armature, 'pose.bones["bone1"].location[0]'
    cast.play([2, 3])
    play_natively(cast)
    edit_a_key(cast)
    layer().update()
    cast.assert_same()
    cast.play([4, 5])


def test_the_frame_of_the_scene_keeps_it_live(cast_of):
    cast = cast_of("a property of the scene", False)
    for armature, *_ in both(cast):
        drive(armature, Read(cast.scene, "frame_current", high=10))
    cast.play([2, 3])
    refused(cast, "use the word frame in the expression")


def test_what_the_context_has_keeps_it_live(cast_of):
    cast = cast_of("a property of the scene", False)
    for armature, *_ in both(cast):
        drive(armature, cast.read, "CONTEXT_PROP")
    cast.play([2, 3])
    refused(cast, "let it read the scene itself, as Single Property")


def test_what_is_not_shown_keeps_it_live(cast_of):
    """Blender evaluates it for the bones alone, and would not do so while it does not see that they read it."""
    cast = cast_of("a lens", True)
    bpy.data.objects.remove(next(each for each in bpy.data.objects if each.data == cast.owner))
    cast.play([2, 3])
    refused(cast, "Camera, which has keyframes and is not shown")
    shown(cast, cast.owner)
    cast.play([2, 3])
    play_natively(cast)


def test_a_number_out_of_its_limits(cast_of):
    """Keyframes may say more than a property takes."""
    cast = cast_of("a shape key", True)
    for point in addon_module("blender.animation").slot_curves(cast.owner)[0].keyframe_points:
        point.co.y *= 3
    cast.owner.animation_data.action.update_tag()
    cast.play([2, 3])
    play_natively(cast)


def test_what_is_read_is_deleted(cast_of):
    cast = cast_of("a lamp's power", True)
    play_natively(cast, [2, 3])
    bpy.data.lights.remove(cast.owner)
    layer().update()
    cast.assert_same()
    cast.play([4, 5])


def test_a_description_has_their_paths(cast_of, monkeypatch):
    monkeypatch.setitem(KINDS, "a socket", socket)
    cast = cast_of("a socket", True)
    read = addon_module("description.reading").read(cast.played[0])
    (row,) = [each for each in read.description["properties"] if each["path"].startswith("blocks")]
    assert row["path"].endswith(".default_value") and "materials['Paint'].node_tree" in row["path"]
    assert list(read.outside.computed) == [row["path"]] and not read.description["values"]
