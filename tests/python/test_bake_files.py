"""Files of a bake: laid out at once, filled by several processes, never taken for whole before they are."""

import errno
import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ADDON = Path(__file__).resolve().parents[2] / "addon" / "sinew"
sys.path.append(str(ADDON))
from bake import frame_range, job, part_files, point_cache, verify  # noqa: E402
from bake import subject as subjects  # noqa: E402

FRAMES = frame_range.FrameRange(3, 9, 2)
VERTICES = 5


def subject(**changed):
    return subjects.Subject(
        **{
            "object": "Tube",
            "format": "pc2",
            "vertex_count": VERTICES,
            "frames": FRAMES,
            "rate": 24.0,
            "until_subdivision": False,
            "blend": "0123",
            **changed,
        }
    )


def shape(index, vertices=VERTICES):
    return np.arange(3 * vertices, dtype=np.float32).reshape(-1, 3) + 100 * index


def world(index):
    return np.eye(4) * (index + 1)


def bake(path, indices, **changed):
    """What one process does. Returns the missing indices."""
    with part_files.PartFiles(str(path), subject(**changed)) as part:
        for index in indices:
            part.write(index, shape(index, part.subject.vertex_count), world(index))
        return part.finish()


# --- frames ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "words, frames",
    [("1-4", [1, 2, 3, 4]), ("1-6:2", [1, 3, 5]), ("-3--1", [-3, -2, -1]), ("7", [7]), ("-2-2:2", [-2, 0, 2])],
)
def test_frames_are_read(words, frames):
    found = frame_range.parse(words)
    assert list(found) == frames and len(found) == len(frames)
    assert frame_range.parse(str(found)) == found


@pytest.mark.parametrize(
    "words, said",
    [
        ("4-1", r"the last frame \(1\) comes before the first \(4\)"),
        ("1-4:0", "the step between frames is 0"),
        ("a-b", "a-b is not a range of frames; write it like 1-40, or 1-40:2 for every second frame"),
        ("1-9999999", "the frames 1-9999999 go beyond Blender's, -1,048,574 to 1,048,574; choose others"),
    ],
)
def test_wrong_frames(words, said):
    with pytest.raises(ValueError, match=said):
        frame_range.parse(words)


def test_a_chunk_has_frames_of_the_range():
    assert FRAMES.indices_of(frame_range.parse_chunk("4-8")) == [1, 2]
    assert FRAMES.indices_of(frame_range.parse_chunk("9,3-5:2")) == [0, 1, 3]
    with pytest.raises(ValueError, match="the chunk 1-5 reaches beyond the frames 3-9:2"):
        FRAMES.indices_of(frame_range.parse_chunk("1-5"))
    with pytest.raises(ValueError, match="the chunk 4,6 has none of the frames 3-9:2"):
        FRAMES.indices_of(frame_range.parse_chunk("4,6-6:2"))


def test_frames_as_people_write_them():
    assert frame_range.words_of([1, 2, 3, 7]) == "1-3, 7"
    assert frame_range.words_of([1, 3, 5, 9], 2) == "1-5:2, 9"


# --- jobs -----------------------------------------------------------------------------------------


def test_what_cannot_be_asked_for():
    chunk = frame_range.parse_chunk("3-5")
    for options, said in (
        (dict(format="abc"), "there is no format abc; choose one of pc2, mdd, usd"),
        (dict(chunk=chunk, format="usd"), "USD file is written by one process"),
        (dict(chunk=chunk, overwrite=True), "a chunk cannot overwrite"),
        (dict(usd_points=True), "only a USD file has points instead of a skeleton: choose the format usd"),
    ):
        with pytest.raises(ValueError, match=said):
            job.Job("folder", FRAMES, **options)


def test_names_become_those_of_files():
    wanted = job.Job("folder", FRAMES)
    assert wanted.path_of("Körper 1.001") == os.path.join("folder", "Körper 1.001.pc2")
    assert wanted.path_of("a/b:c") == os.path.join("folder", "a_b_c.pc2")
    assert wanted.path_of("..") == os.path.join("folder", "_...pc2")
    wanted.check_names(["a", "b"])
    with pytest.raises(ValueError, match=r"a/b and a_B would both be written to a_B.pc2"):
        wanted.check_names(["a/b", "a_B"])


# --- layouts --------------------------------------------------------------------------------------


def test_pc2_byte_by_byte(tmp_path):
    path = tmp_path / "Tube.pc2"
    assert bake(path, range(4)) == []
    data = path.read_bytes()
    assert data[:32] == struct.pack("<12siiffi", b"POINTCACHE2\0", 1, VERTICES, 3.0, 2.0, 4)
    assert data[32:] == b"".join(struct.pack("<15f", *shape(i).reshape(-1)) for i in range(4))
    assert point_cache.read_header(str(path)) == (VERTICES, 3.0, 2.0)


