"""Baking: what is written is what Blender shows, whoever asks for it, and everything is put back."""

import errno
import json
import os
import re

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, make_tube, pose, smoothed
from helpers import addon_module, diagonal, evaluated, select

FRAMES = range(1, 11)
FORMATS = ("pc2", "mdd")


def frame_range(words):
    return addon_module("bake.frame_range").parse(words)


def job(folder, words="1-10", **options):
    return addon_module("bake.job").Job(str(folder), frame_range(words), **options)


def bake(folder, words="1-10", **options):
    return addon_module("bake.baking").run(bpy.context, job(folder, words, **options))


def problems(path):
    return addon_module("bake.verify").problems(str(path))


def read(path):
    """(F, V, 3)"""
    subject = addon_module("bake.subject").of_cache(str(path))
    read_frame = addon_module("bake.point_cache").read_frame
    return np.array([read_frame(path, subject.layout, i) for i in range(len(subject.frames))])


def shown(ob, frames=FRAMES):
    """(F, V, 3)"""
    found = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        found.append(evaluated(ob))
    return np.array(found)


@pytest.fixture
def figure():
    """A tube by an armature, with shape keys, animated."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    add_shape_keys(ob)
    for frame in (1, 4, 7, 10):
        pose(armature, frame, True)
    ob.location = (1, 2, 3)
    for frame, angle in ((1, 0.0), (10, 2.0)):
        ob.rotation_euler.x = angle
        ob.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_set(3, subframe=0.25)
    return ob


# --- what is written ------------------------------------------------------------------------------


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("bound", (False, True))
def test_a_cache_holds_what_blender_shows(figure, tmp_path, format, bound):
    if bound:
        accelerate(figure)
    (done,) = bake(tmp_path, format=format)
    assert (done.baked, done.missing, done.vertices) == (10, 0, 1200)
    found = read(tmp_path / f"Tube.{format}")
    assert np.array_equal(found, shown(figure)) and np.ptp(found, axis=0).max() > 0.1
    assert problems(tmp_path / f"Tube.{format}") == []


def test_the_place_in_the_world_is_written(figure, tmp_path):
    bake(tmp_path, "2-8:3")
    expected = []
    for frame in (2, 5, 8):
        bpy.context.scene.frame_set(frame)
        expected.append(np.array(figure.matrix_world))
    found = np.load(tmp_path / "Tube.pc2.world.npy")
    assert np.array_equal(found, expected) and not np.array_equal(found[0], found[2])


def test_until_subdivision(figure, tmp_path):
    smoothed(figure, iterations=2)
    expected = shown(figure)
    sub = smoothed(figure, "Sub", "SUBSURF", levels=1)
    late = smoothed(figure, "Late", "SMOOTH")
    bake(tmp_path / "until", until_subdivision=True)
    assert np.array_equal(read(tmp_path / "until" / "Tube.pc2"), expected)
    assert sub.show_viewport and late.show_viewport
    bake(tmp_path / "all", "1-2")
    assert np.array_equal(read(tmp_path / "all" / "Tube.pc2"), shown(figure, (1, 2)))
    assert read(tmp_path / "all" / "Tube.pc2").shape[1] > 4000


def test_all_meshes_on_show_that_something_deforms(figure, tmp_path):
    make_tube().name = "Still"
    hidden = smoothed(make_tube(), "Smooth", "SMOOTH").id_data
    hidden.hide_viewport = True
    smoothed(make_tube(), "Smooth", "SMOOTH").id_data.name = "Smoothed"
    assert [done.name for done in bake(tmp_path, "1-2")] == ["Tube", "Smoothed"]
    assert [done.name for done in bake(tmp_path, "1-2", names=("Still",))] == ["Still"]


def test_everything_is_put_back(figure, tmp_path):
    select(figure)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.context.scene.frame_set(3, subframe=0.25)
    bake(tmp_path, "5-6")
    scene = bpy.context.scene
    assert (scene.frame_current, scene.frame_subframe, figure.mode) == (3, 0.25, "EDIT")
    bpy.ops.object.mode_set(mode="OBJECT")
    assert np.array_equal(read(tmp_path / "Tube.pc2"), shown(figure, (5, 6)))


# --- in parts -------------------------------------------------------------------------------------


def test_chunks_give_the_bytes_of_one_bake(figure, tmp_path):
    bake(tmp_path / "one")
    for words in ("7-10", "1-3", "4-6"):
        (done,) = bake(tmp_path / "many", chunk=(frame_range(words),))
    assert done.missing == 0
    names = sorted(os.listdir(tmp_path / "one"))
    assert names == sorted(os.listdir(tmp_path / "many")) and len(names) == 3
    for name in names:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "many" / name).read_bytes()


def test_a_chunk_that_is_repeated_when_all_is_done_bakes_nothing(figure, tmp_path):
    for words in ("1-5", "6-10", "1-5"):
        (done,) = bake(tmp_path, chunk=(frame_range(words),))
    assert (done.baked, done.found, done.missing) == (0, 10, 0)
    figure.data.transform(figure.matrix_world)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    with pytest.raises(ValueError, match="already exists, from another bake: remove it before the first chunk"):
        bake(tmp_path, chunk=(frame_range("1-5"),))


def test_what_was_stopped_goes_on(figure, tmp_path):
    work = addon_module("bake.baking").steps(bpy.context, job(tmp_path))
    for _ in range(6):
        next(work)
    work.close()
    assert os.listdir(tmp_path) == ["Tube.pc2.part"]
    assert "6 of 10 frames are missing (5-10)" in problems(tmp_path / "Tube.pc2")[0]
    assert bpy.context.scene.frame_subframe == 0.25
    (done,) = bake(tmp_path)
    assert (done.found, done.baked, done.missing) == (4, 6, 0)
    assert "6 of 10 frames baked, 4 already baked" in done.sentence()
    assert np.array_equal(read(tmp_path / "Tube.pc2"), shown(figure))


def test_what_is_there_is_kept_unless_told_otherwise(figure, tmp_path):
    bake(tmp_path, "1-2")
    before = (tmp_path / "Tube.pc2").read_bytes()
    with pytest.raises(ValueError, match="Tube.pc2 already exists; overwrite it, or choose another folder"):
        bake(tmp_path, "1-3")
    assert (tmp_path / "Tube.pc2").read_bytes() == before
    work = addon_module("bake.baking").steps(bpy.context, job(tmp_path, "1-3", overwrite=True))
    next(work), next(work), next(work)
    assert (tmp_path / "Tube.pc2").read_bytes() == before
    work.close()
    (done,) = bake(tmp_path, "1-3", overwrite=True)
    assert (done.found, done.baked, len(read(tmp_path / "Tube.pc2"))) == (0, 3, 3)


# --- what goes wrong ------------------------------------------------------------------------------


@pytest.mark.parametrize("format", (*FORMATS, "usd"))
def test_vertices_that_come_in_the_middle(figure, tmp_path, format, request):
    if format == "usd":
        request.getfixturevalue("usd")
    sub = smoothed(figure, "Sub", "SUBSURF", levels=0)
    for frame, levels in ((4, 0), (5, 1)):
        sub.levels = levels
        sub.keyframe_insert("levels", frame=frame)
    with pytest.raises(ValueError, match=r"Tube has 4,760 vertices on frame 5, but 1,200 before"):
        bake(tmp_path, format=format)
    if format == "usd":
        assert os.listdir(tmp_path) == []
    else:
        assert "6 of 10 frames are missing (5-10)" in problems(tmp_path / f"Tube.{format}")[0]


def test_a_full_disk(figure, tmp_path, monkeypatch):
    write_at = addon_module("bake.part_files").write_at

    def fill_up(file, data, offset):
        if bpy.context.scene.frame_current == 4:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write_at(file, data, offset)

    with monkeypatch.context() as patch:
        patch.setattr(addon_module("bake.part_files"), "write_at", fill_up)
        with pytest.raises(OSError) as caught:
            bake(tmp_path)
    assert caught.value.strerror == (
        "No space left on device; the frames before 4 are kept: bake again to continue from there"
    )
    assert bake(tmp_path)[0].found == 3


def test_a_full_disk_in_the_end(figure, tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "there")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", refuse)
        with pytest.raises(OSError) as caught:
            bake(tmp_path, "1-2")
    assert caught.value.strerror == (
        "No space left on device; the frames that were baked are kept: bake again to continue from there"
    )
    assert bake(tmp_path, "1-2")[0].found == 2


def test_a_full_disk_has_no_room_for_the_folder(figure, tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "there")

    monkeypatch.setattr(os, "makedirs", refuse)
    with pytest.raises(OSError) as caught:
        bake(tmp_path / "out")
    assert caught.value.strerror == "No space left on device: make room, or choose another folder"


def test_what_a_dead_process_has_left_goes(figure, tmp_path):
    leftovers = addon_module("bake.leftovers")
    dead = leftovers.own_name(f"{tmp_path / 'Tube.pc2'}.part").replace(str(os.getpid()), "4194399")  # beyond any
    os.mkdir(dead)
    with pytest.raises(ValueError, match="the chunk 1-20 reaches beyond"):
        bake(tmp_path, chunk=(frame_range("1-20"),))
    assert os.path.isdir(dead)
    bake(tmp_path, chunk=(frame_range("1-2"),))
    assert os.listdir(tmp_path) == ["Tube.pc2.part"]


def test_a_bake_of_another_mesh_is_not_filled(figure, tmp_path):
    work = addon_module("bake.baking").steps(bpy.context, job(tmp_path))
    for _ in range(3):
        next(work)
    work.close()
    smoothed(figure, "Sub", "SUBSURF", levels=1)
    with pytest.raises(ValueError, match="is an unfinished bake of 1,200 vertices, not of 4,760 vertices"):
        bake(tmp_path)


def test_objects_that_cannot_be_baked(figure, tmp_path):
    hidden = make_tube()
    hidden.hide_viewport = True
    for names, said in (
        (("None",), "there is no object None in the view layer ViewLayer; its meshes are Tube, Tube.001"),
        (("Rig",), "Rig is not a mesh"),
        (("Tube.001",), "Tube.001 is hidden in the viewport"),
    ):
        with pytest.raises(ValueError, match=said):
            bake(tmp_path, names=names)
    bpy.data.objects.remove(figure)
    with pytest.raises(ValueError, match="no visible mesh has modifiers or shape keys"):
        bake(tmp_path)


def test_a_switch_that_is_animated_cannot_be_left_out(figure, tmp_path):
    sub = smoothed(figure, "Sub", "SUBSURF", levels=1)
    sub.keyframe_insert("show_viewport", frame=1)
    said = (
        "Sub of Tube is switched by drivers or keyframes, so Sinew cannot switch it off: bake without Until Subdivision"
    )
    with pytest.raises(ValueError, match=said):
        bake(tmp_path, until_subdivision=True)


# --- the command ----------------------------------------------------------------------------------


@pytest.fixture
def sinew_bake(sinew):
    """Runs `sinew bake`. Returns exit code, stdout, stderr."""
    return lambda *words: sinew("bake", *words)


@pytest.fixture
def blend(figure, tmp_path):
    path = tmp_path / "a.blend"
    bpy.context.scene.frame_end = 4
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_the_command_bakes_and_verifies(sinew_bake, blend, tmp_path):
    folder = tmp_path / "out"
    verify = [blend, "-o", folder, "--verify"]
    code, _, err = sinew_bake(*verify)
    assert (code, err) == (1, "sinew: Tube.pc2 is missing\n")
    assert sinew_bake(blend, "-o", folder, "--chunk", "2-3")[0] == 0
    code, _, err = sinew_bake(*verify)
    assert (code, err) == (1, "sinew: Tube.pc2 is not finished: 2 of 4 frames are missing (1, 4)\n")
    code, out, _ = sinew_bake("-o", folder, "--json")
    assert code == 0
    (done,) = json.loads(out.splitlines()[-1])["objects"]
    assert (done["name"], done["baked"], done["found"], done["missing"]) == ("Tube", 2, 2, 0)
    code, out, _ = sinew_bake(*verify)
    assert code == 0 and out.endswith("Tube.pc2 is complete: 4 frames\n")
    code, _, err = sinew_bake(*verify, "--frames", "1-5")
    assert (code, err) == (1, "sinew: Tube.pc2 has the frames 1-4, not 1-5\n")


def test_the_command_takes_objects_by_name(sinew_bake, figure, tmp_path):
    for name in ("a,b", "c"):
        make_tube().name = name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    assert sinew_bake("-o", tmp_path / "out", "--frames", "1-2", "--objects", "Tube,c", "--objects", "a,b")[0] == 0
    assert sorted(path.name for path in (tmp_path / "out").glob("*.pc2")) == ["Tube.pc2", "a,b.pc2", "c.pc2"]


def test_an_unfinished_bake_of_an_older_file_is_not_filled(sinew_bake, blend, tmp_path):
    assert sinew_bake(blend, "-o", tmp_path / "out", "--chunk", "1-2")[0] == 0
    bpy.data.objects["Tube"].data.vertices[0].co = (9, 9, 9)
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    code, _, err = sinew_bake(blend, "-o", tmp_path / "out", "--chunk", "3-4")
    assert code == 1 and "is an unfinished bake of another state of the .blend, not of the present one" in err


@pytest.mark.parametrize(
    "words, code, said",
    [
        (["--frames", "9-1"], 2, "the last frame (1) comes before the first (9)"),
        (["--frames", "1-4", "--chunk", "3-5"], 1, "the chunk 3-5 reaches beyond the frames 1-4"),
        (["--format", "abc"], 2, "invalid choice: 'abc'"),
        (["--objects", "Nobody"], 1, "there is no object Nobody"),
        (["--chunk", "1-2", "--overwrite"], 1, "a chunk cannot overwrite"),
        (
            ["--verify", "--format", "usd"],
            1,
            "--verify is only for point caches: a USD file does not exist until it is complete",
        ),
    ],
)
def test_what_the_command_cannot_do(sinew_bake, blend, tmp_path, words, code, said):
    found, _, err = sinew_bake(blend, "-o", tmp_path / "out", *words)
    assert found == code and said in err and "Traceback" not in err


def test_a_place_that_cannot_be_written_to(sinew_bake, blend, tmp_path):
    (tmp_path / "file").write_text("")
    code, _, err = sinew_bake(blend, "-o", tmp_path / "file" / "out")
    reason = "Not a directory" if os.name == "posix" else "\\w[^:]+"  # Windows has other words
    assert code == 1 and re.fullmatch(f"sinew: {re.escape(str(tmp_path / 'file' / 'out'))}: {reason}\n", err)
    if os.name == "posix":  # whoever may write anywhere may not write there
        code, _, err = sinew_bake("-o", "/proc/sinew")
        assert code == 1 and err.startswith("sinew: /proc/sinew: ") and err.count("\n") == 1


def test_the_command_without_a_file(sinew_bake, tmp_path):
    bpy.ops.wm.read_homefile(use_empty=True)
    code, _, err = sinew_bake("-o", tmp_path)
    assert code == 1 and "no file is open: name one before --command, or after bake" in err


# --- in the interface -----------------------------------------------------------------------------


def test_the_operator_bakes_the_selected(figure, tmp_path):
    other = make_tube()
    select(figure)
    folder = str(tmp_path / "out")
    result = bpy.ops.object.sinew_bake(directory=folder, frame_start=2, frame_end=6, frame_step=2, file_format="mdd")
    assert result == {"FINISHED"}
    assert sorted(os.listdir(folder)) == ["Tube.mdd", "Tube.mdd.json", "Tube.mdd.world.npy"]
    assert np.array_equal(read(tmp_path / "out" / "Tube.mdd"), shown(figure, (2, 4, 6)))
    with pytest.raises(RuntimeError, match="Tube.mdd already exists"):
        bpy.ops.object.sinew_bake(directory=folder, frame_end=6, file_format="mdd")
    with pytest.raises(RuntimeError, match="choose a folder"):
        bpy.ops.object.sinew_bake()
    assert other.name == "Tube.001"


# --- played back ----------------------------------------------------------------------------------


def assert_plays(ob, expected, frames=FRAMES):
    found = shown(ob, frames)
    assert np.abs(found - expected).max() < 1e-6 * diagonal(expected[0])


def switches(ob):
    return [(m.name, m.type, m.show_viewport, m.show_render) for m in ob.modifiers], ob.modifiers.active.name


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("bound", (False, True))
@pytest.mark.parametrize("first", (1, -3))
def test_what_is_played_is_what_was_baked(figure, tmp_path, format, bound, first):
    smoothed(figure, iterations=2)
    figure.modifiers.active = figure.modifiers["Armature"]
    if bound:
        accelerate(figure)
    select(figure)
    frames = range(first, 11)
    expected, before = shown(figure, frames), switches(figure)
    assert bpy.ops.object.sinew_bake(
        directory=str(tmp_path), frame_start=first, frame_end=10, file_format=format, play=True
    ) == {"FINISHED"}
    bpy.data.objects["Rig"].animation_data_clear()
    figure.data.shape_keys.animation_data_clear()
    assert_plays(figure, expected, frames)
    assert not figure.modifiers["Armature"].show_viewport and not figure.modifiers["Corrective"].show_render
    with pytest.raises(RuntimeError, match=r"plays a cache: detach it first"):
        bpy.ops.object.sinew_play_cache(filepath=str(tmp_path / f"Tube.{format}"))
    assert bpy.ops.object.sinew_take_off_cache() == {"FINISHED"}
    assert switches(figure) == before and figure.sinew.is_bound == bound
    assert not figure.sinew.is_property_set("cache_kept")


@pytest.mark.parametrize("format", FORMATS)
def test_every_third_frame_with_what_lies_between(figure, tmp_path, format):
    bake(tmp_path, "1-10:3", format=format)
    expected = shown(figure, (1, 4, 7, 10))
    addon_module("bake.mesh_cache").set_up(bpy.context, figure, str(tmp_path / f"Tube.{format}"))
    assert_plays(figure, expected, (1, 4, 7, 10))
    between = (2 * expected[1] + expected[2]) / 3
    assert np.abs(shown(figure, (5,))[0] - between).max() < 1e-5 * diagonal(between)


def test_subdivision_goes_on_behind_the_cache(figure, tmp_path):
    smoothed(figure, "Sub", "SUBSURF", levels=1)
    smoothed(figure, "Late", "SMOOTH")
    expected = shown(figure)
    before = switches(figure)
    mesh_cache = addon_module("bake.mesh_cache")
    for until in (True, False):
        folder = tmp_path / str(until)
        bake(folder, until_subdivision=until)
        mesh_cache.set_up(bpy.context, figure, str(folder / "Tube.pc2"))
        names = [modifier.name for modifier in figure.modifiers if modifier.show_viewport]
        assert names == (["Sinew Cache", "Sub", "Late"] if until else ["Sub", "Sinew Cache"])
        assert_plays(figure, expected)
        assert mesh_cache.take_off(figure) == []
        assert switches(figure) == before


def test_the_file_plays_and_gives_back_after_it_was_saved(figure, tmp_path):
    select(figure)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    expected, before = shown(figure), switches(figure)
    bake(tmp_path / "out")
    assert bpy.ops.object.sinew_play_cache(filepath=str(tmp_path / "out" / "Tube.pc2")) == {"FINISHED"}
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    ob = bpy.data.objects["Tube"]
    assert ob.modifiers["Sinew Cache"].filepath.replace("\\", "/") == "//out/Tube.pc2"
    assert_plays(ob, expected)
    select(ob)
    assert bpy.ops.object.sinew_take_off_cache() == {"FINISHED"}
    assert switches(ob) == before


def test_a_modifier_that_is_gone_is_named(figure, tmp_path):
    bake(tmp_path, "1-2")
    mesh_cache = addon_module("bake.mesh_cache")
    mesh_cache.set_up(bpy.context, figure, str(tmp_path / "Tube.pc2"))
    figure.modifiers.remove(figure.modifiers["Armature"])
    assert mesh_cache.take_off(figure) == ["Armature"] and len(figure.modifiers) == 0


def test_caches_that_cannot_be_played(figure, tmp_path):
    mesh_cache = addon_module("bake.mesh_cache")
    before = switches(figure)
    sub = smoothed(figure, "Sub", "SUBSURF", levels=1)
    bake(tmp_path, "1-2")
    figure.modifiers.remove(sub)
    bake(tmp_path, "1-4", format="mdd", chunk=(frame_range("1-2"),))
    (tmp_path / "a.pc2").write_text("no cache")
    for name, said in (
        ("Tube.pc2", "Tube.pc2 has 4,760 vertices, and Tube has 1,200: it is the cache of another mesh"),
        ("Tube.mdd", "Tube.mdd is not finished: bake the missing frames first"),
        ("a.pc2", "a.pc2 is neither a PC2 nor an MDD file"),
        ("b.pc2", "there is no file"),
    ):
        with pytest.raises(ValueError, match=said):
            mesh_cache.set_up(bpy.context, figure, str(tmp_path / name))
        assert switches(figure) == before and not mesh_cache.is_on(figure)
    figure.modifiers["Armature"].keyframe_insert("show_render", frame=1)
    bake(tmp_path / "other", "1-2")
    with pytest.raises(ValueError, match="Armature of Tube is switched by drivers or keyframes: remove them first"):
        mesh_cache.set_up(bpy.context, figure, str(tmp_path / "other" / "Tube.pc2"))
    assert switches(figure) == before


def test_a_cache_of_another_program(figure, tmp_path):
    """Nothing stands beside it that says what it holds."""
    bake(tmp_path, "3-9:2")
    os.remove(tmp_path / "Tube.pc2.json")
    expected = shown(figure, (3, 5, 7, 9))
    addon_module("bake.mesh_cache").set_up(bpy.context, figure, str(tmp_path / "Tube.pc2"))
    assert_plays(figure, expected, (3, 5, 7, 9))
