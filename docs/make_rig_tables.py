#!/usr/bin/env python3
"""Makes the tables at the end of rigs.md, from the library's settings of bones and constraints.

    docs/make_rig_tables.py MODULE_FOLDER [--check]

MODULE_FOLDER has the compiled module, as ./dev build leaves it in build/python. --check writes nothing and exits 1 with
a sentence if the page is not what it would be.
"""

import importlib
import sys
from pathlib import Path

PAGE = Path(__file__).resolve().parent / "rigs.md"
MARK = "<!-- From here on made by docs/make_rig_tables.py: change it there. -->\n"

# Blender's numbers of choices. A key is a setting's name, with the type of constraint if the name has several meanings.
EULER_ORDERS = "AUTO XYZ XZY YXZ YZX ZXY ZYX".split()
AXES = "X Y Z -X -Y -Z".split()
CHOICES = {
    "owner_space, target_space": "WORLD LOCAL POSE LOCAL_WITH_PARENT - CUSTOM LOCAL_OWNER_ORIENT".split(),
    "euler_order, to_euler_order": EULER_ORDERS,
    "from_rotation_mode": [*EULER_ORDERS, *"QUATERNION SWING_TWIST_X SWING_TWIST_Y SWING_TWIST_Z".split()],
    "mix_mode of COPY_ROTATION": "REPLACE OFFSET ADD BEFORE AFTER".split(),
    "mix_mode of COPY_TRANSFORMS": "REPLACE BEFORE AFTER BEFORE_SPLIT AFTER_SPLIT BEFORE_FULL AFTER_FULL".split(),
    "mix_mode of ACTION": "AFTER_FULL AFTER BEFORE BEFORE_FULL AFTER_SPLIT BEFORE_SPLIT REPLACE".split(),
    "mix_mode of TRANSFORM": "ADD REPLACE".split(),
    "mix_mode_rot": "ADD REPLACE BEFORE AFTER".split(),
    "mix_mode_scale": "REPLACE MULTIPLY".split(),
    "map_from, map_to": "LOCATION ROTATION SCALE".split(),
    "map_to_x_from, map_to_y_from, map_to_z_from": AXES[:3],
    "limit_mode": "LIMITDIST_INSIDE LIMITDIST_OUTSIDE LIMITDIST_ONSURFACE".split(),
    "free_axis": "SAMEVOL_X SAMEVOL_Y SAMEVOL_Z".split(),
    "mode of MAINTAIN_VOLUME": "STRICT UNIFORM SINGLE_AXIS".split(),
    "track_axis": [f"TRACK_{axis.replace('-', 'NEGATIVE_')}" for axis in AXES],
    "lock_axis": "LOCK_X LOCK_Y LOCK_Z".split(),
    "forward_axis": [f"TRACK_{axis}".replace("-", "NEGATIVE_") if "-" in axis else f"FORWARD_{axis}" for axis in AXES],
    "up_axis": "UP_X UP_Y UP_Z".split(),
    "volume": "VOLUME_XZX VOLUME_X VOLUME_Z NO_VOLUME".split(),
    "keep_axis": "PLANE_X SWING_Y PLANE_Z".split(),
    "floor_location": [f"FLOOR_{axis.replace('-', 'NEGATIVE_')}" for axis in AXES],
    "rotation_range": {-1: "ALWAYS_ACTIVE"} | dict(enumerate("NX NY NZ X Y Z".split())),
    "y_scale_mode": "NONE FIT_CURVE BONE_ORIGINAL".split(),
    "xz_scale_mode": "NONE BONE_ORIGINAL INVERSE_PRESERVE VOLUME_PRESERVE".split(),
    "transform_channel": {
        first + i: f"{name}_{axis}"
        for first, name in ((0, "ROTATION"), (10, "SCALE"), (20, "LOCATION"))
        for i, axis in enumerate("XYZ")
    },
    "interpolation": "CONSTANT LINEAR BEZIER BACK BOUNCE CIRC CUBIC ELASTIC EXPO QUAD QUART QUINT SINE".split(),
    "easing": "AUTO EASE_IN EASE_OUT EASE_IN_OUT".split(),
}


def choices_of(kind, setting):
    """Returns the names of a constraint's or key's choices by number, or None for an unknown setting."""
    for title, names in CHOICES.items():
        settings, _, owner = title.partition(" of ")
        if setting in settings.split(", ") and owner in ("", kind):
            numbers = names if isinstance(names, dict) else dict(enumerate(names))
            return {number: name for number, name in numbers.items() if name != "-"}
    return None


def code(names):
    return ", ".join(f"`{name}`" for name in names)


def settings_of(settings):
    """Returns a constraint's settings as text, by type."""

    def listed(*kinds):
        return ", ".join(
            f"`{name}`" + (f" ({count} numbers)" if count > 1 else "") + (f" = {default:g}" if default else "")
            for name, (count, kind, default, *_limits) in settings.items()
            if kind in kinds
        )

    parts = [("switches", listed("BOOLEAN")), ("choices", listed("ENUM")), ("numbers", listed("FLOAT", "INT"))]
    return "; ".join(f"{title} {text}" for title, text in parts if text)


def wanted(sinew):
    """Returns all that comes after MARK."""
    lines = ["", "## The numbers of a bone", "", "Those from `data.bones` are the rest bone's.", ""]
    lines += ["| in `values` | path | name |", "|---|---|---|"]
    place, seen = 0, set()
    for name, count in sinew.rig_bone_settings():
        start = "data" if name in seen else "pose"
        places = f"{place}" if count == 1 else f"{place} to {place + count - 1}"
        lines.append(f"| {places} | `{start}.bones[...]` | `{name}` |")
        seen.add(name)
        place += count
    types = sinew.rig_constraint_settings()
    common = {name: types["LIMIT_SCALE"][name] for name in list(types["LIMIT_SCALE"])[:8]}
    lines += ["", "## The settings of constraints", "", "Without a number after `=`, the default is 0.", ""]
    lines += ["| type | settings |", "|---|---|", f"| all | {settings_of(common)} |"]
    for kind, settings in types.items():
        own = {name: setting for name, setting in settings.items() if name not in common}
        lines.append(f"| `{kind}` | {settings_of(own) or 'no others'} |")
    lines += ["", "## The numbers of choices", "", "| choice | numbers |", "|---|---|"]
    for title in CHOICES:
        setting, _, owner = title.partition(" of ")
        numbers = choices_of(owner, setting.split(", ")[0]).items()
        lines.append(
            f"| {code(setting.split(', '))}{' of ' + owner if owner else ''} | "
            + ", ".join(f"{number} {name}" for number, name in numbers)
            + " |"
        )
    return "\n".join(lines) + "\n"


def check(sinew):
    """Returns what is wrong, or None."""
    head, mark, tail = PAGE.read_text(encoding="utf-8").partition(MARK)
    if not mark:
        return f"{PAGE.name} has lost its line {MARK.strip()}"
    return None if tail == wanted(sinew) else f"{PAGE.name} has old tables: run docs/make_rig_tables.py build/python"


def main(arguments):
    sys.path.insert(0, arguments[0])
    sinew = importlib.import_module("sinew_native")
    if "--check" in arguments:
        sys.exit(check(sinew))
    head, mark, _ = PAGE.read_text(encoding="utf-8").partition(MARK)
    if not mark:
        sys.exit(f"{PAGE.name} has lost its line {MARK.strip()}")
    PAGE.write_text(head + MARK + wanted(sinew), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
