"""What is left of the add-on where its native library cannot be had: a sentence in its preferences."""

import bpy

from .native import problem


class SinewPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    def draw(self, _context):
        row = self.layout.row()
        row.alert = True
        row.label(text=problem, icon="ERROR")


def register():
    bpy.utils.register_class(SinewPreferences)
    print(problem, flush=True)


def unregister():
    bpy.utils.unregister_class(SinewPreferences)
