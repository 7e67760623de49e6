"""Access to Blender's own memory. No other package of the add-on knows its layout.

`members` lists every struct and member that is read or written, and `features` what each feature needs of them.
`contract` checks them against the running Blender's own description (`layout`). `marks`, `mesh_arrays`, `deform_verts`,
`key_blocks`, `places`, `poses`, `bone_memory`, `keyframes`, `driver_memory`, `cage_memory` and `modifier_memory` read
and write. `evaluations` tells what Blender is doing, and renders from viewports; `relations` has it build its graph
anew. `watched_tree` lists what must be unchanged for the fast path. The first time that something is read or written,
it is compared with the value in Blender's API, if that shows it (`proof`).

If the description or a comparison differs, the features that need it are lost (`contract.has`), and `contract.why_not`
returns the reason and what happens instead in one sentence.
"""
