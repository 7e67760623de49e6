"""Where the time goes: what is listed, and that measuring changes nothing. Never how long anything took."""

import json
from types import SimpleNamespace

import bpy
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose
from helpers import addon_module, data_counts, evaluated, make_fail, needs_memory, select, traces, twin_of
from test_panel import Notes

HAS_CLOCK = "execution_time" in bpy.types.Modifier.bl_rna.properties
# Not of the file; and the last changes when somebody reads the attribute, as this test does.
PASSING = {"is_evaluated", "execution_time", "bl_rna", "rna_type", "storage_type"}


@pytest.fixture
def figure():
    """(mesh, armature): shape keys, an Armature modifier, Corrective Smooth; animated over frames 1 to 10."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    add_shape_keys(ob)
    ob.modifiers.new("Corrective", "CORRECTIVE_SMOOTH")
    for frame in (1, 4, 7, 10):
        pose(armature, frame, False)
    bpy.context.scene.frame_set(3)
    return ob, armature


def measure(first=1, last=4):
    return addon_module("profiling.measure").run(bpy.context, first, last)


def costs_of(profile):
    return {cost.name[0]: cost for cost in profile.objects}


def parts_of(cost):
    return [(part.name, part.kind) for part in cost.parts]


def report(**options):
    """What the operator leaves for the panel."""
    assert bpy.ops.scene.sinew_profile(**options) == {"FINISHED"}
    (profile,) = addon_module("profiling.costs").last
    return profile


# --- what is in the file, all of it ---------------------------------------------------------------


def content(value, depth=0):
    """Plain values of a data-block or a part of it; of other data-blocks the names."""
    if isinstance(value, bpy.types.bpy_prop_collection):
        found = [content(each, depth) for each in value] if len(value) < 3000 else len(value)
        active = getattr(value, "active", None)
        return found, getattr(active, "name", None), getattr(value, "active_index", None)
    if isinstance(value, bpy.types.bpy_struct):
        if isinstance(value, bpy.types.ID) and depth or depth > 3:
            return getattr(value, "name", "")
        return {
            name: content(getattr(value, name), depth + 1)
            for name in value.bl_rna.properties.keys()
            if name not in PASSING
        }
    return str(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


def everything():
    kinds = ("objects", "meshes", "armatures", "shape_keys", "node_groups", "actions")
    found = {
        (kind, block.name_full): (content(block), {name: str(value) for name, value in own_properties(block)})
        for kind in kinds
        for block in getattr(bpy.data, kind)
    }
    scene = bpy.context.scene
    return found | {"frame": (scene.frame_current, scene.frame_subframe, bpy.data.scenes.keys())}


def own_properties(block):
    """Also those of the add-on, and whether they were ever set."""
    settings = getattr(block, "sinew", None)
    if settings is not None:
        yield from ((name, settings.is_property_set(name)) for name in settings.bl_rna.properties.keys())
    yield from ((name, block[name]) for name in block.keys() if name not in ("sinew", "sinew_clip", "cycles"))


def assert_unchanged(before):
    after = everything()
    assert after.keys() == before.keys()
    assert [
        (name, key, value, after[name][0][key])
        for name in before
        if name != "frame"
        for key, value in before[name][0].items()
        if value != after[name][0][key]
    ] == []
    assert after == before
    assert traces() == []


def test_content_notices_what_changes(figure):
    ob, armature = figure
    for change in (
        lambda: setattr(ob.modifiers["Corrective"], "show_viewport", False),
        lambda: setattr(ob.data.shape_keys.key_blocks["Wide"], "mute", True),
        lambda: setattr(armature.data, "pose_position", "REST"),
        lambda: setattr(ob.sinew, "source", "ARMATURE"),
        lambda: bpy.context.scene.frame_set(4, subframe=0.5),
        lambda: (
            setattr(ob.modifiers, "active", ob.modifiers["Corrective"])
            or setattr(ob.modifiers, "active", ob.modifiers["Armature"])
        ),
    ):
        before = everything()
        change()
        assert everything() != before


# --- what is listed -------------------------------------------------------------------------------


def test_each_part_of_a_character_is_listed(figure):
    ob, armature = figure
    profile = measure()
    found = costs_of(profile)
    assert set(found) == {ob.name, armature.name}
    assert parts_of(found[ob.name]) == [
        ("Shape Keys", "KEYS"),
        ("Armature", "ARMATURE"),
        ("Corrective", "CORRECTIVE_SMOOTH"),
    ]
    assert parts_of(found[armature.name]) == [("Pose", "POSE")]
    ways = [part.how for part in found[ob.name].parts]
    assert ways == ["difference", *(["Blender's clock"] * 2 if HAS_CLOCK else ["difference"] * 2)]
    assert profile.frames == [1, 2, 3, 4]


def test_the_sums_are_right_and_the_dearest_comes_first(figure):
    make_mesh(figure[1], True)
    profile = measure()
    for cost in profile.objects:
        assert cost.ms == pytest.approx(sum(part.ms for part in cost.parts))
        assert all(part.ms >= 0 for part in cost.parts)
    times = [cost.ms for cost in profile.objects]
    assert times == sorted(times, reverse=True) and len(times) == 3
    assert profile.frame_ms > 0 and profile.noise_ms > 0


@pytest.mark.skipif(not HAS_CLOCK, reason="this Blender has no clock for modifiers")
def test_blenders_clock_is_read_on_frames_that_evaluate_the_mesh_alone(figure):
    ob, _ = figure
    still = twin_of(ob)
    still.modifiers.remove(still.modifiers["Armature"])
    still.shape_key_clear()
    found = costs_of(measure())
    assert [part.ms for part in found[still.name].parts] == [0.0], "an old time counts again"
    assert all(part.ms > 0 for part in found[ob.name].parts[1:])


# --- a clock that goes as the test says ----------------------------------------------------------


@pytest.fixture
def clock(monkeypatch):
    """Has a frame take, by the clock of whole frames, what `dict` says of what it evaluates: of each armature, of what
    has keyframes or drivers that are not muted, of any frame."""
    prices, now = {"armatures": {}, "keyframes": 0.0, "drivers": 0.0, "frame": 0.0}, [0.0]
    animation = addon_module("blender.animation")

    def is_moving(curves, blocks):
        return any(not curve.mute for block in blocks for curve in curves(block))

    def tick(_scene, depsgraph):
        blocks = [block.original for block in depsgraph.ids if hasattr(block, "animation_data")]
        blocks += [ob for ob in prices["armatures"] if ob.evaluated_get(depsgraph).is_evaluated]
        now[0] += 1e-3 * (
            prices["frame"]
            + sum(ms for ob, ms in prices["armatures"].items() if ob.evaluated_get(depsgraph).is_evaluated)
            + prices["keyframes"] * is_moving(animation.keyed_curves, blocks)
            + prices["drivers"] * is_moving(animation.drivers_of, blocks)
        )

    bpy.app.handlers.frame_change_post.append(tick)
    monkeypatch.setattr(addon_module("main.whole_frames"), "perf_counter", lambda: now[0])
    yield prices
    bpy.app.handlers.frame_change_post.remove(tick)


def shared(profile):
    return {part.name: part.ms for part in profile.shared}


def listed(profile):
    """Milliseconds of all rows that are no part of another row."""
    return sum(cost.ms for cost in profile.objects) + sum(shared(profile).values()) + profile.rest[1]


def drive(keys):
    curve = keys.key_blocks["Wide"].driver_add("slider_max")
    curve.driver.expression = "2"


def test_the_list_adds_up_to_the_frame_and_has_the_rig(figure, clock):
    ob, armature = figure
    ob.modifiers.remove(ob.modifiers["Corrective"])
    drive(ob.data.shape_keys)
    clock.update(armatures={armature: 8.0}, keyframes=4.0, drivers=2.0, frame=1.0)
    profile = measure()
    assert profile.frame_ms == pytest.approx(15.0)
    assert costs_of(profile)[armature.name].ms == pytest.approx(8.0)
    assert shared(profile) == {"Keyframes": pytest.approx(4.0), "Drivers": pytest.approx(2.0)}
    name, rest = profile.rest
    assert name == "Everything else" and 0 < rest <= 1.0, "the modifiers' clocks are Blender's"
    assert listed(profile) == pytest.approx(profile.frame_ms)


def test_what_adds_up_to_more_than_the_frame_says_so(figure, clock):
    ob, armature = figure
    accelerate(ob)
    clock.update(armatures={armature: 1e-6}, frame=1e-6)  # and Sinew's own clock goes as always
    profile = measure()
    name, rest = profile.rest
    assert name == "Done at the same time" and rest < 0 and listed(profile) == pytest.approx(profile.frame_ms)
    costs = addon_module("profiling.costs")
    assert "several things at the same time" in costs.remarks(profile)[-1]
    costs.last[:] = [profile]
    assert {"Done at the same time", f"{rest:.2f} ms"} < set(drawn())


def test_an_armature_that_another_one_follows_has_its_own_number(figure, clock):
    _, first = figure
    second = make_armature()
    second.pose.bones["bone1"].constraints.new("COPY_ROTATION").target = first
    second.pose.bones["bone1"].constraints[0].subtarget = "bone2"
    third = make_armature()
    clock.update(armatures={first: 8.0, second: 4.0, third: 2.0}, frame=1.0)
    found = costs_of(measure())
    for ob, ms in ((first, 8.0), (second, 4.0), (third, 2.0)):
        assert found[ob.name].ms == pytest.approx(ms)


@pytest.mark.parametrize("hide", ["hide_viewport", "hide_set"])
def test_a_hidden_armature_is_listed_if_a_mesh_needs_it(figure, clock, hide):
    ob, armature = figure
    idle = make_armature()
    for each in (armature, idle):
        each.hide_set(True) if hide == "hide_set" else setattr(each, hide, True)
    bpy.context.view_layer.update()
    clock.update(armatures={armature: 8.0, idle: 4.0}, frame=1.0)
    clock["keyframes"] = 2.0
    profile = measure()
    found = costs_of(profile)
    assert found[armature.name].ms == pytest.approx(8.0) and idle.name not in found
    assert shared(profile) == {"Keyframes": pytest.approx(2.0)}, "also those of a hidden armature"
    accelerate(ob)
    assert costs_of(measure())[armature.name].ms == pytest.approx(8.0)


def test_keyframes_and_drivers_stand_still_while_they_are_left_out(figure):
    ob, _ = figure
    drive(ob.data.shape_keys)
    absences, rigs = addon_module("profiling.absences"), addon_module("profiling.absences")
    accelerate(ob)
    scene, graph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
    hooks = list(ob.animation_data.drivers)
    blocks = [block.original for block in graph.ids if hasattr(block, "animation_data")]
    keyed, drivers = rigs.unmuted_curves(blocks, hooks)
    assert keyed and [curve.data_path for curve in drivers] == ['key_blocks["Wide"].slider_max']
    scene.frame_set(1)
    with absences.muted(keyed):
        scene.frame_set(2)
        first = evaluated(ob)
        scene.frame_set(9)
        assert (evaluated(ob) == first).all()
    scene.frame_set(2)
    scene.frame_set(9)
    assert not (evaluated(ob) == first).all()


def test_what_is_hidden_or_switched_off_is_not_listed(figure):
    ob, armature = figure
    hidden = twin_of(ob)
    hidden.hide_viewport = True
    ob.modifiers["Corrective"].show_viewport = False
    found = costs_of(measure())
    assert set(found) == {ob.name, armature.name}
    assert "Corrective" not in [part.name for part in found[ob.name].parts]


def test_objects_in_instances_are_listed(figure):
    ob, armature = figure
    collection = bpy.data.collections.new("Figure")
    for each in figure:
        bpy.context.scene.collection.objects.unlink(each)
        collection.objects.link(each)
    empty = bpy.data.objects.new("Instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    bpy.context.scene.collection.objects.link(empty)
    assert set(costs_of(measure())) == {ob.name, armature.name}


def test_keys_of_several_objects_are_measured_once_and_shared(figure):
    ob, _ = figure
    other = ob.copy()
    bpy.context.scene.collection.objects.link(other)
    found = costs_of(measure())
    keys = [next(part for part in found[each.name].parts if part.kind == "KEYS") for each in (ob, other)]
    assert keys[0].ms == keys[1].ms


@needs_memory
def test_a_bound_mesh_shows_sinews_own_time(figure):
    ob, _ = figure
    ob.modifiers.remove(ob.modifiers["Corrective"])
    accelerate(ob)
    cost = costs_of(measure())[ob.name]
    assert cost.is_bound and cost.saves is None and cost.reason == ""
    assert ("Sinew", "SINEW") in parts_of(cost)
    assert not {("Shape Keys", "KEYS"), ("Armature", "ARMATURE")} & set(parts_of(cost))
    assert ob.sinew.is_bound


@needs_memory
def test_a_bound_mesh_that_blender_deforms_says_so_and_lists_the_modifier(figure):
    ob, _ = figure
    accelerate(ob)
    ob.data.shape_keys.use_relative = False
    bpy.context.view_layer.update()
    cost = costs_of(measure())[ob.name]
    assert cost.is_bound and "absolute" in cost.reason
    assert ("Armature", "ARMATURE") in parts_of(cost)


@needs_memory
def test_accelerate_is_tried_and_what_it_saves_is_a_number(figure):
    ob, armature = figure
    found = costs_of(measure())
    assert found[ob.name].saves.ms >= 0 and found[ob.name].saves.noise_ms > 0 and found[ob.name].reason == ""
    assert found[armature.name].saves is None and found[armature.name].reason == ""


# --- sentences ------------------------------------------------------------------------------------

NOTHING = "nothing deforms it that Sinew could take over"


def only_solid(ob):
    ob.modifiers.clear()
    ob.shape_key_clear()
    ob.modifiers.new("Solid", "SOLIDIFY")


def reason_of(ob):
    cost = costs_of(measure())[ob.name]
    assert cost.saves is None
    return cost.reason


def test_why_a_mesh_cannot_be_bound_is_said(figure):
    ob, _ = figure
    for group in list(ob.vertex_groups):
        group.name = f"no {group.name}"
    assert "No vertex group of Tube is named after a deforming bone" in reason_of(ob)


@needs_memory
def test_why_blender_would_go_on_deforming_is_said(figure):
    ob, _ = figure
    ob.data.shape_keys.use_relative = False
    assert "are absolute" in reason_of(ob)


def test_a_mesh_without_armature_says_so(figure):
    ob, _ = figure
    only_solid(ob)
    assert reason_of(ob) == NOTHING


@needs_memory
def test_a_mesh_without_armature_is_tried_as_well(figure):
    ob, _ = figure
    ob.modifiers.remove(ob.modifiers["Armature"])
    cost = costs_of(measure())[ob.name]
    assert cost.saves.ms >= 0 and cost.reason == "" and not ob.sinew.is_bound
    assert bpy.ops.object.sinew_accelerate_one(name=ob.name) == {"FINISHED"}
    assert ob.sinew.is_bound and ob.sinew.armature is None


def test_keys_that_cannot_be_muted_say_why(figure):
    ob, _ = figure
    keys = ob.data.shape_keys
    keys.key_blocks["Wide"].keyframe_insert("mute", frame=1)
    part = costs_of(measure())[ob.name].parts[0]
    assert (part.ms, part.how) == (None, "their muting is animated")
    ob.show_only_shape_key = True
    keys.use_relative = False
    assert costs_of(measure())[ob.name].parts[0].how == "absolute keys cannot be muted"


def test_a_modifier_after_subdivision_is_said(figure):
    ob, _ = figure
    bpy.context.preferences.system.use_gpu_subdivision = True
    ob.modifiers.new("Sub", "SUBSURF").levels = 1
    ob.modifiers.new("Late", "SMOOTH")
    (remark,) = costs_of(measure())[ob.name].remarks
    assert remark.startswith("Late comes after Sub, so the processor has to subdivide")
    ob.modifiers["Late"].show_viewport = False
    (remark,) = costs_of(measure())[ob.name].remarks
    assert remark.startswith("Sub runs on the graphics card")


def test_nothing_is_said_of_subdivision_where_the_preferences_leave_it_to_the_processor(figure):
    ob, _ = figure
    ob.modifiers.new("Sub", "SUBSURF").levels = 1
    ob.modifiers.new("Late", "SMOOTH")
    bpy.context.preferences.system.use_gpu_subdivision = False
    try:
        assert costs_of(measure())[ob.name].remarks == []
    finally:
        bpy.context.preferences.system.use_gpu_subdivision = True


# --- nothing changes ------------------------------------------------------------------------------


def test_nothing_changes_in_the_file(figure):
    ob, armature = figure
    plain = make_mesh(armature, True)  # goes through an attribute
    plain.modifiers.new("Sub", "SUBSURF").levels = 1
    plain.modifiers.new("Late", "SMOOTH")
    for each in (ob, plain):
        each.modifiers.active = each.modifiers["Armature"]
    bpy.context.scene.frame_set(3, subframe=0.25)
    select(plain)
    before, counts = everything(), data_counts()
    measure()
    assert_unchanged(before)
    assert data_counts() == counts
    assert bpy.context.active_object == plain and bpy.context.selected_objects == [plain]


def test_a_mesh_that_was_bound_once_keeps_what_it_knows_of_that(figure):
    ob, armature = figure
    accelerate(ob)
    bpy.ops.object.sinew_unbind()
    assert ob.sinew.last_armature == armature
    before = everything()
    measure()
    assert_unchanged(before)


def test_stopping_at_any_step_changes_nothing(figure):
    figure[0].modifiers.new("Sub", "SUBSURF").levels = 1
    figure[0].modifiers.active = figure[0].modifiers["Armature"]
    bpy.context.view_layer.update()
    before = everything()
    steps = addon_module("profiling.measure").steps
    count = sum(1 for _ in steps(bpy.context, 1, 4))
    assert count > 4
    for stop in range(1, count):
        work = steps(bpy.context, 1, 4)
        for _ in range(stop):
            next(work)
        work.close()
        assert_unchanged(before)


def test_simulations_are_not_switched_off(figure, monkeypatch):
    """They would lose the frames that they have in memory."""
    ob, _ = figure
    ob.modifiers.new("Cloth", "CLOTH")
    ob.modifiers.new("Sub", "SUBSURF").levels = 1
    module, seen = addon_module("profiling.measure"), []
    play = module._play

    def noting(*arguments):
        seen.append((ob.modifiers["Cloth"].show_viewport, ob.modifiers["Sub"].show_viewport))
        return play(*arguments)

    monkeypatch.setattr(module, "_play", noting)
    cost = costs_of(measure())[ob.name]
    assert set(seen) == {(True, True), (True, False)}
    assert ob.modifiers["Sub"].show_viewport
    part = next(part for part in cost.parts if part.name == "Cloth")
    assert part.how == ("Blender's clock" if HAS_CLOCK else "simulations are not switched off")


@needs_memory
@pytest.mark.parametrize("absent", ["scene_of", "muted", "switched_off", "bound_for_now"])
def test_an_error_while_something_is_absent_changes_nothing(figure, monkeypatch, absent):
    module = addon_module("main.whole_frames")
    if absent == "switched_off" and HAS_CLOCK:
        pytest.skip("this Blender has a clock for modifiers")
    before = everything()
    frame_times, running = module.frame_times, []

    def note(original):
        def wrapped(what):
            running.append(True)
            return original(what)

        return wrapped

    def fail(*arguments):
        if running:
            raise RuntimeError("told to fail")
        return frame_times(*arguments)

    absences = addon_module("profiling.absences")
    monkeypatch.setattr(absences, absent, note(getattr(absences, absent)))
    monkeypatch.setattr(module, "frame_times", fail)
    with pytest.raises(RuntimeError, match="told to fail"):
        measure()
    assert_unchanged(before)


def test_a_linked_character_is_measured_and_stays_as_it_is(figure, tmp_path):
    ob, armature = figure
    path = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(str(path), link=True) as (_, wanted):
        wanted.objects = ["Tube", "Rig"]
    for each in wanted.objects:
        bpy.context.scene.collection.objects.link(each)
    bpy.context.scene.frame_set(2)
    before = everything()
    profile = measure()
    cost = costs_of(profile)["Tube"]
    assert cost.name[1] is not None and "linked from another file" in cost.reason and cost.saves is None
    assert parts_of(cost)[0] == ("Shape Keys", "KEYS")
    assert_unchanged(before)


# --- operators ------------------------------------------------------------------------------------


def test_the_operator_plays_what_playing_shows(figure):
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 2, 6
    assert report().frames == [2, 3, 4, 5, 6]
    scene.use_preview_range, scene.frame_preview_start, scene.frame_preview_end = True, 4, 5
    assert report().frames == [4, 5]
    assert report(frame_start=1, frame_end=3).frames == [1, 2, 3]
    assert scene.frame_current == 3


def drawn():
    notes = Notes()
    addon_module("ui.profile").SidebarProfile.draw(SimpleNamespace(layout=notes), bpy.context)
    return notes.said


@needs_memory
def test_the_panel_lists_them_with_a_button_or_the_reason(figure):
    ob, armature = figure
    assert drawn() == ["scene.sinew_profile"]
    bare = twin_of(ob)
    only_solid(bare)
    report(frame_start=1, frame_end=2)
    said = drawn()
    for text in (ob.name, armature.name, "Shape Keys", "Corrective", "Pose", "Accelerate", NOTHING):
        assert text in said
    assert said.count("object.sinew_accelerate_one") == 1
    accelerate(ob)
    assert "Accelerated since: measure again" in drawn() and "object.sinew_accelerate_one" not in drawn()
    bpy.data.objects.remove(bare)
    assert NOTHING not in drawn()


def test_the_panel_lists_the_dearest(figure, monkeypatch):
    monkeypatch.setattr(addon_module("ui.profile"), "MOST_OBJECTS", 1)
    report(frame_start=1, frame_end=2)
    assert "1 more object" in drawn()


def test_another_file_has_no_profile(figure):
    report(frame_start=1, frame_end=2)
    bpy.ops.wm.read_homefile(use_empty=True)
    assert addon_module("profiling.costs").last == []


def test_bad_input_is_said(figure):
    with pytest.raises(RuntimeError, match=r"the last frame \(1\) comes before the first \(9\): swap them"):
        bpy.ops.scene.sinew_profile(frame_start=9, frame_end=1)
    with pytest.raises(RuntimeError, match="Nobody no longer exists: measure again"):
        bpy.ops.object.sinew_accelerate_one(name="Nobody")
    for ob in list(bpy.data.objects):
        bpy.data.objects.remove(ob)
    with pytest.raises(
        RuntimeError, match="nothing visible has bones, shape keys or modifiers: show what you want to measure"
    ):
        bpy.ops.scene.sinew_profile()


def test_a_scene_without_meshes_is_measured():
    armature = make_armature()
    assert list(costs_of(measure())) == [armature.name]


def test_the_button_accelerates_the_mesh_of_its_row(figure):
    ob, armature = figure
    select(armature)
    assert bpy.ops.object.sinew_accelerate_one(name=ob.name) == {"FINISHED"}
    assert ob.sinew.is_bound
    with pytest.raises(RuntimeError, match="is not a mesh"):
        bpy.ops.object.sinew_accelerate_one(name=armature.name)


@needs_memory
@pytest.mark.says_errors
def test_a_mesh_that_sinew_fails_on_says_so(figure, monkeypatch):
    ob, _ = figure
    accelerate(ob)
    make_fail(monkeypatch, ob.name)
    bpy.context.scene.frame_set(5)
    assert costs_of(measure())[ob.name].reason == "It was told to fail"


# --- the command line -----------------------------------------------------------------------------


def test_the_command_line_lists_them(figure, sinew, tmp_path):
    path = tmp_path / "figure.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    saved = path.read_bytes()
    code, out, err = sinew("info", "--profile", path, "--frames", "2-5")
    assert (code, err) == (0, "")
    assert f"{path}, 4 frames from 2 to 5: " in out and "Tube" in out and "  Shape Keys" in out and "  Pose" in out
    code, out, err = sinew("info", path, "--profile", "--json")
    document = json.loads(out.splitlines()[-1])
    assert (code, len(document["frames"])) == (0, 40)
    assert {each["name"] for each in document["objects"]} == {"Tube", "Rig"}
    assert path.read_bytes() == saved


def test_the_command_line_says_what_is_wrong(sinew, tmp_path):
    path = tmp_path / "empty.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    assert sinew("info", "--profile", path, "--frames", "9-1")[0] == 2
    assert sinew("info", "--profile", path, "--frames", "all")[0] == 2
    assert sinew("info", "--profile", path)[::2] == (
        1,
        "sinew: nothing visible has bones, shape keys or modifiers: show what you want to measure\n",
    )
    assert sinew("info", path, "--frames", "1-2")[::2] == (1, "sinew: --frames needs --profile\n")
    code, _, err = sinew("info", "--profile", tmp_path)
    assert code == 1 and "--profile needs a .blend" in err
