"""Blender's own memory: the one room that knows what lies where in it.

`contract` lists every struct and member that is read or written, and checks them against the running Blender's own
description (`layout`). `marks`, `deform_verts`, `motions`, `places`, `key_blocks`, `vector_arrays` and `switches` read
and write. `watch` lists what has to be unchanged for the shorter way through a frame. The first time that one of them
is used, what it finds is compared with what Blender's API says (`proof`).

Where the description or a comparison differs, `contract.trouble` says so in one sentence, and Blender's own modifiers
deform.
"""
