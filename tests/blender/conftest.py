import bpy
import pytest


@pytest.fixture(autouse=True)
def fresh_scene():
    """Every test starts in an empty file, with the add-on enabled."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.frame_set(1)
    return scene


def pytest_configure(config):
    config.addinivalue_line("markers", "says_errors: something goes wrong on purpose, and the log says so")


@pytest.fixture(autouse=True)
def nothing_went_wrong(request, caplog):
    """Whatever the shapes are in the end: no frame on the way to them may fail."""
    yield
    if request.node.get_closest_marker("says_errors") is None:
        errors = [record.getMessage() for record in caplog.get_records("call") if record.name == "sinew"]
        assert errors == []
