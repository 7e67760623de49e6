"""Cloth, soft bodies, particles and rigid bodies on characters whose rigs are computed: they are simulated as on a live
one, to the bit, and do not begin anew. The second character of the cast stays live."""

import bpy
import numpy as np
import pytest

from helpers import depsgraph, evaluated, needs_memory, needs_rig_programs, select
from test_accelerated_rigs import accelerate, accelerating, keep_live, wait
from test_played import Cast, layer, states
from test_played_who import both
from test_same_pass import make_grid
from zoo import curves_of

pytestmark = [needs_rig_programs, needs_memory]
LAST = 14


def cloth(ob):
    pins = ob.vertex_groups.new(name="pins")
    pins.add(range(len(ob.data.vertices) - 200), 1.0, "REPLACE")
    modifier = ob.modifiers.new("Cloth", "CLOTH")
    modifier.settings.vertex_group_mass = "pins"
    modifier.collision_settings.use_collision = False
    return lambda: evaluated(ob)


def soft_body(ob):
    ob.modifiers.new("Soft", "SOFT_BODY").settings.goal_default = 0.3
    return lambda: evaluated(ob)


def particles(ob):
    ob.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = ob.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 50, 1, 8, 100
    return lambda: np.array([each.location for each in ob.evaluated_get(depsgraph()).particle_systems[0].particles])


def hair(ob, is_dynamic=False):
    ob.modifiers.new("Hair", "PARTICLE_SYSTEM")
    system = ob.particle_systems[0]
    system.settings.type, system.settings.count, system.use_hair_dynamics = "HAIR", 50, is_dynamic

    def look():
        shown = ob.evaluated_get(depsgraph())
        co = shown.particle_systems[0].co_hair
        return np.array([co(object=shown, particle_no=number, step=3) for number in range(50)])

    return look


def dynamic_hair(ob):
    return hair(ob, True)


def falling_on(ob):
    """Cloth that falls on the body."""
    ob.modifiers.new("Collision", "COLLISION")
    sheet = make_grid(turn=True)
    sheet.location = (0, 0.55, 2)
    modifier = sheet.modifiers.new("Cloth", "CLOTH")
    modifier.collision_settings.collection = bpy.data.collections.new("Meets")
    modifier.collision_settings.collection.objects.link(ob)
    return lambda: evaluated(sheet)


def rigid_body(prop):
    """A ball that falls on what hangs on a bone. Each character has a world of its own."""
    grid = make_grid()
    prop.data = grid.data
    bpy.data.objects.remove(grid)
    ball = make_grid("Ball", 0.5)
    number = sum(each.name.startswith("Ball") for each in bpy.data.objects)
    for ob in prop, ball:
        ob.location.z += 1.0 if ob == ball else 0.0
        select(ob)
        bpy.ops.rigidbody.object_add(type="ACTIVE" if ob == ball else "PASSIVE")
        ob.rigid_body.kinematic = ob == prop
        ob.rigid_body.collision_collections = [layer == number for layer in range(20)]
    return lambda: np.array(ball.evaluated_get(depsgraph()).matrix_world)


class Simulated(Cast):
    """A cast with something simulated on each character, on an object that `number` says."""

    def __init__(self, scene, simulate, number):
        super().__init__(scene)
        self.looks = [simulate(each[number]) for each in both(self)]
        # Another evaluation on the same frame, as when it is accelerated, changes dynamic hair by up to 0.004.
        self.tolerance = 0.01 if simulate == dynamic_hair else 0
        keep_live(self)

    def assert_same(self):
        super().assert_same()
        ours, theirs = (look() for look in self.looks)
        assert np.allclose(ours, theirs, rtol=0, atol=self.tolerance, equal_nan=True)


