"""One mesh of each kind that Sinew deforms, each with the features of host/features.py that it depends on. The shapes
that Blender's own modifiers give them are kept."""

from dataclasses import dataclass, field

import bpy
import numpy as np

from characters import (
    accelerate,
    add_shape_keys,
    by_keys,
    drive,
    in_a_cage,
    make_armature,
    make_cage,
    make_mesh,
    make_mesh_cage,
    make_tube,
    pose,
    smoothed,
    with_bendy_bones,
)
from helpers import addon_module, diagonal, evaluated, is_deforming, select, shortcut_of

FRAMES = range(2, 6)
ACTIONS = "Fast path of animated data"


@dataclass
class Animal:
    """A bound mesh. needs: without one of these features, Blender deforms it; stages: {modifier: features without which
    Blender evaluates it}; fast: features without which it has no shortcut."""

    ob: bpy.types.Object
    needs: tuple = ("Deforming", "Meshes without shape keys")
    stages: dict = field(default_factory=dict)
    fast: tuple = ("Fast path of armatures",)
    shapes: list = field(default_factory=list)  # [(V, 3)], on each of FRAMES


class Zoo:
    def __init__(self, scene):
        self.scene = scene
        self.armature, self.bent, self.played, self.decorated = self._armatures()
        self.animals = dict(self._animals())
        select()
        scene.frame_set(1)
        for frame in FRAMES:
            scene.frame_set(frame)
            for each in self.animals.values():
                each.shapes.append(evaluated(each.ob).copy())
        moves = {name: np.ptp(each.shapes, axis=0).max() > 0.01 for name, each in self.animals.items()}
        assert all(moves.values()), moves
        for each in self.animals.values():
            accelerate(each.ob)
        select()
        self.rig = addon_module("played.rigs").learn(self.played)
        self.features = addon_module("host.features")

    def _armatures(self):
        made = [make_armature() for _ in range(4)]
        for number, armature in enumerate(made):
            for frame in (1, 4, 7, 10):
                pose(armature, frame + 20 * number, False)
            for curve in curves_of(armature):
                for key in curve.keyframe_points:
                    key.co.x -= 20 * number
                curve.update()
        with_bendy_bones(make_mesh(made[1], False))
        bpy.data.objects.remove(bpy.data.objects["Tube"])
        return made

    def _animals(self):
        armature = self.armature
        yield "plain", Animal(make_mesh(armature, False))
        ob = make_mesh(armature, True)
        add_shape_keys(ob)
        yield "keys", Animal(ob, ("Shape keys",), fast=("Fast path of armatures", "Fast path of shape keys", ACTIONS))
        yield "B-bones", Animal(make_mesh(self.bent, False), fast=("Fast path of armatures", "B-bones"))
        ob = make_mesh(armature, False)
        smoothed(ob, iterations=3, vertex_group="bone2")
        smoothed(ob, "Smooth", "SMOOTH", iterations=2)
        yield "smoothing", Animal(ob)
        ob = make_mesh(armature, False)
        modifier = smoothed(ob, rest_source="BIND")
        with bpy.context.temp_override(object=ob, active_object=ob):
            assert bpy.ops.object.correctivesmooth_bind(modifier=modifier.name) == {"FINISHED"}
        yield "bound smoothing", Animal(ob, stages={modifier.name: ("Corrective Smooth, bound",)})
        cage = make_cage()
        by_keys(cage)
        cage.data.vertex_group = add_group_of_points(cage)
        ob = make_mesh(armature, False)
        in_a_cage(ob, cage)
        yield "lattice", Animal(ob, stages={"Lattice": ("Lattice", "Lattices with weights")})
        for number, (kind, title) in enumerate((("SURFACE_DEFORM", "Surface Deform"), ("MESH_DEFORM", "Mesh Deform"))):
            target = make_mesh_cage(armature)
            ob = make_mesh(armature, False)
            modifier = smoothed(ob, "Cage", kind, **{("target", "object")[number]: target})
            if kind == "MESH_DEFORM":
                modifier.precision = 3
            armature.data.pose_position = "REST"
            with bpy.context.temp_override(object=ob, active_object=ob):
                getattr(bpy.ops.object, ("surfacedeform_bind", "meshdeform_bind")[number])(modifier="Cage")
            armature.data.pose_position = "POSE"
            assert modifier.is_bound
            yield title, Animal(ob, stages={"Cage": (title,)})
        ob = make_mesh(armature, False)
        modifier = smoothed(ob, iterations=3)
        drive(ob, f'modifiers["{modifier.name}"].factor', "0.3 + 0.2 * var", target=armature)
        yield "driven", Animal(ob, stages={modifier.name: ("Driven settings",)})
        ob = make_mesh(armature, False)
        other = ob.copy()
        bpy.context.collection.objects.link(other)
        yield "shared", Animal(ob, fast=("Fast path of armatures", "Fast path of canvases"))
        ob = make_mesh(armature, False)
        animate_amount(ob.data)
        yield "animated", Animal(ob, fast=("Fast path of armatures", ACTIONS))
        ob = make_mesh(armature, False)
        animate_amount(ob.data)
        data = ob.data.animation_data
        data.nla_tracks.new().strips.new("Strip", 1, data.action)
        data.action = None
        yield "with a strip", Animal(ob, fast=("Fast path of armatures", "Fast path of data with NLA strips"))
        animate_amount(self.decorated.data)
        ob = make_mesh(self.decorated, False)
        yield "animated bones", Animal(ob, fast=("Fast path of armatures", ACTIONS))
        ob = make_tube()
        add_shape_keys(ob)
        yield "keys alone", Animal(ob, ("Shape keys",), fast=("Fast path of shape keys", ACTIONS))
        ob = make_mesh(armature, False)
        add_shape_keys(ob)
        ob.data.shape_keys.use_relative = False
        animate_eval_time(ob)
        yield "left to Blender", Animal(ob, ("absolute keys",))
        ob = make_mesh(self.played, False)
        with_bendy_bones(ob)
        yield "played", Animal(ob, fast=("Fast path of armatures", "B-bones"))

    # --- what is seen -----------------------------------------------------------------------------

    def play(self, frames=FRAMES):
        """Plays, and returns what is wrong, as sentences."""
        wrong = []
        for frame in frames:
            self.scene.frame_set(frame)
            for name, each in self.animals.items():
                wanted = each.shapes[frame - FRAMES[0]]
                error = float(np.abs(evaluated(each.ob) - wanted).max()) / diagonal(wanted)
                if not error < 1e-5:
                    wrong.append(f"{name} is {error:.2g} of the diagonal off on frame {frame}")
        return wrong

    def differences(self, lost):
        """Returns what does not work as the table of features says, as sentences. lost: features."""
        wrong, lost = [], {*lost, "absolute keys"}
        for name, each in self.animals.items():
            works = lost.isdisjoint(each.needs)
            if is_deforming(each.ob) != works:
                wrong.append(f"Sinew {'does not deform' if works else 'deforms'} {name}")
            if not works:
                continue
            run = addon_module("run.characters").character(each.ob).run
            for stage, needed in each.stages.items():
                if (stage in run.stages) != lost.isdisjoint(needed):
                    wrong.append(f"Sinew {'replaces' if stage in run.stages else 'does not replace'} {stage} of {name}")
            if bool(shortcut_of(each.ob)) != lost.isdisjoint(each.fast):
                wrong.append(f"{name} is {'' if shortcut_of(each.ob) else 'not '}on the fast path")
        return wrong

    def forget(self):
        """Has Sinew look at everything anew in the next evaluation, as if the file was opened in this Blender."""
        handlers = addon_module("main.handlers")
        forget_memory()
        handlers.forget()
        handlers._is_file_unknown = True
        for each in self.animals.values():
            each.ob.update_tag()
            each.ob.data.update_tag()

    def reopen(self):
        """Has Sinew look at everything anew, and evaluates."""
        self.forget()
        self.scene.frame_set(1)

    def take_over(self):
        """Takes over one of them, if that is possible, and plays. Returns whether it was played, and what is wrong, as
        sentences."""
        states = addon_module("played.states")
        states.take_over([self.rig], self.scene, bpy.context.view_layer)
        was_played, wrong = self.rig.is_played, self.play(range(4, 6))
        if was_played == bool(self.rig.reason):
            wrong.append(f"it is {'' if was_played else 'not '}played: {self.rig.reason}")
        states.hand_back([self.rig], self.scene, bpy.context.view_layer)
        return was_played, wrong


def forget_memory():
    """Discards all that is known of Blender's memory."""
    for name in ("contract", "proof"):
        addon_module(f"host.{name}").forget()
    addon_module("host.deform_verts")._weights_are_known = False


def curves_of(armature):
    return addon_module("blender.animation").keyed_curves(armature)


def add_group_of_points(cage):
    group = cage.vertex_groups.new(name="Points")
    for number in range(len(cage.data.points)):
        group.add([number], 0.3 + 0.6 * (number % 3) / 2, "REPLACE")
    return group.name


def animate_amount(data):
    """Animates a property that makes no difference to Sinew."""
    data["amount"] = 1.0
    data.keyframe_insert('["amount"]', frame=1)


def animate_eval_time(ob):
    keys = ob.data.shape_keys
    for frame, value in ((1, 0), (10, 20)):
        keys.eval_time = value
        keys.keyframe_insert("eval_time", frame=frame)
