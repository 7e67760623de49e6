"""Handlers and timers in Blender's lists. The lists belong to everybody: a script that clears one takes out Sinew's as
well, and Blender drops a timer that has raised. What is missing is put back."""

import bpy

_handlers = []  # (name of the list in bpy.app.handlers, handler) that belong there
_timers = []
_with_file = []  # functions


def add(handlers):
    """handlers: (name of the list, handler) each."""
    _handlers.extend(handlers)
    put_back()


def remove(handlers):
    """Those that are there."""
    for name, handler in handlers:
        _handlers.remove((name, handler))
        listed = getattr(bpy.app.handlers, name)
        while handler in listed:
            listed.remove(handler)


def start(timer):
    """Also goes on when another file is opened."""
    _timers.append(timer)
    put_back()


def stop(timer):
    _timers.remove(timer)
    if bpy.app.timers.is_registered(timer):
        bpy.app.timers.unregister(timer)


def start_with_file(function):
    """It is called whenever another file is opened."""
    _with_file.append(function)


def stop_with_file(function):
    _with_file.remove(function)


def another_file():
    """Another file was opened."""
    for function in _with_file:
        function()


def put_back():
    """Returns whether a handler was missing."""
    missing = [(name, handler) for name, handler in _handlers if handler not in getattr(bpy.app.handlers, name)]
    for name, handler in missing:
        getattr(bpy.app.handlers, name).append(handler)
    for timer in _timers:
        if not bpy.app.timers.is_registered(timer):
            bpy.app.timers.register(timer, persistent=True)
    return bool(missing)
