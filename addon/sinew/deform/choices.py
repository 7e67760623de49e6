"""What can be chosen for a character that Sinew deforms: each as (identifier, name, what it means)."""

METHODS = (
    ("LINEAR", "Linear", "Linear blend skinning: what the Armature modifier does by default"),
    (
        "DUAL_QUATERNION",
        "Dual Quaternion",
        "Dual quaternion skinning: keeps the volume of twisted and bent limbs, as the Armature "
        "modifier does with Preserve Volume",
    ),
    # Methods that the Armature modifier does not have, see chain/methods.py.
    (
        "BLENDED",
        "Blended",
        "Linear and dual quaternion skinning, mixed vertex by vertex by a share that can be painted",
    ),
    (
        "ROTATION_CENTERS",
        "Centers of Rotation",
        "Each vertex turns about a center of its own, computed once from the weights: limbs neither collapse nor bulge",
    ),
    (
        "DIRECT_DELTA_MUSH",
        "Direct Delta Mush",
        "As if the mesh were smoothed after skinning and had got its detail back, computed once: soft joints, even "
        "from rough weights",
    ),
)
SOURCES = (
    ("CLIP", "Rig's Poses", "The poses that were imported with the rig; the armature follows them"),
    ("ARMATURE", "Armature", "The armature as Blender poses it: keyframes, constraints, drivers, posing by hand"),
)
OUTPUTS = (
    ("MODIFIER", "Modifier", "Show the shape through a modifier: the mesh keeps its rest shape"),
    (
        "MESH",
        "Mesh",
        "Also write the shape on each frame into the vertices of a hidden copy of the object, for "
        "scripts and exporters that read a mesh's vertices",
    ),
)
