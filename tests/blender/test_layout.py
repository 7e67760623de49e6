"""How the layout of Blender's structs is read: from a file that the running Blender writes."""

import sys

import bpy

from helpers import addon_module


def test_temporary_data_are_not_freed_while_a_name_stands_for_them():
    """Blender gives away its one reference, the one that the name behind `as` holds."""
    name = object()
    _held_by_both_contexts = [name, name]
    expected = sys.getrefcount(name)
    with addon_module("blender.layout").temporary_data() as data:
        count = sys.getrefcount(data)
        assert count >= expected
        assert isinstance(data, bpy.types.BlendData)


def test_reading_the_layout_changes_nothing_in_the_open_file():
    before = [repr(one) for one in bpy.data.user_map()]
    structs = addon_module("blender.layout").structs.__wrapped__()
    assert structs["Mesh"].size > 0
    assert [repr(one) for one in bpy.data.user_map()] == before
