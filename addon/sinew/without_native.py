"""The add-on when its native library cannot be loaded: only a sentence in its preferences."""

import bpy

from .feedback import notice
from .native import problem


class SinewPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    def draw(self, context):
        notice.draw_sentence(self.layout, context, problem, True)


def register():
    bpy.utils.register_class(SinewPreferences)
    print(problem, flush=True)


def unregister():
    bpy.utils.unregister_class(SinewPreferences)
