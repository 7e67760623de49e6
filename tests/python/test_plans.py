"""addon/sinew/plan without Blender: which path a mesh takes, where its run ends, what the file lacks for it."""

import importlib
import sys
import types
from dataclasses import replace
from pathlib import Path

import pytest

ADDON = Path(__file__).resolve().parents[2] / "addon" / "sinew"


package = sys.modules["sinew_alone"] = types.ModuleType("sinew_alone")
package.__path__ = [str(ADDON)]
situation, runs, ways, plans, mends = (
    importlib.import_module(f"sinew_alone.plan.{name}") for name in ("situation", "runs", "ways", "plans", "mends")
)

MESH, RIG, KEYS, CANVAS = 1, 2, 3, 4
PATH = 'modifiers["Armature"].use_apply_on_spline'


def modifier(kind, name=None, **more):
    if kind in {"ARMATURE", "HOOK"}:
        more.setdefault("awaits", (RIG, ""))
    name = name or {"ARMATURE": "Armature", "NODES": "Sinew"}.get(kind, kind)
    return situation.Modifier(name, kind, kind.title(), hash(name), **more)


def own(**more):
    return modifier("NODES", is_own=True, shown=(False, False), **more)


def bound(*behind, before=(), armature=None, hook=None, **more):
    """A situation in which Sinew replaces an Armature modifier. behind, before: other modifiers; armature: changes of
    the Armature modifier; hook: changes of the hook."""
    own_is_there = any(each.is_own for each in (*before, *behind))
    stack = (*before, *(() if own_is_there else (own(),)), modifier("ARMATURE", **(armature or {})), *behind)
    keys = more.get("keys")
    wired = situation.Hook(PATH, "Armature", MESH, keys and keys.identity, frozenset({(RIG, "")}))
    settings = {"vertex_count": 10_000, "has_attribute": keys is None, "taken": ("Armature",)} | more
    return situation.Situation(MESH, modifiers=stack, hook=replace(wired, **(hook or {})), **settings)


def free(*modifiers, **more):
    """A situation without an armature, if the mesh were bound."""
    return situation.Situation(MESH, 10_000, modifiers, is_bound=False, **more)


def keys(**more):
    return situation.Keys(KEYS, 3, **more)


def driven(name, *variables, **more):
    return situation.Driven(name, variables, **more)


def needed(given, newcomers=()):
    return mends.needed(plans.make(given), given, newcomers)


def test_a_wired_mesh_takes_the_path_through_an_attribute_and_lacks_nothing():
    given = bound()
    plan = plans.make(given)
    assert (plan.way.kind, plan.taken, plan.hook_path, plan.own) == ("ATTRIBUTE", ("Armature",), PATH, "Sinew")
    assert needed(given) == ()


def test_a_mesh_with_keys_takes_the_path_through_them():
    given = bound(keys=keys())
    assert plans.make(given).way.kind == "KEYS"
    assert [mend.what for mend in needed(given)] == ["TAKE_OWN_AWAY"]
    assert needed(bound(keys=keys(), before=(own(is_fixed=True),))) == ()  # of the library: it cannot be removed


def left(reason, given):
    return pytest.param(given, reason, id=reason)


