"""Drivers of anything that read a played armature: lamps, materials, objects, modifiers, visibility. There are two of
each, which are equal on each frame: one reads the armature of the live character."""

import bpy
import pytest

from helpers import addon_module, depsgraph, needs_memory
from test_played import FRAMES, layer, opened_cast, states
from test_played_who import both

pytestmark = needs_memory


@pytest.fixture
def cast():
    return opened_cast(last=10)


def add_driver(block, path, armature, kind="SUM", expression="", index=-1, bones=("bone1", "bone3")):
    driver = block.driver_add(path, index).driver
    driver.type = kind
    if expression:
        driver.expression = expression
    for name, bone in zip("ab", bones):
        variable = driver.variables.new()
        variable.name, variable.type = name, "TRANSFORMS"
        target = variable.targets[0]
        target.id, target.bone_target = armature, bone
        target.transform_type, target.transform_space = "ROT_X", "LOCAL_SPACE"
    return driver


def linked(cast, name, data=None):
    ob = bpy.data.objects.new(name, data)
    cast.scene.collection.objects.link(ob)
    return ob


def lamp(cast, armature, *_):
    ob = linked(cast, "Lamp", bpy.data.lights.new("Lamp", "POINT"))
    add_driver(ob.data, "energy", armature)
    return lambda graph: ob.evaluated_get(graph).data.energy


def lamp_by_expression(cast, armature, *_):
    ob = linked(cast, "Lamp", bpy.data.lights.new("Lamp", "POINT"))
    add_driver(ob.data, "energy", armature, "SCRIPTED", "sin(a) * 3 - b")
    return lambda graph: ob.evaluated_get(graph).data.energy


def lamp_with_a_comment(cast, armature, *_):
    ob = linked(cast, "Lamp", bpy.data.lights.new("Lamp", "POINT"))
    add_driver(ob.data, "energy", armature, "SCRIPTED", "100 + a * 100  # watts (of two")
    return lambda graph: (ob.evaluated_get(graph).data.energy, ob.data.animation_data.drivers[0].driver.is_valid)


def material(_cast, armature, _mesh, other, _prop):
    found = bpy.data.materials.new("Skin")
    found.use_nodes = True
    socket = found.node_tree.nodes.new("ShaderNodeValue").outputs[0]
    add_driver(socket, "default_value", armature, "MAX")
    other.data.materials.append(found)
    path = socket.path_from_id("default_value")
    return lambda graph: found.evaluated_get(graph).node_tree.path_resolve(path)


def scaled_object(cast, armature, *_):
    ob = linked(cast, "Prop")
    add_driver(ob, "scale", armature, "AVERAGE", index=0)
    child = linked(cast, "Child")
    child.parent, child.location.x = ob, 1
    return lambda graph: tuple(child.evaluated_get(graph).matrix_world.translation)


def hidden_object(cast, armature, *_):
    ob = linked(cast, "Prop", bpy.data.meshes.new("Prop"))
    add_driver(ob, "hide_viewport", armature, "SCRIPTED", "a > 0.1")
    return lambda graph: ob.evaluated_get(graph).hide_viewport


def custom_property(cast, armature, *_):
    ob = linked(cast, "Prop")
    ob["x"] = 0.0
    add_driver(ob, '["x"]', armature, "MIN")
    add_driver(ob, "location", armature, "SCRIPTED", "a + c", index=2)
    target = ob.animation_data.drivers[-1].driver.variables.new()
    target.name, target.targets[0].id, target.targets[0].data_path = "c", ob, '["x"]'
    return lambda graph: (ob.evaluated_get(graph)["x"], ob.evaluated_get(graph).matrix_world.translation.z)


def modifier(_cast, armature, _mesh, other, _prop):
    found = other.modifiers.new("Round", "CAST")
    add_driver(found, "factor", armature, "SUM", bones=("bone2",))
    return lambda graph: tuple(other.evaluated_get(graph).data.vertices[7].co)


