"""What the tests in Blender share."""

import ctypes
import importlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "rigs"
# Runs another Blender like this one. For the Python module, as_blender.py has said where it is.
COMMAND = [bpy.app.binary_path] if bpy.app.binary_path else [sys.executable, os.environ["AS_BLENDER"]]
BY_WINE = sys.platform == "win32" and hasattr(ctypes.CDLL("ntdll"), "wine_get_version")
# For tests that have Blender read a file by mapping it into memory.
maps_files = pytest.mark.skipif(
    BY_WINE and bpy.app.version >= (5, 0, 0),
    reason="Wine 8 maps no files for Blender 5.0 and later, which reads pictures and OBJ files that way",
)
# For tests that need more of the program than its scripts.
needs_program = pytest.mark.skipif(not bpy.app.binary_path, reason="this Blender is but a Python module")
needs_rig_programs = pytest.mark.skipif(bpy.app.version < (4, 2, 0), reason="rigs are programs from Blender 4.2 on")
# With SINEW_SAFE=1, shapes have to be right, and nothing may fail. A test that asks whether, or how, Sinew deforms is
# skipped from there on.
IS_SAFE = os.environ.get("SINEW_SAFE", "0") not in ("", "0")
WITHOUT_MEMORY = "without Blender's memory, Blender's own modifiers deform and Blender evaluates all rigs"
needs_memory = pytest.mark.skipif(IS_SAFE, reason=WITHOUT_MEMORY)
RIGS = {
    "capsule": ROOT / "data/capsule/skeleton.bf",
    "ogre": ROOT / "data/ogre/skeleton.bf",
    "shared ogre": SHARED / "ogre/skeleton.bf",
    "shared elephant": SHARED / "elephant/skeleton.tgf",
}


def addon_module(name):
    """A module of the add-on, under whichever name this Blender installed it."""
    package = bpy.types.VIEW3D_PT_sinew.__module__.rpartition(".ui.")[0]
    return importlib.import_module(f"{package}.{name}")


def deform_small_meshes():
    """Has Sinew deform meshes that it would leave to Blender as too small to gain: most of the tests'."""
    addon_module("plan.ways").FEWEST_VERTICES = {}


def import_rig(name="capsule", **options):
    """Import one of RIGS through the operator. Returns the mesh object and its armature."""
    path = RIGS[name]
    if not path.exists():
        pytest.skip(f"{path} is not there")
    if name in ("capsule", "ogre"):
        options.setdefault("pose", "walk.dmat")
    assert bpy.ops.import_scene.sinew_rig(filepath=str(path), **options) == {"FINISHED"}
    ob = bpy.context.active_object
    return ob, ob.sinew.armature


def copied_rig(tmp_path, name="capsule"):
    """A rig folder that a test may spoil."""
    folder = tmp_path / name
    shutil.copytree(RIGS[name].parent, folder)
    return folder


def depsgraph():
    return bpy.context.evaluated_depsgraph_get()


def address_of(struct, kind, name):
    """Where Blender has a member of a struct, whether its API shows it or not. kind: the struct's name there."""
    return struct.as_pointer() + addon_module("host.layout").structs()[kind].offset(name)


def evaluated(ob, graph=None):
    """(V, 3): positions as Blender shows them, space of the object."""
    mesh = ob.evaluated_get(graph or depsgraph()).data
    positions = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", positions)
    return positions.reshape(-1, 3)


def end_without_memory(*deforms):
    """Ends a test with SINEW_SAFE=1. deforms: whether Sinew deforms."""
    if IS_SAFE:
        assert not any(deforms)
        pytest.skip(WITHOUT_MEMORY)


def way(ob):
    """Which way a bound mesh goes, once Blender has evaluated it: "ATTRIBUTE", "KEYS" or "BLENDER"."""
    entry = addon_module("run.characters").character(ob)
    end_without_memory(entry.way.kind != "BLENDER")
    assert entry.way.kind == "BLENDER" or entry.is_wired
    return entry.way.kind


def is_deforming(ob):
    """Whether Sinew deformed a bound mesh in its last evaluation."""
    deforms = addon_module("run.characters").character(ob).is_deforming
    end_without_memory(deforms)
    return deforms


def own_positions(ob):
    """(V, 3): the mesh's own vertices."""
    return addon_module("blender.meshes").read_positions(ob.data)


def diagonal(positions):
    return float(np.linalg.norm(np.ptp(positions, axis=0)))


def twin_of(ob):
    """The same object with data of its own."""
    copy = ob.copy()
    copy.data = ob.data.copy()
    bpy.context.collection.objects.link(copy)
    return copy


def builtin_copy(ob, preserve_volume=None):
    """A copy of the bound mesh that Blender's own Armature modifier deforms."""
    copy = twin_of(ob)
    addon_module("install.bind").unbind(copy)
    modifier = next(m for m in copy.modifiers if m.type == "ARMATURE")
    if preserve_volume is None:
        preserve_volume = ob.sinew.method == "DUAL_QUATERNION"
    modifier.use_deform_preserve_volume = preserve_volume
    return copy


def assert_same_shape(ob, reference, tolerance=1e-5):
    """Both evaluated shapes agree to a share of the bounding box's diagonal."""
    ours, theirs = evaluated(ob), evaluated(reference)
    error = float(np.abs(ours - theirs).max()) / diagonal(theirs)
    assert error < tolerance, f"{error:.3g} of the diagonal"


def add_hair(ob):
    ob.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = ob.particle_systems[0].settings
    settings.type, settings.count = "HAIR", 50
    ob.particle_systems[0].seed = 3


