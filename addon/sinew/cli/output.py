"""The output of the commands: for each a JSON document, and the same as text."""

import os
from collections.abc import Iterable, Sequence
from typing import Any

import bpy
import numpy as np

from ..host import contract
from ..plan import bindable
from ..profiling import costs
from ..rig_files import rig_import
from ..rig_files.file_options import FileOptions
from ..run import characters
from . import command_options
from .arguments import word

BENCH_ROWS = (
    ("pose_ms", "pose + forward kinematics"),
    ("skin_ms", "skinning"),
    ("sinew_ms", "whole frame, Sinew"),
    ("modifier_ms", "whole frame, Armature modifier"),
    ("largest_distance", "largest distance between the two"),
    ("largest_motion", "largest motion"),
)


def report_rig(path: str, options: FileOptions) -> tuple[dict[str, Any], str]:
    folder, skeleton = os.path.split(path)
    rig = rig_import.read_rig(folder, skeleton, options)
    influences = np.count_nonzero(rig.weights > 0, axis=1)
    numbers = {
        "vertices": len(rig.positions),
        "faces": len(rig.face_offsets) - 1,
        "joints": rig.skeleton.joint_count,
        "weight_columns": rig.weights.shape[1],
        "poses": rig.poses.pose_count if rig.poses else 0,
        "animation_frames": 0 if rig.animation is None else len(rig.animation),
        "mean_influences": float(influences.mean()),
        "most_influences": int(influences.max()),
        "unweighted_vertices": int(np.count_nonzero(influences == 0)),
        "clamped_weights": rig.clamped_weights,
    }
    rows = [(name.replace("_", " "), value) for name, value in numbers.items()]
    text = f"{path} ({rig.skeleton.convention} convention)\n\n{table(rows)}"
    return {"path": path, "convention": rig.skeleton.convention, **numbers}, text


def report_meshes(path: str, objects: Iterable[bpy.types.Object]) -> tuple[dict[str, Any], str]:
    """Returns the meshes that something deforms, and in `unknown` what Sinew does without in this version of
    Blender."""
    meshes = [describe_mesh(ob) for ob in objects]
    rows: list[tuple] = [("mesh", "vertices", "bones", "deformed by", "method", "pose", "output")]
    rows += [
        tuple(
            mesh[key] if mesh[key] is not None else ""
            for key in ("name", "vertices", "bones", "deformed_by", "method", "source", "output")
        )
        for mesh in meshes
    ]
    problems = [f"Sinew cannot deform {mesh['name']}: {mesh['problem']}" for mesh in meshes if mesh["problem"]]
    text = table(rows) if meshes else "No mesh is deformed by an armature, shape keys or smoothing."
    unknown = contract.sentences()
    return {"path": path, "meshes": meshes, "unknown": unknown}, "\n".join([path, "", text, *problems, *unknown])


def describe_mesh(ob: bpy.types.Object) -> dict[str, Any]:
    """Returns what deforms a mesh, with `problem`: why Sinew does not or could not deform it, or None."""
    settings, armature = ob.sinew, bindable.find_armature(ob)
    mesh = {
        "name": ob.name_full,
        "vertices": len(ob.data.vertices),
        "armature": armature and armature.name,
        "bones": len(armature.data.bones) if armature else 0,
    }
    if settings.is_bound:
        mesh |= {
            "deformed_by": "Sinew",
            "method": word(settings.method) if settings.modifiers else None,
            "source": word(settings.source) if settings.modifiers else None,
            "output": word(settings.installed_output),
        }
    else:
        modifier = bindable.armature_modifier(ob) or next((m for m in ob.modifiers if m.type == "ARMATURE"), None)
        mesh |= {"deformed_by": "Blender", "method": None, "source": None, "output": None}
        if modifier is not None:
            preserves = modifier.use_deform_preserve_volume
            mesh |= {
                "deformed_by": f"modifier {modifier.name}",
                "method": command_options.BLENDERS_METHODS[preserves],
                "source": "armature",
            }
    return mesh | {"problem": problem_of(ob)}


def problem_of(ob: bpy.types.Object) -> str | None:
    """Returns why Sinew does not or could not deform a mesh, or None."""
    if not ob.sinew.is_bound:
        return bindable.why_not_accelerated(ob) or None
    entry = characters.character(ob)
    return entry and (entry.status.error or entry.way.reason) or None


def report_profile(path: str, profile: costs.Profile) -> tuple[dict[str, Any], str]:
    computer = {"blender": bpy.app.version_string, "cores": os.cpu_count()}
    text = [
        f"{path}, {costs.heading(profile)}; Blender {bpy.app.version_string}, {os.cpu_count()} cores",
        "",
        table([("object", "a frame", "Accelerate"), *costs.rows(profile)]),
    ]
    remarks = costs.remarks(profile)
    return {"path": path, **computer, **profile.document()}, "\n".join(text + ([""] + remarks if remarks else []))


def report_bench(options: Any, contest: Any, results: list[dict[str, Any]]) -> tuple[dict[str, Any], str]:
    meshes = [
        {
            "name": ob.name,
            "vertices": len(ob.data.vertices),
            "bones": len(ob.sinew.armature.data.bones) if ob.sinew.armature else 0,
        }
        for ob, _ in contest.pairs
    ]
    document = {
        "path": options.path,
        "blender": bpy.app.version_string,
        "cores": os.cpu_count(),
        "frames": len(contest.frames),
        "output": options.output,
        "meshes": meshes,
        "skipped": contest.skipped,
        "results": results,
    }
    heading = [f"{mesh['name']}: {mesh['vertices']:,} vertices, {mesh['bones']} bones" for mesh in meshes]
    heading += [f"deformed by Blender in both: {why}" for why in contest.skipped.values()]
    heading += [
        f"medians of {len(contest.frames)} frames, output {options.output}; "
        f"Blender {bpy.app.version_string}, {os.cpu_count()} cores"
    ]
    rows = [("milliseconds per frame", *(result["method"] for result in results))]
    rows += [(label, *(result[name] for result in results)) for name, label in BENCH_ROWS]
    return document, "\n".join([*heading, "", table(rows)])


def table(rows: Sequence[tuple]) -> str:
    """Returns rows of words and numbers as aligned text. Columns of numbers are aligned right."""
    cells = [[cell if isinstance(cell, str) else number_text(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells)]
    pads = [str.ljust if isinstance(cell, str) else str.rjust for cell in rows[-1]]
    return "\n".join(
        "  ".join(pad(cell, width) for pad, cell, width in zip(pads, row, widths)).rstrip() for row in cells
    )


def number_text(number: float) -> str:
    if isinstance(number, int):
        return f"{number:,}"
    return f"{number:.3f}" if abs(number) >= 1e-3 else f"{number:.2g}"