def test_mdd_byte_by_byte(tmp_path):
    path = tmp_path / "Tube.mdd"
    assert bake(path, range(4), format="mdd") == []
    data = path.read_bytes()
    assert data[:24] == struct.pack(">ii4f", 4, VERTICES, 0, 2 / 24, 4 / 24, 6 / 24)
    assert data[24:] == b"".join(struct.pack(">15f", *shape(i).reshape(-1)) for i in range(4))
    assert point_cache.read_header(str(path)) == (VERTICES, None, 1.0)


def test_what_stands_beside(tmp_path):
    path = tmp_path / "Tube.pc2"
    bake(path, range(4))
    assert sorted(os.listdir(tmp_path)) == ["Tube.pc2", "Tube.pc2.json", "Tube.pc2.world.npy"]
    assert np.array_equal(np.load(tmp_path / "Tube.pc2.world.npy"), [world(i) for i in range(4)])
    assert subjects.of_cache(str(path)) == subject()
    assert verify.problems(str(path), FRAMES) == []


def test_a_file_that_is_no_cache(tmp_path):
    path = tmp_path / "a.pc2"
    path.write_bytes(b"something else")
    with pytest.raises(ValueError, match="a.pc2 is neither a PC2 nor an MDD file"):
        point_cache.read_header(str(path))


# --- several processes ----------------------------------------------------------------------------


def whole(path):
    return {name: (path.parent / name).read_bytes() for name in os.listdir(path.parent)}


@pytest.mark.parametrize("format", point_cache.FORMATS)
def test_chunks_in_any_order_give_the_bytes_of_one_bake(tmp_path, format):
    for folder, chunks in (("one", [range(4)]), ("many", [[2], [0, 1], [3]])):
        (tmp_path / folder).mkdir()
        for chunk in chunks:
            missing = bake(tmp_path / folder / f"Tube.{format}", chunk, format=format)
        assert missing == []
    assert whole(tmp_path / "many" / "x") == whole(tmp_path / "one" / "x")


def test_two_formats_of_one_object_in_a_folder(tmp_path):
    """Of different frames, so that neither has the other's places."""
    frames = {"pc2": FRAMES, "mdd": frame_range.FrameRange(1, 2)}
    for format, those in frames.items():
        bake(tmp_path / f"Tube.{format}", range(len(those)), format=format, frames=those)
    for format, those in frames.items():
        assert verify.problems(str(tmp_path / f"Tube.{format}"), those) == []
        assert len(np.load(tmp_path / f"Tube.{format}.world.npy")) == len(those)


def test_until_the_last_frame_is_there_no_whole_file_is(tmp_path):
    path = tmp_path / "Tube.pc2"
    assert bake(path, [0, 3]) == [1, 2]
    assert os.listdir(tmp_path) == ["Tube.pc2.part"]
    assert verify.problems(str(path)) == ["Tube.pc2 is not finished: 2 of 4 frames are missing (5-7:2)"]
    with part_files.PartFiles(str(path), subject()) as part:
        assert part.found == [0, 3] and part.has(3) and not part.has(2)


def test_two_that_fill_the_files_at_once(tmp_path):
    """Each finishes while the other still has the files open."""
    path = str(tmp_path / "Tube.pc2")
    with part_files.PartFiles(path, subject()) as first, part_files.PartFiles(path, subject()) as second:
        for part, indices in ((first, (0, 1, 2)), (second, (3, 2))):
            for index in indices:
                part.write(index, shape(index), world(index))
            part.sync()
        assert first.finish() == [] and second.finish() == []
        second.write(2, shape(2), world(2))
    assert verify.problems(path) == [] and sorted(os.listdir(tmp_path))[0] == "Tube.pc2"


def test_one_that_comes_when_the_others_are_done(tmp_path):
    """It had looked before they were: it begins with empty files, which must not take the place of the whole one."""
    path = tmp_path / "Tube.pc2"
    bake(path, range(4))
    before = whole(path)
    assert bake(path, [1]) == []
    assert whole(path) == before


def test_processes_of_their_own(tmp_path):
    program = (
        f"import sys; sys.path[:0] = [{str(Path(__file__).parent)!r}]\n"
        "import test_bake_files as t\n"
        "t.bake(sys.argv[1], range(int(sys.argv[2]), 400, 4), frames=t.frame_range.FrameRange(1, 400))\n"
    )
    path = tmp_path / "Tube.pc2"
    running = [subprocess.Popen([sys.executable, "-c", program, str(path), str(i)]) for i in range(4)]
    assert [process.wait(60) for process in running] == [0] * 4
    assert verify.problems(str(path), frame_range.FrameRange(1, 400)) == []
    layout = subjects.of_cache(str(path)).layout
    assert all(np.array_equal(point_cache.read_frame(path, layout, i), shape(i)) for i in range(400))


