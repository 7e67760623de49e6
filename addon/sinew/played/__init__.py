"""Frozen characters: an armature plays poses that are computed or were recorded, and Blender does not evaluate it.

`records` keeps poses and shapes within a limit of memory; `watch` notices edits of what a pose depends on, and
`stored_keys` finds which frames an edit of keyframes changes; `followers` finds what follows an armature; `reasons` are
why it cannot be frozen; `rigs` is what is known of each armature, and gives the recorded shapes to others
(`rigs.shapes`); `shapes` are those of its meshes; `changes` records and drops; `freezing` has the states, and freezes
and thaws; `computing` computes what rigs allow, `comparing` compares that with Blender, and `accelerating` has it done
unasked; `playing` plays and checks around each evaluation; `handlers` calls it.

How it works: a frame change reaches an armature through its action alone. Blender looks at the action only while it
builds relations, so it is taken away in memory for that moment (host/relations.py). From then on the bones are not
evaluated. Before each evaluation, the recorded pose is written into the evaluated bones (host/poses.py), where
everything that follows them reads it as ever: Sinew's hooks, which the same rebuild makes depend on the frame, and
objects that hang on bones, which are tagged. After each evaluation the pose is compared with the record. If it
differs, or if anything else is in doubt, the armature is thawed in the same update.
"""
