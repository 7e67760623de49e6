"""In a Blender that keeps a part of its data in another way, everything has the right shape, what does not depend on
that part works as ever, and a sentence says what does not. Each part is spoilt in turn."""

import ctypes
import dataclasses
import itertools
import json
import os
import types

import bpy
import pytest

from helpers import addon_module, needs_memory
from zoo import Zoo, forget_memory

pytestmark = needs_memory
UNUSED, PLACE = "_pad", "place"
KINDS = ("absent", "another size", "another type", "moved")


def host(name):
    return addon_module(f"host.{name}")


def parts():
    """[(struct, member)] of all that any feature needs."""
    features = host("features")
    return list(dict.fromkeys(itertools.chain(*(features.needs(feature) for feature in features.FEATURES))))


def own_name(structs, kind, name):
    """The name of a part in the description of the running Blender."""
    return host("members").place_in(structs[kind]) if name == PLACE else name


def spoilt(structs, kind, name, how):
    """The description with that part spoilt, or None if that means nothing for this part."""
    struct = structs[kind]
    name = own_name(structs, kind, name)
    found = dict(struct.members)
    if name == UNUSED:
        if how != "absent":
            return None
        found = {each: place for each, place in found.items() if not each.lstrip("*").startswith(UNUSED)}
    else:
        offset, of_type, size = found.pop(name)
        listed = {**host("members").MEMBERS[kind], **host("members").PLACES}[name]
        if how == "another size":
            if listed.size is None:
                return None
            found[name] = offset, of_type, size * 2
        elif how == "another type":
            if listed.type is None:
                return None
            found[name] = offset, "int8_t" if of_type != "int8_t" else "int", size
        elif how == "moved":
            if listed.offset is None:
                return None  # wherever it is, the description says so
            found[name] = offset + 8, of_type, size
    return {**structs, kind: dataclasses.replace(struct, members=found)}


@pytest.fixture
def zoo(fresh_scene, monkeypatch):
    made = Zoo(fresh_scene)
    made.reopen()
    yield made
    monkeypatch.undo()
    forget_memory()


def look(zoo, monkeypatch, structs):
    """Has Sinew find a Blender with that description. Returns what is wrong, as sentences, and {feature: why it is
    lost}."""
    monkeypatch.setattr(host("layout"), "structs", lambda: structs)
    zoo.reopen()
    own = host("contract").lost(structs)
    lost = set(host("features").lost_with(own))
    wrong = []
    if lost != {"Native and recorded rigs"}:
        wrong = zoo.play() + zoo.differences(lost)
    was_played, more = zoo.take_over()
    if was_played == ("Native and recorded rigs" in lost):
        wrong.append(f"a character could {'' if was_played else 'not '}be played")
    return wrong + more, own


def test_all_holds_in_this_blender(zoo, monkeypatch):
    structs = host("layout").structs()
    assert look(zoo, monkeypatch, structs) == ([], {})
    assert host("contract").sentences() == []


def test_a_pose_without_an_array_of_its_bones(zoo, monkeypatch):
    """As since Blender 5.3, whose description says nothing of where it is. Nobody notices."""
    structs = host("layout").structs()
    pose = structs["bPose"]
    gone = {"*chanhash", "**chan_array", "*ikdata"}
    assert gone <= pose.members.keys() or (gone.isdisjoint(pose.members) and bpy.app.version >= (5, 3, 0))
    kept = {name: place for name, place in pose.members.items() if name not in gone}
    assert look(zoo, monkeypatch, {**structs, "bPose": dataclasses.replace(pose, members=kept)}) == ([], {})
    assert host("poses").pose_layout(True)[1] == -1
    assert host("contract").sentences() == [] and host("contract").trouble() == ""


def test_a_description_that_cannot_be_read(zoo, monkeypatch):
    """It is asked for once, because that takes long and would fail again."""
    asked = []

    def fail():
        asked.append(1)
        raise OSError("no space")

    monkeypatch.setattr(host("layout"), "structs", fail)
    zoo.forget()
    lost = set(host("features").FEATURES)
    assert zoo.play() + zoo.differences(lost) == []
    assert zoo.take_over() == (False, [])
    assert "cannot be read: no space" in host("contract").trouble()
    assert asked == [1]