# --- what goes wrong ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "changed, said",
    [
        (dict(vertex_count=6), "is an unfinished bake of 5 vertices, not of 6 vertices"),
        (dict(frames=frame_range.FrameRange(3, 8)), "of the frames 3-9:2, not of the frames 3-8"),
        (dict(object="Other"), "of the object Tube, not of the object Other"),
        (dict(rate=25.0), "of 24 frames a second, not of 25 frames a second"),
        (dict(until_subdivision=True), "of all modifiers, not of the modifiers before Subdivision"),
        (dict(blend="4567"), r"of another state of the .blend, not of the present one"),
    ],
)
def test_an_unfinished_bake_of_something_else(tmp_path, changed, said):
    path = tmp_path / "Tube.pc2"
    bake(path, [0])
    with pytest.raises(ValueError, match=said):
        bake(path, [1], **changed)
    assert bake(path, [1, 2, 3]) == []


def test_a_folder_that_is_no_bake(tmp_path):
    (tmp_path / "Tube.pc2.part").mkdir()
    (tmp_path / "Tube.pc2.part" / "mine.txt").write_text("mine")
    with pytest.raises(ValueError, match="Tube.pc2.part is not an unfinished bake of this version of Sinew"):
        bake(tmp_path / "Tube.pc2", [0])
    assert os.listdir(tmp_path) == ["Tube.pc2.part"] and os.listdir(tmp_path / "Tube.pc2.part") == ["mine.txt"]


def test_a_full_disk_keeps_what_was_baked(tmp_path, monkeypatch):
    path = tmp_path / "Tube.pc2"
    with pytest.raises(OSError) as caught, part_files.PartFiles(str(path), subject()) as part:
        part.write(0, shape(0), world(0))
        with monkeypatch.context() as patch:
            patch.setattr(part_files.systems, "pwrite", full)
            part.write(1, shape(1), world(1))
    assert (caught.value.errno, caught.value.filename) == (errno.ENOSPC, f"{path}.part")
    assert part_files.read_marks(str(path))[1].tolist() == [True, False, False, False]
    assert bake(path, [1, 2, 3]) == []


def full(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_folder_that_forbids_it_is_left_as_it_was(tmp_path, monkeypatch):
    def forbid(*_, **__):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), "here")

    monkeypatch.setattr(os, "rename", forbid)
    with pytest.raises(PermissionError):
        bake(tmp_path / "Tube.pc2", [0])
    assert os.listdir(tmp_path) == []


def test_a_bake_that_would_not_fit_does_not_begin(tmp_path, monkeypatch):
    usage = type("Usage", (), {"free": 700})
    monkeypatch.setattr(part_files.shutil, "disk_usage", lambda _: usage)
    with pytest.raises(
        OSError, match="the bake needs 752 bytes, but only 700 are free: make room, or choose another folder"
    ):
        bake(tmp_path / "Tube.pc2", [0])


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
@pytest.mark.parametrize("function", ["makedirs", "rename"])
def test_a_disk_that_is_full_at_the_start(tmp_path, monkeypatch, number, function):
    def refuse(*_, **__):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, function, refuse)
    with pytest.raises(OSError) as caught:
        bake(tmp_path / "Tube.pc2", [0])
    assert caught.value.errno == number and caught.value.filename == str(tmp_path / "Tube.pc2")
    assert caught.value.strerror == f"{os.strerror(number)}: make room, or choose another folder"
    assert os.listdir(tmp_path) == []


def test_frames_are_marked_once_they_are_on_the_disk(tmp_path, monkeypatch):
    path = tmp_path / "Tube.pc2"
    monkeypatch.setattr(part_files, "sync_data", full)
    with pytest.raises(OSError, match="No space left"):
        bake(path, [0])
    assert not part_files.read_marks(str(path))[1].any()


def spoil_size(path):
    os.truncate(path, os.path.getsize(path) - 1)


def spoil_numbers(path):
    with open(path, "r+b") as file:
        file.seek(32 + 12 * VERTICES)
        file.write(struct.pack("<f", float("nan")))


def spoil_header(path):
    with open(path, "r+b") as file:
        file.seek(16)
        file.write(struct.pack("<i", 4))


def spoil_description(path):
    Path(f"{path}.json").write_text(json.dumps({"object": "Tube"}))


