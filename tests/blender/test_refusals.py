"""All sentences that say why a mesh or a rig is left to Blender, with the buttons that the panel offers for each. Whoever
adds a sentence adds it here."""
# ruff: noqa: E501  # a sentence stands on one line, as in the code

import ast
import re
from types import SimpleNamespace

import bpy
import pytest

from helpers import ROOT, addon_module

PART = None  # of other sentences
# Clauses stand within others.
FRAMES = {
    "description.constraints": 'the constraint "Body" of the bone "hip": {}',
    "description.curves": "the modifier Noise of the curve of Location {}",
    "description.driven_keys": 'the driver of Value of the shape key "Wide" of Key: {}',
    "description.driver_rows": 'the driver of Roll of the bone "hip": {}',
    "description.other_data": "Body reads {}",
    "description.objects": "bones of Body follow Ball, outside of it, which may move: {}",
    "description.targets": 'the constraint "Body" of the bone "hip": {}',
    "host.relations": "the driver of Energy of Lamp reads it, and {}: rewrite it",
    "played.followers": "Body stays Blender's: {}",
    "plan.driven": "Blender takes over at Body: its factor is driven, and {}",
    "plan.drivers": "Blender takes over at Body: its factor is driven, and {}",
    "plan.ways": "It {}",
    **{
        f"plan.{name}": "Blender takes over at Body: {}"
        for name in ("cages", "canvas_survey", "fronts", "runs", "survey", "tails")
    },
}
# Rigs that are refused with these can be recorded instead.
REFUSED = {
    *(f"description.{name}" for name in ("constraints", "curves", "driven_keys", "driver_rows", "reading", "splines")),
    *("description.strips", "description.targets", "played.computing", "played.differences", "played.leading"),
}


def sentence(*buttons):
    return False, buttons


def clause(*buttons):
    return True, buttons


# Nothing can be done, by decision: Blender's own modifiers or its own rig are right, and no slower.
NOTHING = sentence("nothing")
NOTHING_WITHIN = clause("nothing")
BONE = "Select Bone"
RECORD = "Record Instead"
DRIVER = "Show Driver"
DOWN = "Move Down"
BASIS = "Add a Basis"
BIND = "Bind Smoothing"
SINGLE = "Make Single User"
# Offered for what the mesh is, not for its sentence: test_panel and test_render draw these.
OF_MESHES = {
    ": add a shape key, and Sinew uses that": BASIS,
    ": press Bind in that modifier": BIND,
    ": bind it again": BIND,
    ": make it single-user": SINGLE,
}