def assert_same_hair(ob, reference):
    """The hair of both, as add_hair gives it, grows in the same places."""
    roots = [
        [tuple(particle.location) for particle in each.evaluated_get(depsgraph()).particle_systems[0].particles]
        for each in (ob, reference)
    ]
    assert len(roots[0]) == 50 and np.abs(np.array(roots[0]) - np.array(roots[1])).max() < 1e-4


def stages(ob):
    """Names of the modifiers of the run that Sinew stands in for, but for Armature modifiers."""
    end_without_memory()
    return list(addon_module("run.characters").character(ob).run.stages)


def end(ob):
    """(name of the modifier at which the run ends, why)."""
    end_without_memory()
    run = addon_module("run.characters").character(ob).run
    return run.end, run.reason


def assert_same_on_all_frames(scene, ob, twin, frames=range(1, 21)):
    for frame in frames:
        scene.frame_set(frame)
        assert_same_shape(ob, twin)


def reopened(folder, *objects):
    """Saves the file into the folder, opens it again and returns the objects."""
    path, names = str(folder / "reopened.blend"), [ob.name for ob in objects]
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    return [bpy.data.objects[name, None] for name in names]


def assert_plays_without_the_addon(folder, ob, twin):
    """Saves the file into the folder. There, ob plays as its twin, on frames 1 to 20, and without a word."""
    path, script = folder / "played.blend", folder / "played.py"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    script.write_text(
        "import bpy, numpy as np\n"
        f"bpy.ops.wm.open_mainfile(filepath={str(path)!r})\n"
        f"ob, twin = bpy.data.objects[{ob.name!r}], bpy.data.objects[{twin.name!r}]\n"
        "assert not hasattr(ob, 'sinew')\n"
        "def shape(ob):\n"
        "    mesh = ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data\n"
        "    co = np.empty(3 * len(mesh.vertices), np.float32)\n"
        "    mesh.vertices.foreach_get('co', co)\n"
        "    return co\n"
        "shapes = []\n"
        "for frame in (9, *range(1, 21)):\n"
        "    if shapes:\n"
        "        bpy.context.scene.frame_set(frame)\n"
        "    shapes.append(shape(ob))\n"
        "    assert np.array_equal(shapes[-1], shape(twin)), frame\n"
        "assert np.ptp(shapes, axis=0).max() > 0.1\n"
    )
    profile = folder / "a profile without add-ons"
    profile.mkdir()
    result = subprocess.run(
        [*COMMAND, "-b", "--factory-startup", "--python-exit-code", "1", "--python", str(script)],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(profile)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    # Debian's 5.2 prints a traceback of its own extension manager; ours would name us.
    assert "sinew" not in (result.stdout + result.stderr).replace(str(folder), "")


def make_fail(monkeypatch, name):
    """Has the deformation of the mesh object of that name fail from now on."""
    chain = addon_module("chain.chain").Chain
    poses = chain.poses

    def fail(own, ob, *arguments):
        if ob.name == name:
            raise RuntimeError("It was told to fail")
        return poses(own, ob, *arguments)

    monkeypatch.setattr(chain, "poses", fail)
    monkeypatch.setattr(addon_module("run.fast_path").FastPath, "run", lambda *_: False)


def shortcut_of(ob, graph=None):
    """Returns the shortcut of an object's evaluated copy, or None."""
    known = addon_module("run.graph_copies").at(ob.evaluated_get(graph or depsgraph()).as_pointer())
    found = known and known.fast_path.shortcut
    end_without_memory(found)
    return found


def override(linked):
    """Overrides a linked collection and all in it, in the scene. Returns the new collection."""
    scene = bpy.context.scene
    found = linked.override_hierarchy_create(scene, bpy.context.view_layer)
    if found is None:  # since 5.3, only what is in the scene
        scene.collection.children.link(linked)
        found = linked.override_hierarchy_create(scene, bpy.context.view_layer)
        if linked.name in scene.collection.children:
            scene.collection.children.unlink(linked)
    return found


def into_a_shot(folder, overridden):
    """Saves the open file as a library, and in an empty one links its collection "Character" or overrides it.
    Returns the scene."""
    path = str(folder / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    with bpy.data.libraries.load(path, link=True) as (_, to):
        to.collections = ["Character"]
    if overridden:
        override(to.collections[0])
    else:
        scene.collection.children.link(to.collections[0])
    return scene


def select(*objects):
    for ob in bpy.context.selected_objects:
        ob.select_set(False)
    for ob in objects:
        ob.select_set(True)
    bpy.context.view_layer.objects.active = objects[0] if objects else None


def traces():
    """What Sinew has left in the file, after what a timer does in a window."""
    addon_module("main.handlers").look_into_the_mail()
    names = [group.name for group in bpy.data.node_groups if "Sinew" in group.name]
    return names + [name for ob in bpy.data.objects for name in traces_of(ob)]


def traces_of(ob):
    """What it has left on an object."""
    names = [name for name in ob.keys() if name == "sinew_anchor"]
    names += [modifier.name for modifier in ob.modifiers if "Sinew" in modifier.name]
    names += [
        curve.data_path
        for curve in (ob.animation_data.drivers if ob.animation_data else ())
        for variable in curve.driver.variables
        if "sinew" in variable.targets[0].data_path
    ]
    if ob.type == "MESH":
        names += [name for name in ob.data.attributes.keys() if "sinew" in name or name == "rest_position"]
    return names + ([ob.name] if ob.sinew.copied_from else [])


def data_counts():
    return {
        name: len(getattr(bpy.data, name))
        for name in ("objects", "meshes", "armatures", "materials", "node_groups", "actions", "images")
    }