@pytest.mark.parametrize(
    "make, reason",
    [
        left("too few bytes", lambda: bound(trouble="There are too few bytes")),
        left("Face (Armature) comes before Armature, with which Sinew began: unbind the mesh and accelerate it again",
             lambda: bound(before=(modifier("ARMATURE", "Face"),))),
        left("WAVE (Wave) comes before Armature, with which", lambda: bound(before=(modifier("WAVE"),))),
        left("WAVE (Wave) comes before Armature, with which Sinew has to begin: move WAVE behind Armature",
             lambda: bound(before=(modifier("SOLIDIFY"), modifier("WAVE")))),
        left("if the shape may be made in that order, in the library", lambda: bound(
            before=(modifier("WAVE", "Wave", is_fixed=True),)
        )),
        left("Sub (Subsurf) comes before Armature, and it is animated: move Sub behind Armature", lambda: bound(
            before=(modifier("SUBSURF", "Sub", is_animated=True),)
        )),
        left("and it depends on another object", lambda: bound(
            before=(modifier("MIRROR", front_trouble="it depends on another object"),)
        )),
        left("comes before Armature, with which Sinew", lambda: bound(before=(modifier("SUBSURF"),), keys=keys())),
        left("the object is linked", lambda: bound(before=(modifier("SUBSURF"),), is_linked=True)),
        left("Its method or output needs the mesh's", lambda: bound(before=(modifier("SUBSURF"),), wants_more=True)),
        left("Not here", lambda: bound(before=(modifier("SUBSURF"),), front_trouble="Not here")),
        left("Mix (Vertex_Weight_Mix) changes the vertex group Hand before the mesh is deformed by it", lambda: bound(
            before=(modifier("VERTEX_WEIGHT_MIX", "Mix", keeps_shape=True, reads_shape=False, feeds="Hand"),)
        )),
        left("Normals (Weighted_Normal) comes before Armature", lambda: bound(
            before=(modifier("WEIGHTED_NORMAL", "Normals", keeps_shape=True),), keys=keys()
        )),
        left("deformed by its parent Rig directly", lambda: bound(deforming_parent="Rig")),
        left("invert vertex group of Armature is driven, and it is too hard", lambda: bound(
            armature={"driven": (driven("invert_vertex_group", trouble="it is too hard"),)}
        )),
        left("Vertex Groups of Armature is animated", lambda: bound(
            armature={"trouble": "Vertex Groups of Armature is animated: remove that"}
        )),
        left("Armature and Other are mixed, but their switches", lambda: bound(
            modifier("ARMATURE", "Other", shown=(True, False)), taken=("Armature", "Other"), tells_renders=False
        )),
        left("2 objects share this mesh, and Blender blends its shape keys for all of them: make it single-user",
             lambda: bound(sharer_count=2, keys=keys())),
        left("and this one is linked, so Sinew cannot add what it needs: make a library override of it",
             lambda: bound(sharer_count=2, is_linked=True)),
        left("Mesh and armature move against each other", lambda: bound(weights_follow_shape=True)),
        left("Its shape keys move vertices", lambda: bound(weights_follow_shape=True, keys=keys())),
        left("shape keys are absolute", lambda: bound(keys=keys(is_relative=False))),
        left("Only the active shape key is shown", lambda: bound(keys=keys(is_one_shown=True))),
        left("only in the viewport or only in renders", lambda: bound(
            armature={"shown": (True, False)}, keys=keys(), tells_renders=False
        )),
        left("Armature is switched off: switch it on", lambda: bound(armature={"shown": (False, False)}, keys=keys())),
        left("Cache plays a cache in place of Armature", lambda: bound(
            modifier("MESH_CACHE", "Cache"), armature={"shown": (False, False)}, keys=keys()
        )),
        left("MULTIRES allows only deforming modifiers before it", lambda: bound(modifier("MULTIRES"))),
        left("HOOK picks vertices by index", lambda: bound(
            modifier("HOOK", picks_by_index=True, trouble="Sinew cannot evaluate its falloff curve")
        )),
        left("Its armature is gone", lambda: bound(armature={"lacks_target": True})),
        left("Its armature is gone", lambda: replace(bound(), hook=None)),
        left("fewer than 3,000 vertices", lambda: bound(vertex_count=2_999)),
        left("2 objects share this mesh, which Blender's own modifier deforms sooner in this version: make it",
             lambda: bound(sharer_count=2, is_canvas_slow=True)),
        left("fewer than 4,000 vertices", lambda: bound(vertex_count=3_999, sharer_count=2)),
        left("fewer than 500 vertices", lambda: bound(vertex_count=499, keys=keys())),
    ],
)  # fmt: skip
def test_what_is_left_to_blender_says_why(make, reason):
    way = plans.make(make()).way
    assert (way.kind, reason in way.reason) == ("BLENDER", True), way.reason
    assert plans.make(make()).run == runs.Run()


@pytest.mark.parametrize("more", [{}, {"keys": keys()}], ids=["without keys", "with keys"])
def test_what_has_nothing_to_do_with_the_shape_may_be_anywhere(more):
    warp = modifier("UV_WARP", keeps_shape=True, reads_shape=False)
    behind = modifier("SMOOTH"), replace(warp, name="Between"), modifier("CORRECTIVE_SMOOTH")
    given = bound(*behind, before=(warp,), **more)
    plan = plans.make(given)
    assert plan.way.in_pass and plan.run.stages == ("SMOOTH", "CORRECTIVE_SMOOTH")
    assert not any(mend.what == "PUT_OWN_FIRST" for mend in needed(given))