def modifier_of_a_bound_mesh(_cast, armature, mesh, *_):
    mesh.modifiers.new("Soft", "CORRECTIVE_SMOOTH").iterations = 2
    add_driver(mesh.modifiers["Soft"], "factor", armature, "SCRIPTED", "0.5 + a / 3", bones=("bone2",))
    return lambda graph: tuple(mesh.evaluated_get(graph).data.vertices[7].co)


def any_setting_of_keys(_cast, armature, _mesh, other, _prop):
    """Not only a key's value."""
    other.shape_key_add(name="Basis")
    other.shape_key_add(name="Wide").value = 0.5
    for point in other.data.shape_keys.key_blocks["Wide"].data:
        point.co *= 1.3
    add_driver(other.data.shape_keys.key_blocks["Wide"], "mute", armature, "SCRIPTED", "a > 0.1")
    return lambda graph: tuple(other.evaluated_get(graph).data.vertices[7].co)


def keyed_property(cast, armature, *_):
    """Of the armature."""
    bone = armature.pose.bones["bone2"]
    for frame, bone["cloth"] in ((1, 0.0), (10, 1.0)):
        bone.keyframe_insert('["cloth"]', frame=frame)
    armature.update_tag()  # Blender's copy does not have the property yet
    ob = linked(cast, "Prop")
    target = ob.driver_add("location", 0).driver.variables.new().targets[0]
    target.id, target.data_path = armature, 'pose.bones["bone2"]["cloth"]'
    ob.animation_data.drivers[0].driver.type = "SUM"
    return lambda graph: ob.evaluated_get(graph).matrix_world.translation.x


READERS = [
    lamp,
    lamp_by_expression,
    lamp_with_a_comment,
    material,
    scaled_object,
    hidden_object,
    custom_property,
    modifier,
    modifier_of_a_bound_mesh,
    any_setting_of_keys,
    keyed_property,
]


@pytest.mark.parametrize("make", READERS)
def test_what_drivers_make_of_a_played_armature(cast, make):
    if make is keyed_property and not addon_module("description.reading").CAN_READ:
        pytest.skip("custom properties are not recorded")
    readers = [make(cast, *each) for each in both(cast)]
    layer().update()
    cast.take_over()
    seen = set()

    def compare():
        cast.assert_same()
        ours, theirs = (reader(depsgraph()) for reader in readers)
        assert ours == theirs
        seen.add(ours)

    for frame in [*FRAMES, 4]:
        cast.scene.frame_set(frame)
        compare()
    cast.scene.frame_current = 6  # without a change of the frame
    layer().update()
    compare()
    assert cast.rig.is_played, cast.rig.reason
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].rotation_mode = "XYZ"
        armature.pose.bones["bone1"].rotation_euler.x += 0.4
    layer().update()
    compare()
    for frame in (7, 2):
        cast.scene.frame_set(frame)
        compare()
    states().take_over([cast.rig], cast.scene, layer())
    assert cast.rig.is_played, cast.rig.reason
    cast.scene.frame_set(5)
    compare()
    cast.hand_back()
    compare()
    for frame in (3, 8):
        cast.scene.frame_set(frame)
        compare()
    assert len(seen) > 1


@pytest.fixture(params=("computed", "recorded"))
def way(request):
    if request.param == "recorded":
        request.getfixturevalue("no_program")
    elif not addon_module("description.reading").CAN_READ:
        pytest.skip("rigs are no programs in this Blender")
    return request.param