TABLE = {
    "played.accelerating": {"{}, on which {} depends, has changes that are not keyed: key them": sentence()},
    "played.computing": {
        "{} maps its frames to other times: set Old and New of its Time Stretching alike": sentence(RECORD),
        "which the rig does not have; remove it or describe the property": PART,
        "which Sinew does not compute: remove that": PART,
    },
    "played.differences": {
        "on frame {}, channels or B-bones of {} are not those that were computed": sentence(RECORD),
        "{} instead of {}": PART,
        'on frame {}, the bone "{}" of {} would have {} in its matrix': sentence(BONE, RECORD),
        "driven keys": PART,
    },
    "played.followers": {
        "Followers | NotPlayable": PART,
        "{} uses it in a way that Sinew does not know: remove that": clause(),
        "{} is simulated, and its simulation needs its armature between frames": NOTHING_WITHIN,
        "{} hangs on bones, and its simulation would begin anew on each frame: let them deform it": clause(),
        "{} has hair or a simulation that is switched off: accelerate it, too": clause(),
        "{} is a child of {}, which follows its bones: parent it otherwise": clause(),
        "{} is deformed by its parent: use an Armature modifier (Object > Convert, or parent it with Armature Deform), which Sinew can follow": clause(),
        "the driver of {} reads it together with something else: give it two variables": sentence(DRIVER),
        "{} is hidden: show it": sentence(),
        "bones of {} follow {}, outside of it, which may move: {}": sentence(),
        'the constraint "{}" of {} follows an object that may move: use a constraint of another type': sentence(),
        "{} itself is animated ({}), not only its bones: animate its root bone instead": sentence(),
        "{} itself is animated, and {}: animate its root bone instead": clause(),
        "{} is a force": PART,
        "{} uses it": PART,
        "bones of {} follow it": PART,
        "a simulation follows it": PART,
        "{}, its child, moves by itself": PART,
        "{} objects hang on it, which would take longer than its bones": PART,
        "drivers of {} read {}": PART,
        "{} uses {}": PART,
        "{} itself has constraints: constrain its root bone instead": sentence(),
        "{} is simulated: remove its rigid body": sentence(),
        "{} is a child of {}, which moves or may move": NOTHING,
        "{}: clear the parent, and animate the root bone": PART,
        " and {} more": PART,
        "the driver of {} of {} reads it, and {}: rewrite it": clause(DRIVER),
        "{} of {}": PART,
    },
    "played.states": {
        "{} waits until Blender has rendered or baked": NOTHING,
        "{} is changed after each evaluation: switch off the script or add-on that does it": sentence(),
        "{} + 0 * frame": PART,
        "{} is edited on each frame: it stays Blender's until it rests": sentence(),
        "what {} follows was edited": NOTHING,
        "{} was edited": NOTHING,
        "{} is selected": NOTHING,
    },
    "played.leading": {
        "{} reads {}": PART,
        "{} reads {}, another scene, which has keyframes: let it read {}": sentence(RECORD),
        "{} reads {} of {}, which moves, in transform space: choose World Space": sentence(RECORD),
        "{} follows a bone of {} that is not there: choose another one": sentence(RECORD),
        "{} follows {}, which may move{}": sentence(RECORD),
        "{} and {} follow each other: have one of them alone follow": sentence(RECORD),
        "{}, which it follows, is not native": PART,
    },
    "played.playing": {
        "the animation of {} was edited": NOTHING,
        "frame {} of {} is not recorded: it is Blender's there": sentence(),
        "{} was edited": NOTHING,
        "{} plays at another speed than when {} was recorded: press Record": sentence(),
        "something besides its keyframes moves the bones of {}": NOTHING,
    },
    "played.reasons": {
        "{} follows bones of {}, which is Blender's": NOTHING,
        "{} stays Blender's: {}": PART,
        "bones of {} follow {}, outside of it, which may move: ": PART,
        "the driver of {} reads {} of {}, which is animated and not recorded: let it read a channel of a bone": sentence(
            DRIVER
        ),
        "{} is Blender's between two frames: only whole frames are recorded": sentence(),
        "{} is not in this view layer: switch its collection on": sentence(),
        "{} is edited on each frame: switch off the script or add-on that does it, and press Record": sentence(),
        "frame {} of {} is not recorded: play it, or press Record": sentence(),
        '{} has changes that are not keyed (bone "{}"): key them, or change the frame to lose them': sentence(BONE),
        "{} itself has changes that are not keyed ({}): key them, or change the frame to lose them": sentence(),
        "{} follows bones of {}, which is not native": NOTHING,
        "keyframes of {} set more than channels of bones, constraints' influence and custom properties: press Record to have it native until it is selected": sentence(),
        "{}, which {} follows, has changes that are not keyed: key them": sentence(),
        "{} is hidden, so Blender may not evaluate all of its bones: show it": sentence(),
        "the pose of {} is not exactly what was computed: change the frame to have it compared again": sentence(),
        "{} is being edited: go back to Object Mode first": sentence(),
        "{} has no keyframes: key a pose": sentence(),
        "an NLA strip of {} is being edited: leave its tweak mode first": sentence(),
        "the armature {} itself has keyframes, not only its bones: remove those": sentence(),
        "{} uses the iTaSC solver, whose result depends on the frames before: choose Standard": sentence(),
        "{} plays the poses of an imported rig, which costs little: there is nothing to gain": sentence(),
        'the constraint "{}" of the bone "{}" of {} is of the type {}, which Sinew cannot follow: bake it into keyframes': sentence(
            BONE
        ),
        "the driver of {} of {} depends on more than its variables ({}): use these alone": sentence(DRIVER),
        "the driver of {} of {} reads what is shown at the moment (Context Property): let it read the scene itself, as Single Property": sentence(
            DRIVER
        ),
        "{} reads {}, which has keyframes and is not shown: let something use it that is": sentence(),
    },
    "description.constraints": {
        "the type {} is not covered": clause(BONE, RECORD),
        'the constraint "{}" of the bone "{}": {}': PART,
        "both Enabled and Mute are animated: keep one of the two": clause(BONE, RECORD),
        "bone envelopes are not covered: turn them off": clause(BONE, RECORD),
        "bones of another armature are not covered here": clause(BONE, RECORD),
        "the owner's orientation is not covered for another armature's bone: choose another space": clause(
            BONE, RECORD
        ),
        "the bone {} that it follows is not there: choose another one": clause(BONE, RECORD),
        "an animated place along a bone of another armature is not covered": clause(BONE, RECORD),
        "a place along a B-bone of another armature is not covered: turn Follow B-Bone off": clause(BONE, RECORD),
        "Object Action is not covered: turn it off": clause(BONE, RECORD),
    },
    "description.curves": {
        "the curve of {} holds samples instead of keys: convert it to keys": sentence(RECORD),
        "the modifier {} of the curve of {}": PART,
        "{} {}": PART,
        "is not covered: bake it into keys": clause(RECORD),
        "has a frame range or an influence: remove it": clause(RECORD),
        "{} is animated by NLA strips: bake them into one action": sentence(RECORD),
        "the action {} has several layers: merge them": sentence(RECORD),
    },
    "description.driven_keys": {
        "it is muted or not valid: mend or delete it": clause(DRIVER, RECORD),
        "the driver of {} of {}: {}": PART,
    },
    "description.driver_rows": {
        "{}{}: {}": PART,
        "it reads {} of {}, which is no number": clause(BONE, DRIVER, RECORD),
        "the driver of {}: {}": PART,
        "it is invalid, and keyframes set the same: mend or delete it": clause(BONE, DRIVER, RECORD),
        "{} itself moves (its {} is animated): move a bone instead": sentence(RECORD),
        '"{}" is not one of Blender\'s simple expressions: write it without Python': clause(BONE, DRIVER, RECORD),
        "variables of the type {} are not covered: use another type": clause(BONE, DRIVER, RECORD),
        "its variable {} reads {}, of which the contrary is animated": clause(BONE, DRIVER, RECORD),
        "its variable {} reads nothing: choose what it reads": clause(BONE, DRIVER, RECORD),
        "{} has no bone {}: choose another one": clause(BONE, DRIVER, RECORD),
        "it reads {} itself in local space, which is not covered": clause(BONE, DRIVER, RECORD),
        "it reads how {} itself is turned, which moves: that is not covered": clause(BONE, DRIVER, RECORD),
        "it reads how a bone of {} is turned, which is not covered": clause(BONE, DRIVER, RECORD),
        "it reads {}, which has a delta, in transform space, which is not covered": clause(BONE, DRIVER, RECORD),
    },
    "description.objects": {
        "{} has constraints: bake them into keyframes": clause(),
        "{} is simulated: bake that into keyframes": clause(),
        "{} is a child of a part of {}: parent it to the object": clause(),
        "{} of {} has a driver: bake it into keyframes": clause(DRIVER),
        "{} of {} is keyed, which is not covered: remove those keyframes": clause(),
    },
    "description.reading": {
        "{} is no part of a description": PART,
        "{} is no armature: choose one": PART,
        "rigs can be programs from Blender 4.2 on": PART,
        "{} shows its rest position: switch it to Pose Position": sentence(RECORD),
        "the IK solver is iTaSC: choose the standard one": sentence(RECORD),
        "{} itself has constraints: apply or remove them": sentence(RECORD),
    },
    "description.splines": {
        "the curve {}": PART,
        "{} is in Edit Mode: leave it": sentence(RECORD),
        "{} is empty: give it a spline": sentence(RECORD),
        "{} begins with NURBS that are closed with endpoints or of the kind Bezier but not both, or that have fewer points "
        "than their order, which is not covered: convert them to Bezier": sentence(RECORD),
        "{} has one point alone or is not 3D, which is not covered": sentence(RECORD),
        "{} is closed, which is not covered for Spline IK: open it": sentence(RECORD),
        "{} has the twist Tangent, or smooths it: choose Minimum, and 0 for Smooth": sentence(RECORD),
        "{} has shape keys with different tilts, which is not covered": sentence(RECORD),
        "{} has splines of several resolutions, or a bevel by segment or length": sentence(RECORD),
        "{} has absolute shape keys, one that is shown alone, or one with a vertex group": sentence(RECORD),
        "{} of {} is keyed, which is not covered": sentence(RECORD),
        "{} of {} has a driver, which is not covered": sentence(DRIVER, RECORD),
        "the modifier {} of {} is not covered: only hooks are": sentence(RECORD),
        "the hook {} of {} has a falloff or a group, or no object": sentence(RECORD),
        "the driver of {} of {}: {}": PART,
        "the shape key {} of the curve {} is relative to one that is muted": sentence(RECORD),
    },
    "description.strips": {
        "{} itself moves (its {} is animated): move a bone instead": sentence(RECORD),
        "an NLA strip of {} is being edited: leave its tweak mode": sentence(RECORD),
        "the NLA strip {} is not covered: bake the strips into one action": sentence(RECORD),
        "the NLA strip {} has modifiers: remove them, or bake the strips into one action": sentence(RECORD),
        "the NLA strip {} has a setting whose curve has no keys: key it": sentence(RECORD),
        "curves of {}, which ends below other strips, have modifiers: remove them": sentence(RECORD),
    },
    "description.other_data": {
        "{} of {}": PART,
        "{}, which is the time: use the word frame in the expression": clause(),
        "{}, after an edit of which Blender evaluates no bones: let it read a custom property": clause(),
        "{}, which has a driver: bake it into keyframes": clause(DRIVER),
        "{}, and {}": PART,
        "{}, whose keyframes are not covered: remove them": clause(),
        "{}, which follows from others: let it read what can be keyed": clause(),
    },
    "description.targets": {
        "it looks at the vertices {} of {}, which is not covered": clause(BONE, RECORD),
        "{} has no bone {}: choose another one": clause(BONE, RECORD),
    },
    "plan.animated": {
        "the mesh": PART,
        "the shape keys": PART,
        "the armature": PART,
        "the object": PART,
        ", in the library": PART,
        "The driver of {} runs Python with {}, through which it may change what Sinew has read: write it without{}": sentence(
            DRIVER
        ),
        "remove its driver{}": PART,
        "remove its keyframes{}": PART,
        "{} is {}, and Sinew reads that only after edits: {}": sentence(),
        "{} of {} {}": PART,
        "the data itself (self)": PART,
        "all evaluated data (depsgraph)": PART,
        "data ({})": PART,
    },
    "plan.cages": {
        "{}, which it follows, depends on {} itself: remove one of the two": sentence(),
        "it was bound with Dynamic, which Sinew cannot evaluate: bind it without": clause(),
        "it was bound by an old version of Blender: bind this modifier again": clause(),
    },
    "plan.canvas_survey": {
        "The parent of {} is a vertex of the mesh, which only Blender finds behind the first modifiers": NOTHING,
        "The simplification of a scene is animated, on which the modifiers before the Armature modifier depend": NOTHING,
        "Sinew cannot copy it in this Blender": NOTHING_WITHIN,
        "it depends on another object": NOTHING_WITHIN,
        "it has a curve of its own": NOTHING_WITHIN,
        "In this version of Blender Sinew cannot begin with the result of other modifiers": NOTHING,
        "Its particles need to know which vertex of the mesh each one behind the first modifiers was made from": NOTHING,
        "The mesh {} is animated, and Sinew would begin with a copy of it, which is not": NOTHING,
        "Its custom normals cannot be compared in this version of Blender": NOTHING,
    },
    "plan.driven": {
        "Sinew cannot set it": clause(DRIVER),
        "the driver is invalid": clause(DRIVER),
        "Blender runs Python for it": clause(DRIVER),
        "its variable {} depends on the context": clause(DRIVER),
        "before Blender 4.1, Sinew could not tell if the custom property was removed": clause(DRIVER),
        "the driver's curve has modifiers": clause(DRIVER),
    },
    "plan.drivers": {
        "Blender runs Python for its expression: use a simpler one, or variables alone": clause(DRIVER),
        "it depends on the frame: use keyframes instead": clause(DRIVER),
        "its expression divides by 0 or has no value": clause(DRIVER),
    },
    "plan.fronts": {
        "{} comes before {}, with which Sinew has to begin": NOTHING,
        "it is animated": NOTHING_WITHIN,
        "the object is linked, so Sinew cannot add what it needs to begin with the result": NOTHING_WITHIN,
        "{} comes before {}, and {}": NOTHING,
        "Its method or output needs the mesh's own vertices, and modifiers before the Armature modifier make others": NOTHING,
    },
    "plan.runs": {
        "the mesh": PART,
        "modifiers before {} make other vertices than the mesh's own": NOTHING_WITHIN,
        "Sinew has not found the weights of its vertices yet": NOTHING,
        "other objects share the mesh: make it single-user": clause(SINGLE),
        "the object is linked, so Sinew cannot add what it needs: make a library override of it": clause(),
        "its method or output needs the mesh's own vertices": NOTHING_WITHIN,
        "the Generated coordinates of {} stay in place only while Blender evaluates it": NOTHING_WITHIN,
        "nothing was evaluated yet": NOTHING_WITHIN,
        "{} allows only deforming modifiers before it": NOTHING_WITHIN,
        "{} picks vertices by index, and Blender mixes these up behind Sinew's modifier": NOTHING_WITHIN,
        "it is mixed with {}, which Sinew cannot replace: {}": clause(),
        "{} behind it mixes with it: turn off Multi Modifier there if it need not": clause(),
        "Multi Modifier of {} behind {} is animated: remove that": clause(),
        "it picks vertices by index, and Blender mixes these up behind {}: move it before that one": clause(),
        "the mesh was bound without it, because other modifiers come before it": NOTHING_WITHIN,
        "the mesh was bound without it: unbind the mesh and accelerate it again": clause(),
        "before the armature's, it is evaluated once": NOTHING_WITHIN,
        "Sinew cannot evaluate modifiers of the type {}": NOTHING_WITHIN,
        ": {}": PART,
        "its {}": PART,
        "its switches for viewport and renders differ from those of {}": NOTHING_WITHIN,
        "it is not bound: press Bind in that modifier": clause(BIND),
        "it was bound to {} vertices, and the mesh has {}: bind it again": clause(BIND),
        "{} is driven, and {}": clause(DRIVER),
    },
    "plan.survey": {
        "its weights depend on the shape before it: turn its bone envelopes off, and map its B-bones straight": clause(),
        "Sinew cannot evaluate its falloff curve": NOTHING_WITHIN,
        "{} of {} is animated: remove that": sentence(),
        "The shape of {} lacks its method or smoothing, which Blender does not have. {}": NOTHING,
    },
    "plan.tails": {
        "its result is no weighted sum of the vertices before it": NOTHING_WITHIN,
        "Sinew cannot copy it in this Blender": NOTHING_WITHIN,
        "it is animated": NOTHING_WITHIN,
        "it names {}, which may move: clear that field": clause(),
        "an exporter has switched it off for a while": NOTHING_WITHIN,
        "it keeps normals, which depend on the shape: switch Keep Normals off": clause(),
        "it makes custom normals, which depend on the shape: switch Use Custom Normals off": clause(),
        "it makes custom normals, which depend on the shape{}": NOTHING_WITHIN,
        "which bones it masks depends on the selection": NOTHING_WITHIN,
        "it splits edges by their angle: switch Edge Angle off": clause(),
        "it cuts quads by their shape: set Quad Method to Fixed": clause(),
        "how many copies it makes is no fixed number: set Fit Type to Fixed Count": clause(),
        "it depends on another object: switch Object Offset off": clause(),
        "Relative Offset depends on the shape: use Constant Offset": clause(),
        "{} depends on the shape: switch {} off{}": clause(),
        "{}put the modifier before the armature's": PART,
    },
    "plan.ways": {
        "Its armature is gone: choose another one, or unbind": sentence(),
        "which Blender's own modifier deforms sooner in this version": PART,
        "It has fewer than {} vertices, which Blender's own modifier deforms sooner": NOTHING,
        "Its library was saved by an earlier version of Sinew: open the library once, and save it": sentence(),
        "Its shape keys move vertices": PART,
        "Mesh and armature move against each other": PART,
        "{}, so the weights from envelopes or curved B-bones change on each frame: turn its bone envelopes off, and map its B-bones straight": sentence(),
        ", in the library": PART,
        "{} comes before {}, with which Sinew began: unbind the mesh and accelerate it again, so that Sinew begins with {}{}": sentence(),
        "{} changes the vertex group {} before the mesh is deformed by it: apply {} if the weights may stay as they are{}": sentence(),
        "{}: move {} behind {} if the shape may be made in that order{}": sentence(DOWN),
        "{} comes before {}, with which Sinew has to begin: move {} behind {} if the shape may be made in that order{}": sentence(
            DOWN
        ),
        "and Blender blends its shape keys for all of them": PART,
        "and this one is linked, so Sinew cannot add what it needs: make a library override of it": PART,
        "{} objects share this mesh, {}": PART,
        ": make it single-user": PART,
        "{} objects share this mesh, {}{}": PART,
        "It {}": PART,
        "{} of {}": PART,
        "{} and {} are mixed, but their switches for viewport and renders differ: set them alike": sentence(),
        "has no armature, shape keys or smoothing that Sinew could take over: add one of them": clause(),
        "{} ({} comes first, and {})": PART,
        "is deformed by its parent {} directly, before any modifier: set the parent type to Object": clause(),
        "{}: add a shape key, and Sinew uses that": sentence(BASIS),
        "Its shape keys are absolute, which Sinew cannot blend: make them relative": sentence(),
        "Only the active shape key is shown: turn that off": sentence(),
        "Its Armature modifier is shown only in the viewport or only in renders, which Sinew cannot tell apart on a mesh with shape keys: show it in both": sentence(),
        "{} plays a cache in place of {}, which is switched off": NOTHING,
        "{} is switched off: switch it on": sentence(),
    },
    "host.relations": {
        "actions are not where they were": PART,
        "constraints are not where they were": PART,
        "the parents of objects are not where they were": PART,
        "what drivers read is not where it was": PART,
        "drivers have other types": PART,
        "drivers on each frame": PART,
        "drivers are not where they were": PART,
        "its expression is too long": clause(DRIVER),
        "({}) / {}": PART,
        "({}{}) + 0 * frame": PART,
        "its variables need other names than {}": clause(DRIVER),
        "it has no variables": clause(DRIVER),
        "expressions are not parsed where they were": PART,
    },
}


