"""What people call a property, from its path."""

import importlib.util
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "addon" / "sinew" / "blender" / "spoken_paths.py"
spec = importlib.util.spec_from_file_location("spoken_paths", SOURCE)
spoken_paths = importlib.util.module_from_spec(spec)
spec.loader.exec_module(spoken_paths)


@pytest.mark.parametrize(
    "path, text",
    [
        ("location", "Location"),
        ('["sway"]', 'the property "sway"'),
        ('pose.bones["hip"].rotation_euler', 'Rotation Euler of the bone "hip"'),
        ('pose.bones["hip"]["stretch"]', 'the property "stretch" of the bone "hip"'),
        ('pose.bones["hip"].constraints["IK.001"].influence', 'Influence of the constraint "IK.001" of the bone "hip"'),
        (r'pose.bones["a\"b\\c"].scale', 'Scale of the bone "a"b\\c"'),
        ('data.bones["hip"].bbone_rollin', 'B-Bone Roll In of the bone "hip"'),
        ('data["size"]', 'the property "size"'),
        ('key_blocks["smile"].value', 'Value of the shape key "smile"'),
        ('modifiers["Hook"].strength', 'Strength of the modifier "Hook"'),
        ("data.pose_position", "Pose Position"),
        ("nodes[3].inputs[0].default_value", "Default Value of input 0 of node 3"),
        ('node_tree.nodes["Mix"].mute', 'Mute of the node "Mix" of the node tree'),
        ("vertices[7].co", "Position of vertex 7"),
        ('key_blocks["Wide"].data[3].co', 'Position of point 3 of the shape key "Wide"'),
        ("splines[0].bezier_points[2].handle_left", "Handle Left of bezier point 2 of spline 0"),
        ("rotation_euler[1]", "Rotation Euler 1"),
        ("", ""),
        ("x[", "x["),
    ],
)
def test_spoken(path, text):
    assert spoken_paths.spoken(path) == text


def test_paths_in_a_sentence_are_spoken():
    text = 'the driver of pose.bones["hip"].constraints["IK"].influence reads pose.bones["a b"]["roll"], which is odd'
    assert spoken_paths.in_words(text) == (
        'the driver of Influence of the constraint "IK" of the bone "hip" reads the property "roll" of the bone "a b", '
        "which is odd"
    )