def test_drivers_of_the_armature_that_depend_on_the_frame(cast, way):
    for armature, *_ in both(cast):
        driver = armature.pose.bones["side"].driver_add("location", 1).driver
        driver.type, driver.expression = "SCRIPTED", "sin(frame / 3) + frame * 0.01"
        armature.pose.bones["bone2"]["wave"] = 0.0
        driver = armature.driver_add('pose.bones["bone2"]["wave"]').driver
        driver.type, driver.expression = "SCRIPTED", "cos(frame)"
    layer().update()
    cast.take_over()
    if way == "computed":
        for frame in (2.25, 7.5):
            cast.scene.frame_set(int(frame), subframe=frame % 1)
            cast.assert_same()
    shapes = cast.play([*FRAMES, 4])
    assert cast.rig.is_played and len({tuple(each.ravel()) for each in shapes}) > 5
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].location.x += 0.4
    layer().update()
    cast.assert_same()
    cast.play([6, 2])
    states().take_over([cast.rig], cast.scene, layer())
    assert cast.rig.is_played, cast.rig.reason
    cast.play([6, 2, 9])
    driver = cast.played[0].animation_data.drivers[0].driver
    assert driver.expression == "sin(frame / 3) + frame * 0.01"
    cast.hand_back()
    cast.play()


def test_a_comment_that_blender_has_not_read_before_it_builds_relations(cast):
    """It compiles an expression once, so what is wrong with it then is wrong for good."""
    lamps = [lamp_by_expression(cast, *each) for each in both(cast)]
    layer().update()
    cast.take_over()
    drivers = [each.animation_data.drivers[0].driver for each in bpy.data.lights]
    for driver in drivers:
        driver.expression = "100 + a * 100  # watts (of two"
    states().keep_played(cast.scene, layer())
    assert cast.rig.is_played
    for frame in (3, 8):
        cast.scene.frame_set(frame)
        ours, theirs = (lamp(depsgraph()) for lamp in lamps)
        assert ours == theirs != 0
    cast.hand_back()
    assert [driver.is_valid for driver in drivers] == [True, True]


@pytest.mark.usefixtures("no_program")
def test_python_of_nothing_but_variables_is_recorded(cast):
    for armature, *_ in both(cast):
        driver = armature.pose.bones["side"].driver_add("location", 1).driver
        driver.type, driver.expression = "SCRIPTED", "(a ** 2 + (0.5, 1)[0]) / 2"
        variable = driver.variables.new()
        variable.name, variable.type = "a", "TRANSFORMS"
        target = variable.targets[0]
        target.id, target.bone_target = armature, "bone1"
        target.transform_type, target.transform_space = "ROT_X", "LOCAL_SPACE"
    assert not driver.is_simple_expression
    layer().update()
    cast.take_over()
    cast.play()
    assert cast.rig.is_played


def test_the_file_keeps_its_drivers(cast):
    lamp_by_expression(cast, *cast.played)
    lamp(cast, *cast.played)
    layer().update()

    def drivers():
        found = [each.animation_data.drivers[0].driver for each in bpy.data.lights]
        return [(each.type, each.expression, each.is_simple_expression) for each in found]

    before = drivers()
    cast.take_over()
    assert drivers() == before
    cast.hand_back()
    assert drivers() == before


def refused(cast):
    layer().update()
    cast.record()
    states().take_over([cast.rig], cast.scene, layer())
    assert not cast.rig.is_played
    return cast.rig.reason


@pytest.mark.parametrize("name", ("frame", "a b"))
def test_a_driver_whose_variables_cannot_be_in_an_expression(cast, name):
    driver = add_driver(bpy.data.lights.new("Lamp", "POINT"), "energy", cast.played[0], bones=("bone1",))
    linked(cast, "Lamp", bpy.data.lights["Lamp"])
    driver.variables[0].name = name
    if driver.variables[0].name != name:
        pytest.skip("this Blender does not allow such a name")
    assert "the driver of Energy of Lamp reads it, and its variables need other names than " + name in refused(cast)


def test_a_driver_with_a_long_expression(cast):
    linked(cast, "Lamp", bpy.data.lights.new("Lamp", "POINT"))
    add_driver(bpy.data.lights["Lamp"], "energy", cast.played[0], "SCRIPTED", "a" + " + b" * 62)
    assert "reads it, and its expression is too long" in refused(cast)


@pytest.mark.usefixtures("no_program")
def test_what_is_animated_and_not_recorded(cast):
    keyed_property(cast, *cast.played)
    reason = refused(cast)
    assert 'the driver of Location of Prop.002 reads the property "cloth" of the bone "bone2" of Rig' in reason