def test_the_panel_and_the_command_line_say_it(zoo, monkeypatch, tmp_path, sinew):
    structs = spoilt(host("layout").structs(), "bPoseChannel", "runtime", "absent")
    monkeypatch.setattr(host("layout"), "structs", lambda: structs)
    zoo.reopen()
    told = host("contract").sentences()
    assert len(told) == 1
    assert f"Blender {bpy.app.version_string} keeps its data in another way" in told[0]
    assert "(bPoseChannel has no runtime), so B-bones are read segment by segment" in told[0]
    assert "; no rig is native or recorded: look for a newer Sinew" in told[0]
    plain = zoo.animals["plain"].ob
    assert told[0] in [advice.text for advice in addon_module("ui.advice").warnings(plain)]
    path = str(tmp_path / "zoo.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    code, out, _ = sinew("info", path, "--json")
    assert code == 0 and json.loads(out.splitlines()[-1])["unknown"] == told
    assert told[0] in sinew("info", path)[1]


@pytest.mark.parametrize("how", KINDS)
def test_each_part_that_is_spoilt_is_named(how):
    """Without a look at any shape: a part is lost with the same features, however it is spoilt."""
    structs, contract, features = host("layout").structs(), host("contract"), host("features")
    for kind, name in parts():
        found = spoilt(structs, kind, name, how)
        if found is None:
            continue
        lost = contract.lost(found)
        assert list(lost) == features.users(kind, name)
        own = "no unused byte" if name == UNUSED else "Object" if name == PLACE else name
        assert all(kind in clause and own in clause for (clause,) in lost.values())


def test_a_struct_that_is_gone_is_named():
    structs, contract, features = host("layout").structs(), host("contract"), host("features")
    for kind in {kind for kind, _name in parts()}:
        lost = contract.lost({name: struct for name, struct in structs.items() if name != kind})
        assert set(lost) == {feature for feature in features.FEATURES if kind in features.structs(feature)}
        assert all(f"there is no struct {kind}" in clauses for clauses in lost.values())


def test_each_struct_of_another_size_is_named():
    structs, contract, features = host("layout").structs(), host("contract"), host("features")
    for kind, size in host("members").SIZES.items():
        if kind in structs:
            wider = dataclasses.replace(structs[kind], size=size + 8)
            lost = contract.lost({**structs, kind: wider})
            assert set(lost) == {feature for feature in features.FEATURES if kind in features.structs(feature)}
            assert all(clauses == [f"{kind} has {size + 8} bytes instead of {size}"] for clauses in lost.values())


def test_shapes_are_right_without_each_part(zoo, monkeypatch):
    """Where SINEW_SAMPLES is set, each version tries a third of them, and another one."""
    structs, features, contract = host("layout").structs(), host("features"), host("contract")
    wrong, share = [], 3 if os.environ.get("SINEW_SAMPLES") else 1
    for number, (kind, name) in list(enumerate(parts()))[bpy.app.version[1] % share :: share]:
        kinds = KINDS[number % len(KINDS) :] + KINDS[: number % len(KINDS)]
        found = next(filter(None, (spoilt(structs, kind, name, how) for how in kinds)))
        said, lost = look(zoo, monkeypatch, found)
        wrong += [f"without {kind}.{name}, {each}" for each in said]
        sentences = contract.sentences()
        for feature in lost:
            if "Deforming" not in lost or feature == "Deforming":
                told = [each for each in sentences if features.FEATURES[feature].without in each]
                if not told or bpy.app.version_string not in told[0] or lost[feature][0] not in told[0]:
                    wrong.append(f"without {kind}.{name}, nobody says that {feature} is lost: {sentences}")
    assert not wrong, "\n".join(wrong)


# --- what is read is compared with what the API says -----------------------------------------------------


def constant(module, name, value):
    """Has a module of the room take another constant or function for the right one."""
    return lambda monkeypatch: monkeypatch.setattr(host(module), name, value)


def elsewhere(module, kind, name, function="region", by=8):
    """Has a module of the room find a member at another place than where it is."""

    def spoil(monkeypatch):
        contract = host("contract")
        known = getattr(contract, function)

        def found(*asked):
            place = known(*asked)
            if asked[-2:] != (kind, name):
                return place
            return place + by if function == "offset" else (place[0] + by, place[1])

        here = {each: getattr(contract, each) for each in vars(contract)} | {function: found}
        monkeypatch.setattr(host(module), "contract", types.SimpleNamespace(**here))

    return spoil


def shifted_bones(monkeypatch):
    known = host("poses")._bone_layout
    where = {each: known(each) for each in (False, True)}
    other = {each: (place[0], place[1] + 64, *place[2:]) for each, place in where.items()}  # pose_mat
    monkeypatch.setattr(host("poses"), "_bone_layout", lambda has: other[has])


def other_segments(monkeypatch):
    contract, known = host("contract"), host("poses")._bone_layout
    before = -8 if bpy.app.version >= (3, 0, 0) else 0  # pose matrices
    where = {each: known(each) for each in (False, True)}
    other = {False: where[False], True: (*where[True][:3], where[True][3] + before)}
    assert contract.has("B-bones")
    monkeypatch.setattr(host("poses"), "_bone_layout", lambda has: other[has])


def other_values_of_keys(monkeypatch):
    flag, value, *rest = host("key_blocks").key_layout()
    monkeypatch.setattr(host("key_blocks"), "key_layout", lambda: (flag, value - 4, *rest))  # its place in time


def shifted_vectors(monkeypatch):
    known = host("mesh_arrays").vectors_at
    monkeypatch.setattr(host("mesh_arrays"), "vectors_at", lambda address, count: known(address + 4, count))


def no_binding(name):
    def spoil(monkeypatch):
        known = host("cage_memory")._address
        monkeypatch.setattr(host("cage_memory"), "_address", lambda *asked: 0 if asked[2] == name else known(*asked))

    return spoil


def no_bound_positions(monkeypatch):
    zero = ctypes.c_uint64(0)
    contract = host("contract")
    here = {each: getattr(contract, each) for each in vars(contract)}

    def region(modifier, kind, name):
        return (ctypes.addressof(zero), 8) if name == "(*bind_coords)()" else contract.region(modifier, kind, name)

    monkeypatch.setattr(host("mesh_arrays"), "contract", types.SimpleNamespace(**here | {"region": region}))


MEANINGS = {
    "the motions of bones are not where they were": (shifted_bones, {"Poses"}),
    "the motions of segments are not where they were": (other_segments, {"B-bones"}),
    "shape keys are not where they were": (other_values_of_keys, {"Shape keys"}),
    "attributes are not where they were": (shifted_vectors, {"Meshes without shape keys", "Shape keys"}),
    "the bits of switches of modifiers have another meaning": (
        constant("modifier_memory", "_VIEWPORT", 4),
        {"Deforming"},
    ),
    "the bit that disables modifiers has another meaning": (
        constant("modifier_memory", "_ASIDE", 1 << 30),
        {"Deforming"},
    ),
    "the bits of muted drivers have another meaning": (constant("modifier_memory", "_MUTED", 1 << 5), {"Muting"}),
    "the bone of a driver's variable is not where it was": (
        elsewhere("driver_memory", "DriverTarget", "pchan_name"),
        {"Drivers of data"},
    ),
    "weights are not where they were": (constant("deform_verts", "_DEFORM_VERTICES", 9999), {"Weights"}),
    "the points of a lattice at rest are not where they were": (
        constant("cage_memory", "_FIRST_POINT", ("du", "fv", "fw")),
        {"Lattice"},
    ),
    "what Surface Deform was bound with is not where it was": (no_binding("*verts"), {"Surface Deform"}),
    "what Mesh Deform was bound with is not where it was": (no_binding("*bindcagecos"), {"Mesh Deform"}),
    "bound positions are not where they were": (no_bound_positions, {"Corrective Smooth, bound"}),
    "the matrices of objects to the world are not where they were": (
        constant("places", "_matrix_at", lambda address: [0.0] * 16),
        {"Fast path of armatures"},
    ),
    "the number of users is not where it was": (elsewhere("marks", "ID", "us"), {"Native and recorded rigs"}),
    "poses are not where they were": (
        elsewhere("poses", "bPoseChannel", "pose_head", "offset"),
        {"Native and recorded rigs"},
    ),
    "the segments of poses are not where they were": (
        constant("poses", "SIZES", {"Mat4": 60, "DualQuat": 100}),
        {"Native and recorded rigs"},
    ),
    "actions are not where they were": (elsewhere("relations", "AnimData", "*action"), {"Native and recorded rigs"}),
    "drivers have other types": (
        constant("relations", "_TYPES", {"SUM": 5, "SCRIPTED": 1}),
        {"Native and recorded rigs"},
    ),
}


def test_another_meaning_is_noticed_before_it_makes_a_wrong_shape(zoo, monkeypatch):
    wrong = []
    for difference, (spoil, expected) in MEANINGS.items():
        zoo.forget()
        with monkeypatch.context() as patch:
            spoil(patch)
            found = with_another_meaning(zoo, difference, expected)
        wrong += [f"{difference}: {each}" for each in found]
    assert not wrong, "\n".join(wrong)


def with_another_meaning(zoo, difference, expected):
    """Plays. Returns what is wrong, as sentences. difference: what Sinew has to say; expected: features that are then
    lost."""
    wrong = zoo.play()
    for each in zoo.animals.values():
        each.ob.data.update()
    wrong += zoo.play()
    was_played, more = zoo.take_over()
    contract, features = host("contract"), host("features")
    own = contract._look().lost
    if set(own) != expected or len(own) == 1 and list(own.values()) != [[difference]]:
        wrong.append(f"what is lost is {own}")
    lost = set(features.lost_with(own))
    if was_played == ("Native and recorded rigs" in lost):
        wrong.append(f"a character could {'' if was_played else 'not '}be played")
    if not any(difference in each and bpy.app.version_string in each for each in contract.sentences()):
        wrong.append(f"nobody says it: {contract.sentences()}")
    return wrong + more + zoo.differences(lost)


def test_keyframes_elsewhere_are_not_believed(zoo, monkeypatch):
    zoo.forget()
    elsewhere("keyframes", "BezTriple", "vec", "offset", 4)(monkeypatch)
    curves = addon_module("blender.animation").keyed_curves(zoo.played)
    with pytest.raises(host("contract").Broken, match="keyframes are not where they were"):
        host("keyframes").read(list(curves))
    assert set(host("contract")._look().lost) == {"Native and recorded rigs"}


@pytest.mark.parametrize(
    ("kind", "name", "by"),
    [("bPoseChannel", "limitmin", 4), ("bPoseChannel", "*parent", 8), ("bPoseChannel", "constraints", -16)]
    + [("bPoseChannel", "*prop", 8), ("Bone", "arm_mat", 4)],
)
def test_numbers_of_bones_elsewhere_are_not_believed(zoo, monkeypatch, kind, name, by):
    zoo.forget()
    ob = zoo.played
    ob.pose.bones[0]["own"] = 1
    assert host("bone_memory").read_numbers(ob) is not None
    zoo.forget()
    elsewhere("bone_memory", kind, name, "offset", by)(monkeypatch)
    assert host("bone_memory").read_numbers(ob) is None
    assert set(host("contract")._look().lost) == {"Numbers of bones"}


@pytest.mark.parametrize(("name", "by"), [("pchan_name", 1), ("transChan", 1), ("flag", 1), ("rotation_mode", -1)])
def test_variables_elsewhere_are_not_believed(zoo, monkeypatch, name, by):
    zoo.forget()
    curve = zoo.played.driver_add("color", 0)
    (variable,) = [curve.driver.variables.new()]
    variable.type = "TRANSFORMS"
    (target,) = variable.targets
    target.id, target.bone_target = zoo.played, zoo.played.pose.bones[0].name
    target.transform_type, target.transform_space, target.rotation_mode = "SCALE_X", "LOCAL_SPACE", "SWING_TWIST_Y"
    elsewhere("driver_memory", "DriverTarget", name, "offset", by)(monkeypatch)
    wanted = zoo.played, "", target.bone_target, "SCALE_X", "LOCAL_SPACE", "SWING_TWIST_Y"
    assert host("driver_memory").read_variables([curve]) == [[("var", "TRANSFORMS", [wanted])]]
    assert set(host("contract")._look().lost) == {"Drivers of native rigs"}


def test_a_character_that_is_played_is_handed_back_if_that_is_lost(zoo):
    states, contract = addon_module("played.states"), host("contract")
    zoo.reopen()
    assert zoo.play() == []
    states.take_over([zoo.rig], zoo.scene, bpy.context.view_layer)
    assert zoo.rig.is_played and zoo.play() == [] and zoo.rig.is_played
    contract.distrust("Native and recorded rigs", "something is not where it was")
    assert zoo.play() == [] and not zoo.rig.is_played


def test_each_member_is_compared_with_the_property_that_shows_it(zoo, monkeypatch):
    """Members that the API shows elsewhere than where the description says are not read."""
    contract, features = host("contract"), host("features")
    value_at, wrong = contract._value_at, []
    for kind, name in parts():
        member = host("members").MEMBERS[kind].get(name)
        if member is None or not member.shown or name == "*tmpact":
            continue
        zoo.reopen()
        compare = contract._compare

        def elsewhere(struct, of, called, address, asked=(kind, name), compare=compare):
            if (of, called) == asked:
                monkeypatch.setattr(contract, "_value_at", lambda *_: "something else")
            try:
                compare(struct, of, called, address)
            finally:
                monkeypatch.setattr(contract, "_value_at", value_at)

        monkeypatch.setattr(contract, "_compare", elsewhere)
        wrong += [f"with {kind}.{name} elsewhere, {each}" for each in zoo.play()]
        lost = contract._look().lost
        wrong += [f"{kind}.{name} elsewhere is not noticed: {lost}"] * (set(lost) != set(features.users(kind, name)))
        wrong += [f"with {kind}.{name} elsewhere, {each}" for each in zoo.differences(set(features.lost_with(lost)))]
        monkeypatch.setattr(contract, "_compare", compare)
    assert not wrong, "\n".join(wrong)