def spoil_world(path):
    np.save(path.parent / "Tube.pc2.world.npy", np.eye(4))


def write_world(data):
    return lambda path: (path.parent / "Tube.pc2.world.npy").write_bytes(data)


def npy_header(words):
    """Of a .npy file, with these words in the place of the description."""
    return b"\x93NUMPY\1\0" + struct.pack("<H", 118) + words.encode().ljust(117) + b"\n"


@pytest.mark.parametrize(
    "spoil, said",
    [
        (spoil_size, "Tube.pc2 has 271 bytes; with 5 vertices on 4 frames it should have 272"),
        (spoil_numbers, "Tube.pc2 has numbers that are not finite on frames 5"),
        (spoil_header, "the header of Tube.pc2 is not that of a PC2 file with these frames and vertices"),
        (spoil_description, "is not a description that this version of Sinew has written"),
        (spoil_world, "Tube.pc2.world.npy does not hold 4 matrices of float64"),
        (write_world(b""), "Tube.pc2.world.npy is not a complete .npy file"),
        (write_world(b"PK\3\4"), "Tube.pc2.world.npy is not a complete .npy file"),
        (write_world(npy_header("{{[")), "Tube.pc2.world.npy is not a complete .npy file"),
        (
            write_world(
                npy_header("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999999999999999, 4)}")
            ),
            "Tube.pc2.world.npy is not a complete .npy file",
        ),
        (os.remove, "Tube.pc2 is missing"),
        (lambda path: os.remove(f"{path}.json"), "Tube.pc2.json is missing, which says what Tube.pc2 should hold"),
        (lambda path: os.remove(path.parent / "Tube.pc2.world.npy"), "Tube.pc2.world.npy is missing"),
    ],
)
def test_what_is_wrong_with_a_cache_is_said(tmp_path, spoil, said):
    path = tmp_path / "Tube.pc2"
    bake(path, range(4))
    spoil(path)
    (problem,) = verify.problems(str(path), FRAMES)
    assert said in problem


@pytest.mark.parametrize(
    "name, values",
    [
        ("object", (5, None)),
        ("format", ("abc", None, ["pc2"])),
        ("vertex_count", ("5", 5.0, True, None, -1, 2**31, [5])),
        ("frames", (7, None, "a-b", "1-9999999")),
        ("rate", ("24", None, 0, -24.0, float("nan"), float("inf"), 10**400)),
        ("until_subdivision", ("NO", 0, None)),
        ("blend", (5, None)),
        ("version", (2, None, "1")),
        ("other", (1,)),
    ],
)
@pytest.mark.parametrize("format", point_cache.FORMATS)
def test_a_spoilt_description_is_called_so(tmp_path, format, name, values):
    path = tmp_path / f"Tube.{format}"
    bake(path, range(4), format=format)
    good = json.loads(Path(f"{path}.json").read_text())
    for value in values:
        Path(f"{path}.json").write_text(json.dumps({**good, name: value}))
        assert verify.problems(str(path), FRAMES) == [f"{path}.json: {NO_DESCRIPTION}"], value
        assert not subjects.is_whole(str(path), subject(format=format))


NO_DESCRIPTION = "it is not a description that this version of Sinew has written"


def test_a_description_that_is_something_else(tmp_path):
    path = tmp_path / "Tube.pc2"
    bake(path, range(4))
    for data in (b"", b"\xff", b"null", b"[]", b"5", b'"a"', b"{}", b"{", b"[" * 100_000):
        Path(f"{path}.json").write_bytes(data)
        assert verify.problems(str(path), FRAMES) == [f"{path}.json: {NO_DESCRIPTION}"], data[:9]


@pytest.mark.parametrize(
    "data", [b"", b"{}\n", subject(vertex_count="5").line(), subject().line() + b"\1\1"], ids=range(4)
)
def test_an_unfinished_bake_that_is_spoilt(tmp_path, data):
    path = tmp_path / "Tube.pc2"
    bake(path, [0])
    (tmp_path / "Tube.pc2.part" / "frames").write_bytes(data)
    said = f"{path}.part is not an unfinished bake of this version of Sinew"
    assert verify.problems(str(path), FRAMES) == [said]
    with pytest.raises(ValueError) as caught:
        bake(path, [1])
    assert str(caught.value) == f"{said}; overwrite it, or choose another folder"


def test_a_cache_of_other_frames(tmp_path):
    path = tmp_path / "Tube.pc2"
    bake(path, range(4))
    assert verify.problems(str(path), frame_range.parse("3-9")) == ["Tube.pc2 has the frames 3-9:2, not 3-9"]
