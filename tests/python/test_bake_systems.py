"""A cache on Windows, where a file that somebody has open can be neither moved nor deleted, and paths have a limit."""

import errno
import os
import platform
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from test_bake_files import FRAMES, bake, frame_range, job, part_files, point_cache, shape, subject, subjects, verify
from test_bake_files import world as world_of

systems, leftovers = part_files.systems, part_files.leftovers
WHOLE = ["Tube.pc2", "Tube.pc2.json", "Tube.pc2.world.npy"]
IN_USE = "another program uses it: close it there"
REFUSED = "it may not be changed, or another program uses it: close it there, or choose another folder"
SAID = IN_USE, REFUSED  # versions of Windows differ in how they refuse to replace a file

on_windows = pytest.mark.skipif(sys.platform != "win32", reason="other systems move and delete files that are open")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "Tube.pc2"


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(systems, "PATIENCE", 0.2)


def in_folder(path):
    return sorted(os.listdir(path.parent))


# --- paths ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "path, long",
    [
        (r"C:\shots\Körper 1.pc2", r"\\?\C:\shots\Körper 1.pc2"),
        (r"\\server\share\a b\Tube.pc2", r"\\?\UNC\server\share\a b\Tube.pc2"),
        (r"\\?\D:\Tube.pc2", r"\\?\D:\Tube.pc2"),
        (r"\\?\UNC\server\share\Tube.pc2", r"\\?\UNC\server\share\Tube.pc2"),
    ],
)
def test_the_form_of_a_long_path_on_windows(path, long):
    assert systems.extended(path) == long


def test_a_path_is_changed_only_where_it_has_to_be(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    long = os.path.join(*["folder"] * 40, "Tube.pc2")
    assert systems.native("Tube.pc2") == "Tube.pc2"
    if sys.platform == "win32":
        assert systems.native(long) == systems.native(systems.native(long)) == rf"\\?\{os.path.abspath(long)}"
        assert systems.native(long.replace("\\", "/")) == systems.native(long)
    else:
        assert systems.native(long) == long


@pytest.mark.parametrize("count", [3, 30])
def test_long_paths_with_all_kinds_of_letters(tmp_path, count):
    """The longer one has more than the 259 characters that Windows takes otherwise."""
    folder = tmp_path.joinpath(*["Körper 体"] * count)
    path = folder / "Ogre (1) ñ.pc2"
    os.makedirs(systems.native(str(folder)))
    assert (len(str(path)) > 259) == (count == 30)
    assert bake(path, [0, 3]) == [1, 2]
    assert part_files.is_unfinished(str(path)) and part_files.read_marks(str(path))[1].tolist() == [1, 0, 0, 1]
    part_files.tidy(str(path))
    assert bake(path, [1, 2]) == [] and verify.problems(str(path), FRAMES) == []
    assert subjects.is_whole(str(path), subject()) and point_cache.read_header(str(path)) == (5, 3.0, 2.0)
    assert np.array_equal(point_cache.read_frame(str(path), subject().layout, 2), shape(2))
    assert sorted(os.listdir(systems.native(str(folder)))) == [
        f"{path.name}{end}" for end in ("", ".json", ".world.npy")
    ]
    bake(path, [0])
    part_files.discard(str(path))
    assert not part_files.is_unfinished(str(path))


@pytest.mark.parametrize("name", ["con", "Aux", "nul.001", "COM1", "lpt9 .x", "com¹"])
def test_names_that_are_devices_on_windows(name):
    assert job.file_name(name) == f"_{name}"
    assert job.file_name(f"a{name}") == f"a{name}" and job.file_name("console") == "console"


# --- several who use a cache ----------------------------------------------------------------------


def test_threads_that_write_to_one_file(tmp_path):
    file = os.open(tmp_path / "a", os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0))
    block = 1000
    try:
        with ThreadPoolExecutor(8) as pool:
            list(pool.map(lambda i: part_files.write_at(file, bytes([i % 256]) * block, i * block), range(400)))
            found = list(pool.map(lambda i: systems.pread(file, block, i * block), range(400)))
    finally:
        os.close(file)
    assert found == [bytes([i % 256]) * block for i in range(400)]
    assert (tmp_path / "a").read_bytes() == b"".join(found)


