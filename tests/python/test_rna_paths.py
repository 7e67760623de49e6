"""What people call a property, from its path."""

import importlib.util
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "addon" / "sinew" / "description" / "rna_paths.py"
spec = importlib.util.spec_from_file_location("rna_paths", SOURCE)
rna_paths = importlib.util.module_from_spec(spec)
spec.loader.exec_module(rna_paths)


@pytest.mark.parametrize(
    "path, text",
    [
        ("location", "Location"),
        ('["sway"]', 'the property "sway"'),
        ('pose.bones["hip"].rotation_euler', 'Rotation Euler of the bone "hip"'),
        ('pose.bones["hip"]["stretch"]', 'the property "stretch" of the bone "hip"'),
        ('pose.bones["hip"].constraints["IK.001"].influence', 'Influence of the constraint "IK.001" of the bone "hip"'),
        (r'pose.bones["a\"b\\c"].scale', 'Scale of the bone "a"b\\c"'),
        ('data.bones["hip"].bbone_rollin', 'Bbone Rollin of the bone "hip"'),
        ('data["size"]', 'data["size"]'),
        ('key_blocks["smile"].value', 'Value of the shape key "smile"'),
        ('modifiers["Hook"].strength', 'Strength of the modifier "Hook"'),
        ("data.pose_position", "Pose Position"),
        ("nodes[3].inputs[0].default_value", "nodes[3].inputs[0].default_value"),
    ],
)
def test_spoken(path, text):
    assert rna_paths.spoken(path) == text
