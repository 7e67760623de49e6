"""Onion skins and motion paths: the button, and the panel with their settings."""

import bpy

from ..feedback import notice
from ..host import evaluations
from ..main import addon_preferences, callbacks
from ..onion import ghost_drawing, ghosts, motion_paths, onion_settings
from ..played import playing, rigs, states
from . import available, played_rigs
from .panels import InSidebar

SECONDS_BETWEEN_LOOKS = 0.3
LOOKS_BEFORE_FILLING = 3  # in which nothing is evaluated
_seen, _looks = 0, 0  # the number of evaluations at the last look, and how many looks there were since


class ToggleOnionSkins(available.Explains, bpy.types.Operator):
    """Show ghosts of the selected characters before and after the current frame: at once if their rigs are computed,
    otherwise on all frames that play from now on. Press again to hide them. The file does not change"""

    bl_idname = "object.sinew_onion_skins"
    bl_label = "Onion Skins"
    bl_options = {"REGISTER"}

    @classmethod
    def why_not(cls, context):
        return played_rigs.nothing_chosen(context)

    def run(self, context):
        armatures = [ob for ob in played_rigs.chosen(context) if rigs.has_animation(ob)]
        if not armatures:
            raise ValueError("the selected characters have no keyframes, so there is nothing to show")
        own = [rigs.learn(ob) for ob in armatures]
        change = ghosts.hide if all(rig.motion.skins is not None for rig in own) else ghosts.show
        for rig in own:
            change(rig)
        if change is ghosts.show:
            ghosts.keep_now(context.scene, context.view_layer)
            if not any(ghosts.is_complete(rig, context.scene) for rig in own):
                self.report(
                    {"INFO"},
                    "Ghosts of rigs that are computed appear in a moment, others on the frames that you play from now "
                    "on. Record plays all of them",
                )
        notice.redraw()


def fill() -> float:
    """Has ghosts around the current frame made that are missing, as a timer, once nothing has been evaluated for a
    moment. Returns the seconds until the next call."""
    global _seen, _looks
    context, settings = bpy.context, addon_preferences.of_sinew()
    if context.window is None or settings is None or not ghosts.shown() or evaluations.is_job_running():
        return SECONDS_BETWEEN_LOOKS
    now = playing.evaluation_count()
    _looks, _seen = _looks + 1 if _seen == now else 0, now
    is_busy = context.screen.is_animation_playing or getattr(context.window, "modal_operators", ())
    if _looks == LOOKS_BEFORE_FILLING and not is_busy:
        _looks, scene, layer = 0, context.scene, context.view_layer
        onion = settings.onion
        around = ghosts.frames_around(scene.frame_current, onion.before, onion.after, onion.step)
        if ghosts.fill(scene, [frame for frame, _steps in reversed(around)]):  # the nearest first
            states.keep_played(scene, layer)
            notice.redraw()
    return SECONDS_BETWEEN_LOOKS


def are_shown(context: bpy.types.Context) -> bool:
    """Whether all selected characters have ghosts."""
    own = [rigs.get(ob) for ob in played_rigs.chosen(context)]
    return bool(own) and all(rig is not None and rig.motion.skins is not None for rig in own)


class SidebarOnionSkins(InSidebar, bpy.types.Panel):
    bl_idname = "VIEW3D_PT_sinew_onion"
    bl_label = "Onion Skins and Motion Paths"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        self.layout.operator(ToggleOnionSkins.bl_idname, icon="ONIONSKIN_ON", depress=are_shown(context))
        settings = addon_preferences.of_sinew(context)
        if settings is not None:
            onion_settings.draw(self.layout, settings.onion)


CLASSES = (ToggleOnionSkins, SidebarOnionSkins)
register_classes, unregister_classes = bpy.utils.register_classes_factory(CLASSES)


def register() -> None:
    register_classes()
    ghost_drawing.start()
    motion_paths.start()
    callbacks.start(fill)


def unregister() -> None:
    callbacks.stop(fill)
    motion_paths.stop()
    ghost_drawing.stop()
    unregister_classes()