@pytest.mark.parametrize("is_first", (False, True))
def test_a_hook_that_picks_by_index_ends_the_run_behind_what_keeps_all_vertices(is_first):
    warp = modifier("UV_WARP", keeps_shape=True, reads_shape=False)
    picks, behind = modifier("HOOK", picks_by_index=True), (modifier("SMOOTH"), warp)

    def run(*more):
        return runs.of(bound(*more, before=(warp,), keys=keys()) if is_first else bound(*behind, *more, keys=keys()))

    stages = () if is_first else ("SMOOTH",)
    assert (run(picks).stages, run(picks).end) == (stages, "HOOK")
    assert run(picks).reason == (
        "it picks vertices by index, and Blender mixes these up behind UV_WARP: move it before that one"
    )
    assert run(replace(picks, picks_by_index=False)).stages == (*stages, "HOOK")
    collides = modifier("COLLISION", keeps_shape=True)
    assert runs.of(bound(picks, before=(collides,))).stages == ("HOOK",)
    assert runs.of(bound(picks, replace(warp, shown=(False, False)), keys=keys())).stages == ("HOOK",)
    assert runs.of(bound(replace(warp, shown=(False, False)), picks, keys=keys())).stages == ("HOOK",)


def test_what_depends_on_the_shape_comes_before_sinews_modifier():
    normals = modifier("WEIGHTED_NORMAL", keeps_shape=True)
    assert needed(bound(before=(normals, own()))) == ()
    (mend,) = needed(bound(before=(own(), normals)))
    assert (mend.what, mend.is_blocking) == ("PUT_OWN_FIRST", True)
    assert needed(bound(before=(own(), replace(normals, shown=(False, False))))) == ()


def test_a_small_mesh_with_what_blender_lacks_is_ours():
    assert plans.make(bound(vertex_count=8, wants_more=True)).way.kind == "ATTRIBUTE"
    assert plans.make(bound(modifier("SMOOTH"), vertex_count=8)).way.kind == "ATTRIBUTE"


@pytest.mark.parametrize("kind", ("LATTICE", "MESH_DEFORM", "SURFACE_DEFORM"))
def test_a_small_mesh_in_a_cage_alone_is_left_to_blender(kind):
    lattice = modifier(kind, awaits=(RIG, "dimensions[0]"))
    assert plans.make(bound(lattice, vertex_count=8)).way.kind == "BLENDER"
    assert plans.make(bound(lattice, modifier("SMOOTH"), vertex_count=8)).way.kind == "ATTRIBUTE"
    assert plans.make(bound(lattice)).run.stages == (kind,)


def test_the_run_goes_on_until_what_sinew_cannot_evaluate():
    off = modifier("DISPLACE", shown=(False, False))
    sub = modifier("SUBSURF", "Sub", tail_trouble="it is animated")
    given = bound(modifier("SMOOTH"), off, modifier("CORRECTIVE_SMOOTH"), sub, modifier("HOOK"))
    run = plans.make(given).run
    assert run.stages == ("SMOOTH", "CORRECTIVE_SMOOTH")
    assert (run.end, run.reason) == ("Sub", "Sinew cannot evaluate modifiers of the type Subsurf: it is animated")


@pytest.mark.parametrize(
    "more, reason",
    [
        ({"driven": (driven("factor", trouble="it is too hard"),)}, "its factor is driven, and it is too hard"),
        ({"trouble": "it is not bound: press Bind in that modifier"}, "it is not bound: press Bind in that modifier"),
    ],
)
def test_the_run_ends_at_a_stage_that_may_differ(more, reason):
    run = plans.make(bound(modifier("SMOOTH", **more))).run
    assert (run.stages, run.end, run.reason) == ((), "SMOOTH", reason)


def armature(name, rig=RIG, **more):
    return modifier("ARMATURE", name, awaits=(rig, ""), **more)