def test_bytes_stay_as_they_are(path):
    """Of lines, too, which Windows ends in another way."""
    positions = np.frombuffer(b"\n\r\x1a\0" * 15, np.float32).reshape(5, 3)
    with part_files.PartFiles(str(path), subject()) as part:
        for index in range(4):
            part.write(index, positions, world_of(index))
        assert part.finish() == []
    assert path.read_bytes()[32:] == positions.tobytes() * 4


def test_a_bake_that_another_has_begun_meanwhile_is_not_taken_for_whole(path):
    """The first has all its frames, but its files are no longer those in the folder."""
    with part_files.PartFiles(str(path), subject()) as first:
        for index in range(4):
            first.write(index, shape(index), world_of(index))
        first.sync()
        part_files.discard(str(path))
        assert bake(path, [1]) == [0, 2, 3]
        first.finish()
        assert not path.exists()
    assert part_files.read_marks(str(path))[1].tolist() == [False, True, False, False]


def test_all_are_killed_and_begin_again(path):
    program = (
        f"import sys; sys.path[:0] = [{str(Path(__file__).parent)!r}]\n"
        "import test_bake_files as t\n"
        "t.part_files.SECONDS_BETWEEN_SYNCS = 0\n"
        "t.bake(sys.argv[1], range(int(sys.argv[2]), 60, 2), frames=t.frame_range.FrameRange(1, 60))\n"
    )

    def start(index):
        return subprocess.Popen([sys.executable, "-c", program, str(path), str(index)])

    running = [start(0), start(1)]
    while not part_files.is_unfinished(str(path)) and any(process.poll() is None for process in running):
        pass
    for process in running:
        process.kill()
        process.wait(60)
    assert [process.wait(60) for process in (start(0), start(1))] == [0, 0]
    assert verify.problems(str(path), frame_range.FrameRange(1, 60)) == [] and in_folder(path) == WHOLE
    layout = subjects.of_cache(str(path)).layout
    assert all(np.array_equal(point_cache.read_frame(str(path), layout, i), shape(i)) for i in range(60))


def test_processes_that_live_and_that_do_not():
    process = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    assert systems.is_alive(process.pid) and systems.is_alive(os.getpid()) and systems.is_alive(10**30)
    process.communicate(b"\n", 60)
    assert not systems.is_alive(process.pid)


def test_an_empty_folder_is_no_unfinished_cache(path):
    bake(path, range(4))
    os.mkdir(f"{path}.part")
    assert verify.problems(str(path), FRAMES) == []
    part_files.tidy(str(path))
    assert in_folder(path) == WHOLE
    os.mkdir(f"{path}.part")
    assert bake(path, range(4)) == [] and in_folder(path) == WHOLE


# --- files that another program has open ----------------------------------------------------------


def finish_again(path):
    part_files.tidy(str(path))
    assert verify.problems(str(path), FRAMES) == [] and in_folder(path) == WHOLE


@on_windows
def test_an_older_cache_that_is_being_read(path, impatient):
    """What was baked is kept, and takes the place of the older one when that is no longer in use."""
    path.write_bytes(b"older")
    with open(path, "rb") as reader, pytest.raises(PermissionError) as caught:
        bake(path, range(4))
    assert reader.closed and caught.value.strerror in SAID and caught.value.filename == str(path)
    assert path.read_bytes() == b"older" and part_files.is_unfinished(str(path))
    assert verify.problems(str(path)) == [
        "Tube.pc2 is not finished: all frames are there, but the bake ended before it moved the file"
    ]
    finish_again(path)


@on_windows
@pytest.mark.parametrize("name", part_files.NAMES)
def test_an_unfinished_file_that_is_being_read(path, impatient, name):
    bake(path, range(3))
    file = Path(f"{path}.part", name)
    with open(file, "rb"), pytest.raises(PermissionError) as caught:
        bake(path, [3])
    assert (caught.value.strerror, caught.value.filename) == (IN_USE, str(file))
    if name == "world":  # nothing was moved yet
        assert bake(path, []) == []
    finish_again(path)


