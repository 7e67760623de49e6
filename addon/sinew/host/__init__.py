"""Access to Blender's own memory. No other package of the add-on knows its layout.

`members` lists every struct and member that is read or written, and `features` what each feature needs of them.
`contract` checks them against the running Blender's own description (`layout`). `marks`, `copies`, `connections`,
`deform_verts`, `motions`, `places`, `key_blocks`, `vector_arrays`, `lattices`, `bindings`, `poses`, `keyframes`,
`bone_numbers` and `switches` read and write. `graph_modes` tells renders from viewports. `watched_tree` lists what
must be unchanged for the fast path. The first time that something is read or written, it is compared with the
value in Blender's API, if that shows it (`proof`).

If the description or a comparison differs, the features that need it are lost (`contract.has`), and `contract.why_not`
returns the reason and what happens instead in one sentence.
"""
