"""Pictures of all sentences that say why something is left to Blender, each with its buttons as the panel draws them.
For people to look at. Run as first_ogre.py is, on a screen that is high: -screen 0 1000x2400x24."""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from helpers import addon_module
from test_refusals import PART, TABLE, offered, said
from windowed import area, picture, run, window

ON_A_PAGE = 52


class Sentences(bpy.types.Panel):
    bl_idname = "SCENE_PT_sinew_sentences"
    bl_label = "Sentences"
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "scene"
    bl_order = -1
    page: list = []

    def draw(self, context):
        notice = addon_module("feedback.notice")
        for module, reason in self.page:
            column = self.layout.column(align=True)
            notice.draw_sentence(column, context, reason, False)
            row = column.row(align=True)
            for button in offered(module, reason):
                row.operator("wm.sinew_says_nothing", text=button)


class Nothing(bpy.types.Operator):
    bl_idname, bl_label = "wm.sinew_says_nothing", "A button of the panel's, here without effect"


def steps():
    for cls in (Nothing, Sentences):
        bpy.utils.register_class(cls)
    with window():
        largest = max(bpy.context.screen.areas, key=lambda each: each.width * each.height)
        largest.type = "PROPERTIES"
        yield 0.5
        with bpy.context.temp_override(area=largest, region=largest.regions[-1]):
            bpy.ops.screen.screen_full_area(use_hide_panels=True)
    yield 1.0
    area("PROPERTIES").spaces.active.context = "SCENE"
    every = [
        (module, said(module, text))
        for module, texts in TABLE.items()
        for text, entry in texts.items()
        if entry is not PART
    ]
    for first in range(0, len(every), ON_A_PAGE):
        Sentences.page = every[first : first + ON_A_PAGE]
        yield 0.5
        yield from picture(f"sentences-{first // ON_A_PAGE + 1}")


run(steps())