def test_armatures_in_a_row_are_stages():
    off = armature("Off", shown=(False, False))
    given = bound(armature("Face", binds=(True, False)), off, modifier("SMOOTH"), armature("Tongue", lacks_target=True))
    plan = plans.make(given)
    assert (plan.run.stages, plan.run.mixes, plan.run.end) == (("Face", "SMOOTH"), (("Face",),), "")
    assert (plan.taken, plan.later) == (("Armature",), (("Face", (True, False)),))


def test_what_multi_modifier_mixes_is_replaced_together_or_not_at_all():
    face, off = armature("Face"), armature("Off", shown=(False, False), is_mixed=True)
    tongue, alone = armature("Tongue", is_mixed=True), armature("Alone", is_mixed=True)
    run = runs.of(bound(modifier("HOOK"), face, off, tongue, modifier("SMOOTH"), alone))
    assert run.stages == ("HOOK", "Face", "Tongue", "SMOOTH", "Alone")
    assert run.mixes == (("Face", "Tongue"), ("Alone",))
    run = runs.of(bound(modifier("HOOK"), face, replace(tongue, trouble="it is not round"), modifier("SMOOTH")))
    assert (run.stages, run.mixes, run.end) == (("HOOK",), (), "Face")
    assert run.reason == "it is mixed with Tongue, which Sinew cannot replace: it is not round"


def test_the_hook_waits_for_later_armatures():
    given = bound(armature("Face", 7))
    assert [mend.what for mend in needed(given)] == ["HOOK"]
    assert needed(bound(armature("Face", 7), hook={"targets": frozenset({(RIG, ""), (7, "")})})) == ()
    left_to_blender = armature("Face", 7, trouble="its weights follow the shape")
    assert needed(bound(left_to_blender)) == ()


def test_several_armatures_pay_on_smaller_meshes():
    assert plans.make(bound(armature("Face"), vertex_count=1_500)).way.kind == "ATTRIBUTE"
    assert plans.make(bound(armature("Face"), vertex_count=1_499)).way.kind == "BLENDER"
    assert plans.make(bound(armature("Face"), armature("Mouth"), vertex_count=1_000)).way.kind == "ATTRIBUTE"
    assert plans.make(bound(armature("Face"), modifier("SMOOTH"), vertex_count=8)).way.kind == "ATTRIBUTE"


SWITCHED = {"is_switched": True, "shown": (False, False)}
VIEWPORT = {"shown": (True, False)}


def test_switches_are_followed():
    """What is off now may be on in another evaluation: on another frame, or for a render."""
    run = runs.of(bound(modifier("SMOOTH", **SWITCHED), modifier("HOOK", **VIEWPORT)))
    assert (run.stages, run.end) == (("SMOOTH", "HOOK"), "")
    for given in (
        bound(armature=SWITCHED),
        bound(armature=VIEWPORT, keys=keys()),
        bound(armature=SWITCHED, keys=keys()),
    ):
        assert plans.make(given).way.in_pass
    mixed = bound(modifier("ARMATURE", "Other", **VIEWPORT), taken=("Armature", "Other"))
    assert plans.make(mixed).way.kind == "ATTRIBUTE"
    front = bound(before=(modifier("SUBSURF", is_animated=True, **SWITCHED),))
    assert "before Armature, and it is animated" in plans.make(front).way.reason


def test_animation_of_what_is_read_once():
    plan = plans.make(bound(armature("Face", trouble="No", animation_trouble="No"), animation_trouble="Not this"))
    assert (plan.way.kind, plan.way.reason) == ("BLENDER", "Not this")
    assert plan.animation_troubles == {"Not this", "No"}


def test_multi_modifier_that_is_animated_ends_the_run_before_what_it_may_mix_with():
    mixing = armature("Mixing", may_be_mixed=True)
    reason = "Multi Modifier of Mixing behind {} is animated: remove that"
    assert plans.make(bound(mixing)).way.reason == reason.format("Armature")
    run = runs.of(bound(armature("Other"), mixing))
    assert (run.stages, run.end, run.reason) == ((), "Other", reason.format("Other"))
    assert plans.make(bound(modifier("SMOOTH"), mixing)).way.in_pass
    for kind in ("LATTICE", "MESH_DEFORM"):
        run = runs.of(bound(modifier(kind), mixing))
        assert (run.end, run.reason) == (kind, reason.format(kind))