BODY, OTHER, PROP = 1, 2, 3  # in a character: the bound mesh, one that Blender deforms, one that hangs on a bone
SIMULATED = (cloth, soft_body, particles, hair, dynamic_hair)
REFUSED = (hair, OTHER)  # nothing has Blender evaluate it on each frame
CASES = [(simulate, number) for simulate in SIMULATED for number in (BODY, OTHER) if (simulate, number) != REFUSED]
CASES += [(falling_on, BODY), (falling_on, OTHER), (rigid_body, PROP)]


@pytest.fixture(autouse=True)
def small_rigs(monkeypatch, fresh_scene):
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 0)
    fresh_scene.frame_start, fresh_scene.frame_end = 1, LAST


@pytest.fixture(
    params=CASES, ids=lambda case: f"{case[0].__name__} on {('', 'the body', 'another', 'a prop')[case[1]]}"
)
def cast(fresh_scene, request):
    return Simulated(fresh_scene, *request.param)


def test_it_is_simulated_as_on_a_live_character(cast):
    """As far as the last frame it moves, on others it does not begin anew."""
    accelerate(cast)
    cast.play(range(1, 8))
    ours = cast.looks[0]()
    cast.play(range(8, LAST + 1))
    assert cast.rig.is_played
    assert not np.array_equal(cast.looks[0](), ours)
    cast.play([3, 4, 20, 1, 2])


def pose_by_hand(cast, distance=0.1):
    for armature, *_ in both(cast):
        armature.pose.bones["bone2"].location.x += distance


def edit_a_key(cast):
    """On another frame."""
    for armature, *_ in both(cast):
        armature.pose.bones["bone3"].location.x += 0.2
        armature.pose.bones["bone3"].keyframe_insert("location", frame=8)


def edit_a_key_of_this_frame(cast):
    for armature, *_ in both(cast):
        for curve in curves_of(armature):
            curve.keyframe_points[1].co[1] += 0.05
            curve.update()


def edit_and_take_back(cast):
    pose_by_hand(cast)
    layer().update()
    pose_by_hand(cast, -0.1)


@pytest.mark.parametrize(
    "edit", (pose_by_hand, edit_a_key, edit_a_key_of_this_frame, edit_and_take_back), ids=lambda edit: edit.__name__
)
@pytest.mark.sampled(3)
@pytest.mark.parametrize("is_updated", (True, False), ids=("updated", "at once"))
def test_an_edit_does_not_begin_it_anew(cast, edit, is_updated):
    accelerate(cast)
    cast.play(range(1, 5))
    edit(cast)
    if is_updated:
        layer().update()
        cast.assert_same()
    cast.play(range(5, 9))
    accelerate(cast)
    cast.assert_same()
    cast.play(range(9, LAST + 1))
    assert cast.rig.is_played


def switched_off(ob):
    look = soft_body(ob)
    ob.modifiers["Soft"].show_viewport = False
    return look


def fluid(ob):
    ob.modifiers.new("Fluid", "FLUID").fluid_type = "EFFECTOR"


@pytest.mark.parametrize(
    ("simulate", "number", "reason"),
    (
        (*REFUSED, "accelerate it, too"),
        (switched_off, OTHER, "accelerate it, too"),
        (particles, PROP, "begin anew on each frame"),
        (fluid, BODY, "between frames"),
    ),
)
def test_what_would_be_simulated_otherwise_keeps_the_rig_live(fresh_scene, simulate, number, reason):
    cast = Simulated(fresh_scene, simulate, number)
    wait(cast)
    assert not cast.rig.is_played and reason in cast.rig.reason


def test_cloth_elsewhere_does_not_begin_anew(fresh_scene):
    """Whatever has to be tagged, so that Blender builds relations, is something else: here it would be the first."""
    cast = Simulated(fresh_scene, hair, BODY)
    first, last = (make_grid(name) for name in ("A", "Z"))
    assert bpy.data.objects[0] == first
    looks = [cloth(first), cloth(last)]
    cast.play(range(1, 5))
    accelerate(cast)
    cast.play(range(5, 9))
    states().melt_all()
    cast.play(range(9, 12))
    assert np.array_equal(*(look() for look in looks))
