"""Played rigs: an armature plays poses that its program computes (it is native) or that were recorded, and Blender does
not evaluate it. docs/played-rig.md tells how, by one example.

`rigs` is what is known of each armature, and `states` has the states. What it follows: `leading`, `settings`; what
follows it: `followers`; why it cannot be played: `reasons`. What it plays: `computing` (a program), `records` and
`recording` (within a limit of memory). Edits: `watch`, `keys`, `changes`, `resting`. Who is believed: `comparing`,
`differences`, `elsewhere`. Who is played unasked: `accelerating`. `playing` plays and checks around each evaluation;
`frame_handlers` calls it.
"""