def test_where_renders_cannot_be_told_the_first_modifier_sets_the_switches():
    def run(*modifiers, **more):
        return runs.of(free(*modifiers, tells_renders=False, **more))

    found = run(modifier("SMOOTH", **VIEWPORT), modifier("HOOK"))
    assert found.stages == ("SMOOTH",)
    assert found.reason == "its switches for viewport and renders differ from those of SMOOTH"
    assert run(modifier("SMOOTH", **VIEWPORT), keys=keys()).end == "SMOOTH"
    assert run(modifier("SMOOTH"), modifier("HOOK", **SWITCHED)).stages == ("SMOOTH", "HOOK")
    armature = runs.of(bound(modifier("SMOOTH", **VIEWPORT), tells_renders=False))
    assert armature.reason == "its switches for viewport and renders differ from those of Armature"


def test_switches_of_mixed_armatures_are_followed():
    face, tongue = armature("Face", **SWITCHED), armature("Tongue", is_mixed=True, **VIEWPORT)
    assert runs.of(bound(face, tongue)).mixes == (("Face", "Tongue"),)
    run = runs.of(bound(face, tongue, tells_renders=False))
    assert (run.stages, run.end) == ((), "Face")
    assert run.reason == (
        "it is mixed with Tongue, which Sinew cannot replace: its switches for viewport and renders differ from those "
        "of Armature"
    )
    too_hard = {"driven": (driven("invert_vertex_group", trouble="it is too hard"),)}
    assert runs.of(bound(armature("Face", **too_hard))).reason == (
        "its invert vertex group is driven, and it is too hard"
    )


def test_the_hook_reads_what_drivers_of_the_run_read():
    behind = modifier("SMOOTH", driven=(driven("factor", "a", "b"), driven("iterations", "c")))
    armature = {"driven": (driven("invert_vertex_group", "d"),)}
    given = bound(behind, armature=armature)
    assert [mend.what for mend in needed(given)] == ["HOOK"]
    wired = bound(behind, armature=armature, hook={"driven": ("d", "a", "b", "c")})
    assert needed(wired) == ()
    assert plans.make(wired).driven == (("Armature", given.modifiers[1].driven), ("SMOOTH", behind.driven))
    assert [mend.what for mend in needed(bound(hook={"driven": ("d",)}))] == ["HOOK"]  # a driver that was removed
    after_the_run = bound(modifier("SUBSURF"), behind)
    assert needed(after_the_run) == ()


def test_the_hook_waits_for_drivers_of_switches():
    switch = (MESH, 'modifiers["SMOOTH"].show_viewport')
    behind = modifier("SMOOTH", is_switched=True, switch_drivers=frozenset({switch}))
    assert [mend.what for mend in needed(bound(behind))] == ["HOOK"]
    assert needed(bound(behind, hook={"awaited": frozenset({switch})})) == ()


def test_a_mesh_with_nothing_to_replace_is_idle():
    assert "has no armature, shape keys or smoothing" in ways.why_idle(free())
    assert "(Sub comes first, and Sinew cannot" in ways.why_idle(free(modifier("SUBSURF", "Sub")))
    assert ways.why_idle(free(modifier("SMOOTH"))) == ways.why_idle(free(keys=keys())) == ""
    assert "has no armature" in ways.why_idle(free(keys=replace(keys(), count=1)))  # the reference key alone
    assert ways.choose(free(gets_armature=True)).kind == "ATTRIBUTE"


def test_an_armature_that_was_added_later_is_not_replaced():
    assert "unbind the mesh" in runs.of(free(modifier("ARMATURE"), modifier("SMOOTH"))).reason
    run = runs.of(free(modifier("SMOOTH"), modifier("ARMATURE")))
    assert run.stages == ("SMOOTH",) and "other modifiers come before it" in run.reason


@pytest.mark.parametrize(
    "hook", [{"mesh": 7}, {"keys": KEYS}, {"targets": frozenset()}, {"has_lost_target": True}, {"path": "another"}]
)
def test_a_hook_that_waits_for_the_wrong_things_blocks(hook):
    given = bound(hook=hook)
    assert mends.needed(plans.make(bound()), given, ()) == (mends.Mend("HOOK", is_blocking=True),)