@on_windows
@pytest.mark.parametrize("name", part_files.NAMES)
def test_a_file_that_nobody_else_may_open(path, impatient, name):
    bake(path, [0])
    file = f"{path}.part\\{name}"
    handle = systems._handle(file, systems.READ, 0, systems.NORMAL)
    try:
        with pytest.raises(PermissionError) as caught:
            bake(path, [1])
    finally:
        systems.kernel.CloseHandle(handle)
    assert (caught.value.errno, caught.value.strerror, caught.value.filename) == (errno.EACCES, IN_USE, file)
    assert bake(path, [1, 2, 3]) == []


@on_windows
def test_what_is_refused_without_saying_why(path, impatient, monkeypatch):
    """Windows says the same of a file in use and of one that nobody may change."""

    def refuse(*_):
        raise OSError(0, "Access is denied", None, systems.DENIED)

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(PermissionError) as caught:
        bake(path, range(4))
    assert (caught.value.strerror, caught.value.filename) == (REFUSED, f"{path}.json")
    assert in_folder(path) == ["Tube.pc2.part"]


@on_windows
def test_what_is_overwritten_is_being_read(path, impatient):
    """It must not be continued instead."""
    bake(path, [0])
    with open(f"{path}.part/frames", "rb"), pytest.raises(PermissionError, match=IN_USE):
        part_files.discard(str(path))
    part_files.discard(str(path))
    assert os.listdir(path.parent) == []


@on_windows
def test_a_description_that_is_being_read(path, impatient):
    Path(f"{path}.json").write_text("older")
    with open(f"{path}.json", "rb"), pytest.raises(PermissionError) as caught:
        bake(path, range(4))
    assert caught.value.strerror in SAID and caught.value.filename == f"{path}.json"
    assert in_folder(path) == ["Tube.pc2.json", "Tube.pc2.part"]
    assert bake(path, []) == [] and in_folder(path) == WHOLE


@on_windows
def test_who_closes_it_in_time_is_waited_for(path):
    path.write_bytes(b"older")
    reader = open(path, "rb")
    thread = threading.Timer(0.5, reader.close)
    thread.start()
    assert bake(path, range(4)) == [] and reader.closed
    thread.join()
    assert verify.problems(str(path), FRAMES) == []


@on_windows
def test_a_folder_that_somebody_looks_at(path, impatient):
    """It remains, empty, until the next bake."""
    bake(path, range(3))
    with systems.Folder(f"{path}.part"):
        assert bake(path, [3]) == []
        assert in_folder(path) == ["Tube.pc2", "Tube.pc2.json", "Tube.pc2.part", "Tube.pc2.world.npy"]
        assert os.listdir(f"{path}.part") == [] and verify.problems(str(path), FRAMES) == []
        with pytest.raises(PermissionError) as caught:
            bake(path, [0])
        assert (caught.value.strerror, caught.value.filename) == (IN_USE, f"{path}.part")
    part_files.tidy(str(path))
    assert in_folder(path) == WHOLE


@on_windows
def test_nobody_replaces_a_folder_that_is_open(path):
    bake(path, [0])
    with systems.Folder(f"{path}.part"):
        with pytest.raises(PermissionError):
            os.rename(f"{path}.part", f"{path}.other")
        for name in part_files.NAMES:
            os.remove(f"{path}.part/{name}")
        with pytest.raises(PermissionError):
            os.rmdir(f"{path}.part")


@on_windows
def test_a_temporary_folder_whose_maker_still_writes(path):
    """It is left as it is, or taken away as a whole."""
    folder = Path(f"{path}.part.{platform.node()}-{os.getpid()}")
    folder.mkdir()
    for name in part_files.NAMES:
        (folder / name).write_text("")
    with open(folder / "world", "wb"):
        leftovers.remove_all(f"{path}.part")
        assert not folder.exists() or sorted(os.listdir(folder)) == sorted(part_files.NAMES)
    leftovers.remove_all(f"{path}.part")
    assert os.listdir(path.parent) == []
