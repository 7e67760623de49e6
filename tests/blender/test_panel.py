"""What the panel says in each situation, drawn into a layout that only takes notes."""

from types import SimpleNamespace

import bpy

from characters import accelerate, make_armature, make_mesh, pose
from helpers import addon_module, import_rig, select


class Notes:
    """A layout: whatever is asked of it, it notes the texts and names and goes on."""

    def __init__(self):
        self.said = []

    def __getattr__(self, name):
        def call(*arguments, text=None, **_options):
            if name in {"prop", "prop_search"}:
                owner, attribute = arguments[:2]
                assert hasattr(owner, attribute), f"{owner} has no {attribute}"
                self.said.append(owner.bl_rna.properties[attribute].name if text is None else text)
            elif name == "operator":
                assert arguments[0].partition(".")[2]
                self.said.append(arguments[0] if text is None else text)
            elif text is not None:
                self.said.append(text)
            return self
        return call


def panel():
    notes = Notes()
    addon_module("panels").SinewPanel.draw(SimpleNamespace(layout=notes), bpy.context)
    return notes.said


def test_nothing_selected():
    assert panel() == ["Select a mesh or its armature"]


def test_mesh_and_armature_before_and_after(fresh_scene):
    armature = make_armature()
    ob = make_mesh(armature, False)
    pose(armature, 1, False)
    select(ob)
    assert panel() == ["Armature deforms it", "Accelerate"]
    select(armature)
    assert panel() == ["Sinew deforms 0 of its 1 meshes", "Accelerate"]
    accelerate(ob)
    fresh_scene.frame_set(2)
    said = panel()
    assert said[-1] == "object.sinew_unbind"
    for text in ("Method", "Output", "Vertices", "1,200", "Bones", "6", "Influences", "Last Frame"):
        assert text in said
    select(armature)
    assert panel() == ["Sinew deforms 1 of its 1 meshes", "object.sinew_unbind"]


def test_mixed_modifiers_are_shown(fresh_scene):
    armature = make_armature()
    ob = make_mesh(armature, False)
    second = ob.modifiers.new("Second", "ARMATURE")
    second.object, second.use_multi_modifier = armature, True
    accelerate(ob)
    assert panel().count("Armature") == 2 and "Mixed with" in panel()


def test_an_error_stands_on_top(fresh_scene):
    ob = make_mesh(make_armature(), False)
    accelerate(ob)
    ob.modifiers.remove(ob.modifiers["Sinew"])
    fresh_scene.frame_set(2)
    assert "lost its Sinew modifier" in panel()[0]


def test_poses_of_an_imported_rig():
    import_rig("capsule")
    assert {"Mode", "Start Frame", "Speed", "object.sinew_clip_to_keyframes"} <= set(panel())