def test_the_hook_waits_for_what_hooks_of_the_run_follow():
    behind = modifier("HOOK", awaits=(RIG, "hand"))
    assert [mend.what for mend in needed(bound(behind))] == ["HOOK"]
    assert needed(bound(behind, hook={"targets": frozenset({(RIG, ""), (RIG, "hand")})})) == ()
    after_the_run = bound(modifier("SUBSURF"), replace(behind, picks_by_index=False))
    assert needed(after_the_run) == ()


def test_the_hook_waits_for_the_shape_of_a_lattice():
    lattice = modifier("LATTICE", awaits=(RIG, "dimensions[0]"))
    assert [mend.what for mend in needed(bound(lattice))] == ["HOOK"]
    assert needed(bound(lattice, hook={"targets": frozenset({(RIG, ""), (RIG, "dimensions[0]")})})) == ()


def test_sinews_modifier_is_put_first_and_blocks_if_others_would_be_missed():
    late = bound(own())
    assert needed(late) == (mends.Mend("PUT_OWN_FIRST"),)  # what is before it is replaced
    missed = bound(modifier("SUBSURF"), own())
    assert needed(missed) == (mends.Mend("PUT_OWN_FIRST", is_blocking=True),)
    absent = replace(bound(), modifiers=(modifier("ARMATURE"),))
    assert needed(absent) == (mends.Mend("PUT_OWN_FIRST", is_blocking=True),)


def test_an_old_group_and_a_missing_attribute_are_mended():
    given = bound(before=(own(has_old_group=True),), has_attribute=False)
    assert needed(given) == (mends.Mend("RENEW_GROUP"), mends.Mend("ADD_ATTRIBUTE", is_blocking=True))
    late = bound(own(has_old_group=True))
    assert [mend.what for mend in needed(late)] == ["PUT_OWN_FIRST", "RENEW_GROUP"]


def shared(canvas=CANVAS, read=CANVAS, hook=CANVAS, **more):
    """A situation in which other objects have the mesh too. canvas: of the object; read: by Sinew's modifier; hook:
    that the hook waits for."""
    ours = own(reads_canvas=read is not None, reads_front=read is not None, canvas=read)
    waits = {"mesh": None, "canvas": hook}
    return bound(before=(ours,), hook=waits, sharer_count=2, canvas=canvas, **{"has_attribute": False} | more)


def test_a_shared_mesh_takes_the_path_through_a_canvas():
    plan = plans.make(shared())
    assert plan.way.kind == "CANVAS" and plan.way.in_pass and plan.way.has_own
    assert needed(shared()) == ()
    assert plans.make(shared(is_linked=True)).way.kind == "CANVAS"  # with a canvas from the library


def test_a_shared_mesh_takes_all_from_its_canvas_unless_indices_are_needed():
    assert plans.make(shared()).way.takes_all
    positions_alone = replace(shared().own, reads_front=False)
    slow = replace(shared(), modifiers=(positions_alone, *shared().modifiers[1:]))
    assert needed(slow) == (mends.Mend("READ_CANVAS"),)
    assert needed(replace(slow, is_linked=True)) == ()
    particles = replace(shared(), front_trouble="Its particles")
    assert not plans.make(particles).way.takes_all
    assert needed(particles) == (mends.Mend("READ_CANVAS", is_blocking=True),)
    assert needed(replace(slow, front_trouble="Its particles")) == ()
    before = modifier("UV_WARP", keeps_shape=True, reads_shape=False)
    assert not plans.make(replace(shared(), modifiers=(before, *shared().modifiers))).way.takes_all
    hidden = replace(before, shown=(False, False))
    assert plans.make(replace(shared(), modifiers=(hidden, *shared().modifiers))).way.takes_all


@pytest.mark.parametrize(
    "change, wanted",
    [
        ({"canvas": None}, ["HOOK", "READ_CANVAS"]),
        ({"read": None}, ["READ_CANVAS"]),
        ({"read": 9}, ["READ_CANVAS"]),
        ({"hook": 9}, ["HOOK"]),
        ({"canvas": None, "hook": None}, ["HOOK", "READ_CANVAS"]),
    ],
)
def test_a_canvas_that_is_missing_blocks(change, wanted):
    assert [(mend.what, mend.is_blocking) for mend in needed(shared(**change))] == [(each, True) for each in wanted]