def template(node):
    """Returns the text of a string in code, {} for each value in it; None for anything else."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else None
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)
    return None


def texts(module):
    """Yields the texts of more than one word in a module, without those that describe its functions."""
    tree = ast.parse((ROOT / "addon" / "sinew" / f"{module.replace('.', '/')}.py").read_text(encoding="utf-8"))
    kinds = ast.Module, ast.FunctionDef, ast.ClassDef
    left_out = {
        each.body[0] for each in ast.walk(tree) if isinstance(each, kinds) and isinstance(each.body[0], ast.Expr)
    }
    queue = [tree]
    for each in queue:
        is_inner = isinstance(each, ast.Call) and ast.unparse(each.func).startswith(("re.", "log."))
        text = template(each)
        if text is not None and " " in text.strip():
            yield text
        elif each not in left_out and not is_inner and text is None:
            queue += ast.iter_child_nodes(each)


def filled(text):
    """Returns a sentence with names in it, "hip" for a bone."""
    text = re.sub(r"(?<=\w)\{\}", "", text.replace('bone "{}"', 'bone "hip"').replace("frame {}", "frame 12"))
    return text.replace("{}", "Body")


def said(module, text):
    is_within, _buttons = TABLE[module][text]
    return FRAMES[module].format(filled(text)) if is_within else filled(text)


def offered(module, reason):
    """Returns the texts of the buttons that the panel offers for a sentence."""
    cures = addon_module("ui.rig_cures")
    if module.startswith("plan."):
        found = [DRIVER] if cures.names_driver(reason) else []
        found += [DOWN] if ": move Body behind " in reason else []
        return found + [button for end, button in OF_MESHES.items() if reason.endswith(end)]
    source = SimpleNamespace(refusal=reason if module in REFUSED else "", is_proven=False)
    ob = SimpleNamespace(
        pose=SimpleNamespace(bones={"hip"}), animation_data=SimpleNamespace(action="action", nla_tracks=[], drivers=[])
    )
    ob.data = SimpleNamespace(animation_data=None)
    rig = SimpleNamespace(ob=ob, source=source, trust=SimpleNamespace(is_distrusted=False, difference=None))
    labels = {cls.bl_idname: cls.bl_label for cls in cures.CLASSES}
    return [text or labels[name] for name, text in cures.offered(reason, rig)]


@pytest.mark.parametrize("module", TABLE)
def test_all_sentences_stand_in_the_table(module):
    found = list(dict.fromkeys(texts(module)))
    assert [text for text in found if text not in TABLE[module]] == [], "add them, with their buttons"
    assert [text for text in TABLE[module] if text not in found] == [], "they are gone"


@pytest.mark.parametrize("module", TABLE)
def test_the_panel_offers_these_buttons(module):
    for text, entry in TABLE[module].items():
        if entry is not PART:
            buttons = [each for each in entry[1] if each != "nothing"]
            assert offered(module, said(module, text)) == buttons, text


@pytest.mark.parametrize("module", TABLE)
def test_sentences_read_well(module):
    as_sentence = addon_module("feedback.notice").as_sentence
    for text, entry in TABLE[module].items():
        assert not re.search(r"[a-z]_[a-z]|[a-z]\.[a-z]|\w\[", text), f"a path of Blender's: {text}"
        if entry is PART:
            continue
        reason = as_sentence(said(module, text))
        assert reason[0].isupper() or reason[0] == '"', reason
        assert not reason.endswith(".") and "  " not in reason, reason
        says_how = ": " in text or "press " in text
        is_cured = says_how or any(each != "nothing" for each in entry[1])
        assert is_cured == ("nothing" not in entry[1]), f"what to do? {text}"


def test_names_of_the_users_keep_their_letters():
    as_sentence = addon_module("feedback.notice").as_sentence
    assert as_sentence("hero is selected") == "hero is selected"
    assert as_sentence('the driver of Location of "x"') == 'The driver of Location of "x"'


# --- Show Driver ----------------------------------------------------------------------------------


def driven(owner, path, index=-1):
    curve = owner.driver_add(path, index)
    curve.driver.expression = "frame"
    return curve


@pytest.mark.parametrize("kind", ("bone", "data", "lamp", "keys"))
def test_the_driver_that_a_sentence_names_is_found(fresh_scene, kind):
    from characters import make_armature, make_mesh

    armature = make_armature()
    collection = bpy.data.collections.new("Character")
    fresh_scene.collection.children.link(collection)
    collection.objects.link(armature)
    bone = armature.pose.bones["bone1"]
    others = [driven(bone, "location", 0), driven(armature, "location", 0)]
    if kind == "bone":
        wanted, reason = (
            driven(bone, "bbone_rollin"),
            'the driver of B-Bone Roll In of the bone "bone1": it reads nothing',
        )
    elif kind == "data":
        wanted, reason = (
            driven(armature.data.bones["bone1"], "bbone_x"),
            'the driver of B-Bone X of the bone "bone1": no',
        )
    elif kind == "lamp":
        lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
        fresh_scene.collection.objects.link(lamp)
        wanted = driven(lamp.data, "energy")
        variable = wanted.driver.variables.new()
        variable.targets[0].id = armature
        reason = (
            "Rig stays Blender's: the driver of Energy of Lamp reads it, and its expression is too long: rewrite it"
        )
    else:
        ob = make_mesh(armature, False)
        ob.shape_key_add(name="Basis")
        key = ob.shape_key_add(name="Wide")
        wanted = driven(key, "value")
        variable = wanted.driver.variables.new()
        variable.targets[0].id = armature
        reason = 'the driver of Value of the shape key "Wide" of Key: it is muted or not valid: mend or delete it'
    cures = addon_module("ui.rig_cures")
    assert cures.names_driver(reason) and cures.driver_of(armature, reason) == wanted not in others
    assert cures.driver_of(armature, "the driver of Energy of Nothing: no") != wanted or kind == "lamp"


def test_show_driver_selects_it(fresh_scene, monkeypatch):
    from characters import make_armature, select

    armature = make_armature()
    first, wanted = driven(armature, "location", 0), driven(armature.pose.bones["bone1"], "bbone_rollin")
    rigs = addon_module("played.rigs")
    rigs.learn(armature).reason = 'the driver of B-Bone Roll In of the bone "bone1" of Rig depends on more'
    select()
    bpy.context.view_layer.objects.active = None
    assert bpy.ops.object.sinew_show_driver(armature=armature.name_full) == {"FINISHED"}
    assert bpy.context.active_object == armature and armature.select_get()
    assert wanted.select and not first.select
    rigs.learn(armature).reason = ""
    with pytest.raises(RuntimeError, match="No driver keeps Rig from Sinew"):
        bpy.ops.object.sinew_show_driver(armature=armature.name_full)
