"""Keeps Sinew's handlers and timers in Blender's lists. All add-ons share these lists: a script that clears one also
removes Sinew's entries, and Blender drops a timer that has raised. Missing entries are put back."""

from collections.abc import Callable, Iterable
from typing import Any

import bpy

# (name of the list in bpy.app.handlers, handler) of all that should be there
_handlers: list[tuple[str, Callable[..., Any]]] = []
_first: list[Callable[..., Any]] = []  # handlers that are put before all others in their lists
_last: list[tuple[str, Callable[..., Any]]] = []  # as in _handlers: those that are put after all others
_timers: list[Callable[[], float | None]] = []
_with_file: list[Callable[[], Any]] = []  # called whenever a different file is opened


def add(handlers: Iterable[tuple[str, Callable[..., Any]]], is_first: bool = False, is_last: bool = False) -> None:
    """Adds handlers. handlers: (name of the list in bpy.app.handlers, handler) each; is_first: before all others;
    is_last: after all others, wherever `put_last` is called in time."""
    handlers = list(handlers)
    _handlers.extend(handlers)
    _first.extend(handler for _name, handler in handlers if is_first)
    _last.extend(handlers if is_last else ())
    put_back()


def put_last(*names: str) -> None:
    """Moves the handlers that come last to the ends of these lists, where other add-ons may have added theirs. Blender
    may be going through a list, if it is at a handler before them."""
    for name in names:
        listed = getattr(bpy.app.handlers, name)
        own = [handler for each, handler in _last if each == name and handler in listed]
        if listed[len(listed) - len(own) :] != own:
            for handler in own:
                listed.remove(handler)
                listed.append(handler)


def remove(handlers: Iterable[tuple[str, Callable[..., Any]]]) -> None:
    """Removes handlers, given as to `add`, wherever a list still has them."""
    for name, handler in handlers:
        _handlers.remove((name, handler))
        if handler in _first:
            _first.remove(handler)
        if (name, handler) in _last:
            _last.remove((name, handler))
        listed = getattr(bpy.app.handlers, name)
        while handler in listed:
            listed.remove(handler)


def start(timer: Callable[[], float | None]) -> None:
    """Starts a timer, which continues when a different file is opened."""
    _timers.append(timer)
    put_back()


def stop(timer: Callable[[], float | None]) -> None:
    _timers.remove(timer)
    if bpy.app.timers.is_registered(timer):
        bpy.app.timers.unregister(timer)


def start_with_file(function: Callable[[], Any]) -> None:
    """Registers a function that is called whenever a different file is opened."""
    _with_file.append(function)


def stop_with_file(function: Callable[[], Any]) -> None:
    _with_file.remove(function)


def another_file() -> None:
    """Calls the registered functions, since a different file was opened."""
    for function in _with_file:
        function()


def put_back() -> bool:
    """Puts missing handlers and timers back. Returns whether a handler was missing."""
    missing = [(name, handler) for name, handler in _handlers if handler not in getattr(bpy.app.handlers, name)]
    for name, handler in missing:
        listed = getattr(bpy.app.handlers, name)
        listed.insert(0 if handler in _first else len(listed), handler)
    for timer in _timers:
        if not bpy.app.timers.is_registered(timer):
            bpy.app.timers.register(timer, persistent=True)
    return bool(missing)