def test_the_attribute_of_a_shared_mesh_goes_if_it_may():
    assert needed(shared(has_attribute=True)) == (mends.Mend("REMOVE_ATTRIBUTE"),)
    assert needed(shared(has_attribute=True, is_mesh_linked=True)) == ()


def test_a_mesh_that_is_single_again_gives_its_canvas_back():
    found = needed(replace(shared(has_attribute=True), sharer_count=1))
    assert [(mend.what, mend.is_blocking) for mend in found] == [("HOOK", True), ("RELEASE_CANVAS", True)]
    left_to_blender = replace(shared(), deforming_parent="Rig")
    assert [mend.what for mend in needed(left_to_blender)][:1] == ["RELEASE_CANVAS"]


COPY = 5


def with_front(*kinds, own_at=None, canvas=CANVAS, copied=COPY, hook=None, **more):
    """A situation with a front of these types. own_at: index of Sinew's modifier."""
    stack = [modifier(kind) for kind in kinds]
    ours = own(reads_canvas=True, reads_front=True, canvas=CANVAS)
    stack.insert(len(stack) if own_at is None else own_at, ours)
    waits = {"canvas": CANVAS, "copied": COPY} | (hook or {})
    return bound(before=stack, canvas=canvas, copied=copied, hook=waits, **{"has_attribute": False} | more)


def test_a_front_is_evaluated_by_the_canvas():
    given = with_front("MIRROR", "SUBSURF")
    way = plans.make(given).way
    assert (way.kind, way.front, way.has_copy) == ("CANVAS", ("MIRROR", "SUBSURF"), True)
    assert needed(given) == ()
    off = replace(given, modifiers=(modifier("WAVE", shown=(False, False)), *given.modifiers))
    assert plans.make(off).way == way


def test_modifiers_that_keep_the_shape_are_no_front():
    beside = modifier("UV_WARP", keeps_shape=True, reads_shape=False)
    assert plans.make(bound(before=(beside,))).way.kind == "ATTRIBUTE"
    assert plans.make(bound(before=(beside, modifier("MIRROR")))).way.kind == "BLENDER"


def test_only_armatures_follow_a_front():
    given = with_front("MIRROR")
    behind = armature("Face"), modifier("SMOOTH"), armature("Tongue")
    run = plans.make(replace(given, modifiers=(*given.modifiers, *behind))).run
    assert (run.stages, run.mixes, run.end) == (("Face",), (("Face",),), "SMOOTH")
    run = plans.make(replace(with_front("MIRROR"), modifiers=(*with_front("MIRROR").modifiers, modifier("SMOOTH")))).run
    assert (run.stages, run.end) == ((), "SMOOTH")
    assert run.reason == "modifiers before Armature make other vertices than the mesh's own"


@pytest.mark.parametrize(
    "change, wanted",
    [
        ({"own_at": 0}, ["PUT_OWN_FIRST"]),
        ({"canvas": None, "copied": None}, ["HOOK", "READ_CANVAS"]),
        ({"copied": 9}, ["HOOK"]),
        ({"hook": {"mesh": 9}}, ["HOOK"]),
        ({"hook": {"canvas": 9}}, ["HOOK"]),
    ],
)
def test_what_a_front_lacks_blocks(change, wanted):
    found = needed(with_front("MIRROR", "SUBSURF", **change))
    assert [(mend.what, mend.is_blocking) for mend in found] == [(each, True) for each in wanted]


def test_a_front_of_a_shared_mesh_needs_no_copy():
    given = with_front("MIRROR", copied=None, hook={"mesh": None, "copied": None}, sharer_count=2)
    assert plans.make(given).way.has_copy is False and needed(given) == ()


def test_newcomers_before_sinews_modifier_are_moved():
    newcomer = modifier("HOOK", comes_first=True)
    given = bound(before=(newcomer, own()), vertex_count=1)  # too small, so that the order is not a reason to refuse
    given = replace(given, wants_more=True, hook=replace(given.hook, targets=frozenset({(RIG, "")})))
    moved = mends.Mend("MOVE_DISPLACED", ("HOOK",))
    assert moved in needed(given, {newcomer.identity})
    assert moved not in needed(given)  # the user moved it there


