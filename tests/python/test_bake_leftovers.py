"""What a process leaves that dies while it bakes: the next bake sees to it, and to nothing that anybody uses."""

import errno
import os
import platform
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from test_bake_files import FRAMES, bake, part_files, shape, subject, subjects, verify, whole, world

leftovers = part_files.leftovers

WHOLE = ["Tube.pc2", "Tube.pc2.json", "Tube.pc2.world.npy"]

# Windows has no signals; there, this ends a process at once, too.
KILL = getattr(signal, "SIGKILL", signal.SIGTERM)

REMOVE = "remove" if sys.platform == "win32" else "unlink"  # how the marks are removed

# A process that bakes all frames and is killed just before the call of that function of os with that number.
DYING = """
import os, sys
sys.path[:0] = [{tests!r}]
import test_bake_files as t
count = 0
def counted(*arguments, _call=os.{function}, **named):
    global count
    count += 1
    if count == {number}:
        os.kill(os.getpid(), {kill:d})
    return _call(*arguments, **named)
os.{function} = counted
t.bake(sys.argv[1], range(4))
"""


def die(path, function, number):
    """Returns the dead process's id."""
    program = DYING.format(tests=str(Path(__file__).parent), function=function, number=number, kill=KILL)
    process = subprocess.Popen([sys.executable, "-c", program, str(path)])
    assert process.wait(60) == (KILL if sys.platform == "win32" else -KILL)
    return process.pid


@pytest.fixture
def path(tmp_path):
    return tmp_path / "Tube.pc2"


@pytest.fixture
def dead():
    """The id of a process that is gone."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait(60)
    return process.pid


def test_what_was_not_yet_a_part_is_removed(path):
    """It died just before the folder had its name."""
    process = die(path, "rename", 1)
    assert os.listdir(path.parent) == [f"Tube.pc2.part.{platform.node()}-{process}"]
    part_files.tidy(str(path))
    assert os.listdir(path.parent) == []


def test_the_description_that_was_not_yet_in_its_place_is_removed(path):
    process = die(path, "replace", 1)
    assert sorted(os.listdir(path.parent)) == [f"Tube.pc2.json.{platform.node()}-{process}", "Tube.pc2.part"]
    part_files.tidy(str(path))
    assert os.listdir(path.parent) == ["Tube.pc2.part"]
    assert bake(path, []) == [] and sorted(os.listdir(path.parent)) == WHOLE


@pytest.mark.parametrize("function, number", [("replace", 2), ("replace", 3), (REMOVE, 1), ("rmdir", 1)])
def test_who_died_while_it_moved_the_files(path, tmp_path, function, number):
    """The next one moves the others, and the bytes are those of a bake that nobody killed."""
    (tmp_path / "single").mkdir()
    bake(tmp_path / "single" / "Tube.pc2", range(4))
    (tmp_path / "killed").mkdir()
    path = tmp_path / "killed" / "Tube.pc2"
    die(path, function, number)
    part_files.tidy(str(path))
    if not path.exists():  # it had moved none: the next bake finds all frames there
        assert bake(path, []) == []
    assert verify.problems(str(path), FRAMES) == []
    assert sorted(os.listdir(path.parent)) == WHOLE
    assert {name: path.with_name(name).read_bytes() for name in WHOLE} == whole(tmp_path / "single" / "x")


def test_those_who_live_are_not_disturbed(path, tmp_path, dead):
    """This process, and those of another machine, of which nobody here can know."""
    others = [
        leftovers.own_name(f"{path}.part"),
        f"{path}.part.elsewhere-{dead}",
        f"{path}.json.elsewhere-{dead}",
        f"{tmp_path / 'Tube.001.pc2'}.json.{platform.node()}-{dead}",
        f"{path}.part.{platform.node()}-{10**30}",
        f"{path}.notes-{dead}",
    ]
    bake(path, [0])
    for other in others:
        Path(other).write_text("")
    part_files.tidy(str(path))
    assert sorted(os.listdir(tmp_path)) == sorted([*map(os.path.basename, others), "Tube.pc2.part"])
    assert part_files.read_marks(str(path))[1].tolist() == [True, False, False, False]


def test_when_the_cache_is_whole_nothing_else_is_needed(path, dead):
    for machine in (platform.node(), "elsewhere"):
        Path(f"{path}.part.{machine}-{dead}").mkdir()
        Path(f"{path}.part.{machine}-{dead}", "world").write_text("")
        Path(f"{path}.json.{machine}-{dead}").write_text("")
    assert bake(path, range(4)) == []
    assert sorted(os.listdir(path.parent)) == WHOLE


def test_one_that_begins_as_another_finishes(path, monkeypatch):
    """Whose folder is removed before it has its name: it makes another one."""
    rename = os.rename

    def finish_first(source, target, **named):
        monkeypatch.setattr(os, "rename", rename)
        leftovers.remove_all(f"{path}.part")
        return rename(source, target, **named)

    monkeypatch.setattr(os, "rename", finish_first)
    with part_files.PartFiles(str(path), subject()) as part:
        assert os.rename is rename and part.missing() == [0, 1, 2, 3]


def test_two_that_finish_at_once(path, monkeypatch):
    """The other is done while this one describes the cache."""
    with part_files.PartFiles(str(path), subject()) as first, part_files.PartFiles(str(path), subject()) as second:
        for index in range(4):
            first.write(index, shape(index), world(index))
        first.sync()
        replace = os.replace

        def other_first(*names):
            monkeypatch.setattr(os, "replace", replace)
            assert second.finish() == []
            leftovers.remove_all(subjects.path_beside(str(path)))
            replace(*names)

        monkeypatch.setattr(os, "replace", other_first)
        assert first.finish() == []
    assert verify.problems(str(path), FRAMES) == [] and sorted(os.listdir(path.parent)) == WHOLE


def test_a_description_that_cannot_be_written_leaves_nothing(path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", refuse)
        with pytest.raises(OSError, match="No space left"):
            bake(path, range(4))
    assert os.listdir(path.parent) == ["Tube.pc2.part"]
    assert bake(path, []) == [] and sorted(os.listdir(path.parent)) == WHOLE
