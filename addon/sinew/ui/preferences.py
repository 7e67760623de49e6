"""The settings for all files: Edit > Preferences > Add-ons > Sinew."""

import logging
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, PointerProperty, StringProperty

from ..feedback import notice
from ..host import contract
from ..main import addon_preferences, handlers, memory_use
from ..native import sinew_native
from ..onion import onion_settings
from ..played import rigs, states
from ..run import characters
from . import available

log = logging.getLogger("sinew")
MANUAL = Path(__file__).parents[1] / "manual" / "README.html"

# Blender stores these numbers, so they must be the same on every machine.
_NUMBERS = {
    name: number
    for number, name in enumerate(
        ("auto", "SCALAR", "EMU128", "SSE2", "SSSE3", "SSE4", "AVX2", "AVX3", "AVX3_DL", "AVX3_ZEN4", "AVX3_SPR")
    )
}
INSTRUCTION_SETS = [
    ("auto", "Automatic", "The best that this computer supports", _NUMBERS["auto"]),
    *(
        (
            name,
            name,
            "For comparisons: all of them give the same shapes, up to float32 rounding",
            _NUMBERS.get(name, 100 + i),
        )
        for i, name in enumerate(sinew_native.instruction_sets())
    ),
]


def _apply(preferences, _context=None):
    characters.configure(preferences.thread_count, preferences.instruction_set or "auto")


def _apply_memory(preferences, _context=None):
    rigs.set_limit(preferences.frozen_memory)


def _apply_use(_preferences=None, _context=None):
    """Has Sinew use Blender's memory, or do without it, in the open file too."""
    states.melt_all()
    memory_use.decide()
    handlers.look_anew()


def _apply_log(preferences, _context=None):
    """Logs to the file, or to Blender's console if none is set."""
    _close_log()
    if not preferences.log_file:
        return
    try:
        handler = logging.FileHandler(bpy.path.abspath(preferences.log_file), encoding="utf-8")
    except OSError as error:
        log.error("The log file cannot be written: %s", error)
        return
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    log.addHandler(handler)
    log.propagate = False


def _close_log():
    for handler in list(log.handlers):
        log.removeHandler(handler)
        handler.close()
    log.propagate = True


class SinewPreferences(bpy.types.AddonPreferences):
    bl_idname = addon_preferences.ADDON

    thread_count: IntProperty(
        name="Threads",
        description="The largest number of threads that Sinew uses; 0: as many as the computer has",
        min=0,
        max=1024,
        update=_apply,
    )
    instruction_set: EnumProperty(
        name="Instruction Set",
        description="The processor's instructions that skinning uses",
        items=INSTRUCTION_SETS,
        update=_apply,
    )
    uses_memory: BoolProperty(
        name="Use Blender's Memory",
        description="Read and write Blender's own memory, which is what makes Sinew fast. Without, Blender's own "
        "modifiers deform, and Blender evaluates all rigs",
        default=True,
        update=_apply_use,
    )
    frozen_memory: IntProperty(
        name="Memory for Records (MB)",
        description="The largest number of megabytes for recorded poses and shapes. The oldest are dropped first",
        min=16,
        max=2**20,
        default=rigs.DEFAULT_LIMIT,
        update=_apply_memory,
    )
    onion: PointerProperty(name="Onion Skins", type=onion_settings.SinewOnionSettings)
    log_file: StringProperty(
        name="Log File",
        subtype="FILE_PATH",
        update=_apply_log,
        description="File to which errors are written, with tracebacks; if empty, Blender's console",
    )

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column()
        column.prop(self, "thread_count")
        column.prop(self, "instruction_set")
        column.prop(self, "uses_memory")
        for sentence in contract.sentences():
            notice.draw_sentence(column, context, sentence, False)
        if memory_use.has_crashed():
            column.operator(TryAgain.bl_idname, icon="FILE_REFRESH")
        column.prop(self, "frozen_memory")
        column.prop(self, "log_file")
        column.separator()
        column.label(text="Onion Skins and Motion Paths")
        onion_settings.draw(column, self.onion)
        for line in memory_use.states():
            layout.label(text=line, icon="INFO")
        row = layout.row(align=True)
        row.label(text=f"{sinew_native.instruction_set()}, {sinew_native.thread_count()} threads at work", icon="INFO")
        row.operator(OpenManual.bl_idname, icon="HELP")


class TryAgain(available.Explains, bpy.types.Operator):
    """Use Blender's memory again, although Blender crashed while Sinew used it"""

    bl_idname = "wm.sinew_try_again"
    bl_label = "Try Again"
    bl_options = {"INTERNAL"}

    @classmethod
    def why_not(cls, _context):
        return "" if memory_use.has_crashed() else "Blender has not crashed while Sinew used its memory"

    def run(self, _context):
        memory_use.try_again()
        _apply_use()


class OpenManual(available.Reports, bpy.types.Operator):
    """Open the manual of this version of Sinew in a browser"""

    bl_idname = "wm.sinew_manual"
    bl_label = "Sinew Manual"

    def run(self, _context):
        if not MANUAL.exists():
            raise ValueError(f"There is no manual at {MANUAL}: install Sinew again")
        bpy.ops.wm.url_open(url=MANUAL.as_uri())


CLASSES = (onion_settings.SinewOnionSettings, TryAgain, OpenManual, SinewPreferences)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    preferences = addon_preferences.of_sinew()
    if preferences:
        _apply(preferences)
        _apply_memory(preferences)
        _apply_log(preferences)


def unregister() -> None:
    _close_log()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