def test_a_copy_of_a_hook_stays_with_its_original():
    first, copy = (modifier("HOOK", name, comes_first=True, likeness=("same",)) for name in ("Hook", "Hook.001"))
    given = bound(before=(first, copy, own()))
    (mend,) = (mend for mend in needed(given, {copy.identity}) if mend.what == "MOVE_DISPLACED")
    assert mend.modifiers == ()
    other = replace(copy, likeness=("another",))
    (mend,) = (
        mend for mend in needed(bound(before=(first, other, own())), {copy.identity}) if mend.what == "MOVE_DISPLACED"
    )
    assert mend.modifiers == ("Hook.001",)


def test_a_carrier_leaves_only_if_it_is_in_the_way():
    carried = {"hook": {"carrier": "Sinew"}, "keys": keys()}
    assert needed(bound(**carried)) == ()
    mixed = bound(armature={"is_mixed": True}, **carried)
    assert [mend.what for mend in needed(mixed)] == ["TAKE_OWN_AWAY"]
    assert [mend.what for mend in needed(bound(has_attribute=True, **carried))] == ["TAKE_OWN_AWAY"]


# --- tails ----------------------------------------------------------------------------------------


def linear(kind, name="", **more):
    """A modifier whose result is a weighted sum."""
    return modifier(kind, name or kind, tail_trouble="", **more)


BEHIND = modifier("SOLIDIFY")


@pytest.mark.parametrize(
    "modifiers, tail",
    [
        ([linear("SUBSURF"), BEHIND], ("SUBSURF",)),
        ([linear("MASK"), linear("SUBSURF", "Sub"), linear("TRIANGULATE"), BEHIND], ("MASK", "Sub", "TRIANGULATE")),
        ([linear("SUBSURF")], ()),
        ([linear("MASK"), linear("SUBSURF")], ("MASK",)),
        ([linear("MASK")], ("MASK",)),
        ([linear("TRIANGULATE"), BEHIND], ()),  # for which Blender takes less time than the search
        ([BEHIND, linear("SUBSURF"), BEHIND], ()),
        ([modifier("SMOOTH"), linear("SUBSURF"), linear("MASK", shown=(False, False)), BEHIND], ("SUBSURF",)),
        ([linear("SUBSURF", shown=(True, False)), BEHIND], ()),
        ([linear("EDGE_SPLIT"), modifier("SUBSURF"), BEHIND], ("EDGE_SPLIT",)),
    ],
)
def test_the_tail_comes_right_behind_the_run(modifiers, tail):
    run = plans.make(bound(*modifiers)).run
    assert run.tail == tail and run.end == next(each.name for each in modifiers if each.type != "SMOOTH")
    assert plans.make(bound(*modifiers)).lacks_stencils == (bool(tail), bool(tail))


def test_a_last_subdivision_is_of_it_if_others_follow_the_mesh():
    assert runs.of(bound(linear("SUBSURF"), is_followed=True)).tail == ("SUBSURF",)


@pytest.mark.parametrize(
    "more, reason",
    [
        ({"sharer_count": 2}, "make it single-user"),
        ({"is_linked": True}, "make a library override"),
        ({"wants_more": True}, "needs the mesh's own vertices"),
        ({"front_trouble": "Its particles"}, "Its particles"),
    ],
)
def test_what_has_no_tail(more, reason):
    run = runs.of(bound(linear("SUBSURF"), BEHIND, **more))
    assert run.tail == () and run.end == "SUBSURF" and reason in run.reason


def test_a_mesh_with_stencils_takes_the_path_through_a_canvas():
    stencils = object()
    tail = situation.Tail(("SUBSURF",), "", "", (stencils, None))
    plan = plans.make(bound(linear("SUBSURF"), BEHIND, tail=tail))
    assert plan.way.kind == "CANVAS" and plan.way.tail is tail and plan.way.on_canvas == ("SUBSURF",)
    assert plan.way.takes_all and plan.way.has_copy and plan.lacks_stencils == (False, True)
    assert tail.shown == (True, False)
    with_keys = plans.make(bound(linear("SUBSURF"), BEHIND, tail=tail, keys=keys())).way
    assert with_keys.kind == "CANVAS" and with_keys.has_keys and with_keys.tail is tail and not plan.way.has_keys
    other = plans.make(bound(linear("SUBSURF"), linear("MASK"), BEHIND, tail=tail))
    assert other.way.kind == "ATTRIBUTE" and other.lacks_stencils == (True, True)
