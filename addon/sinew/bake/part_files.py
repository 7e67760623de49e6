"""A cache that is not complete yet. Pure.

Until the cache NAME.pc2 is complete, its data is in the folder NAME.pc2.part, in three files of full size:
`positions`, `world`, and the marks, `frames`: a line that describes the bake, and one byte per frame, 1 when that frame
is on the disk. Several processes, on several machines, may fill the files: each writes its frames in place, none waits
for another, and whichever sees the last mark moves the files to their final places. NAME.pc2.json, which stays, holds
the line.

The folder is prepared under another name, then renamed, and nothing is ever added to it. So a process that has its
three files open has files that belong together, even if they were moved in the meantime. systems.py opens and moves
them, so that this holds on Windows, too.

A process may die at any moment. The temporary files that it leaves have its number in their names (leftovers.py) and
are removed by the next process on that machine, or by the one that finishes the cache. If a process died while moving
the files, the next one moves the rest.
"""

import errno
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import numpy as np

from . import leftovers, systems
from . import subject as subjects

SECONDS_BETWEEN_SYNCS = 1.0  # written frames are marked this often: a process that is killed loses no more
MATRIX_SIZE = 128  # bytes of (4, 4) float64
NAMES = ("frames", "positions", "world")
sync_data = getattr(os, "fdatasync", os.fsync)  # macOS has only fsync
ATTEMPTS = 5  # an attempt fails only if another process has moved the files at that moment
MAKE_ROOM = "make room, or choose another folder"
ADVICE = "overwrite it, or choose another folder"
NOT_A_BAKE = "{} is not an unfinished bake of this version of Sinew; " + ADVICE


def write_at(file: int, data: bytes | memoryview, offset: int) -> None:
    """Writes all of data (bytes or memoryview of bytes) to an open file descriptor."""
    data = memoryview(data)
    while data:
        count = systems.pwrite(file, data, offset)
        data, offset = data[count:], offset + count


def folder_of(path: str) -> str:
    """Returns NAME.pc2.part."""
    return f"{path}.part"


def is_unfinished(path: str) -> bool:
    """Whether there is an unfinished cache. An empty folder is none."""
    folder = folder_of(systems.native(path))
    try:
        return bool(os.listdir(folder))
    except OSError:
        return os.path.isdir(folder)


def read_marks(path: str) -> tuple[subjects.Subject, np.ndarray]:
    """Returns (Subject, (F,) bool: which frames are baked) of the unfinished cache. Raises ValueError or OSError."""
    with systems.Folder(folder_of(systems.native(path))) as folder:
        return _read_marks(folder)


def _read_marks(folder):
    with open(folder.open("frames", os.O_RDONLY), "rb") as file:
        subject = subjects.parse(file.readline())
        marks = np.frombuffer(file.read(), np.uint8) == 1
    if len(marks) != len(subject.frames):
        raise ValueError(f"it has {len(marks)} marks, and its description {len(subject.frames)} frames")
    return subject, marks


@contextmanager
def advising_room(path: str) -> Iterator[None]:
    """Adds advice to the error of a full disk, where nothing was baked yet."""
    try:
        yield
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        raise OSError(error.errno, f"{error.strerror}: {MAKE_ROOM}", path) from error


def discard(path: str) -> None:
    """Deletes the frames of an unfinished cache. Raises OSError."""
    path = systems.native(path)
    with suppress(FileNotFoundError, NotADirectoryError), systems.Folder(folder_of(path)) as folder:
        for name in NAMES:
            _remove(path, folder, name)
    shutil.rmtree(folder_of(path), ignore_errors=True)


def tidy(path: str) -> None:
    """Cleans up after processes that died while starting or finishing a cache. The folder must exist. Live processes
    are not disturbed. Raises OSError."""
    path = systems.native(path)
    for each in _made_under_other_names(path):
        leftovers.remove_dead(each)
    with suppress(FileNotFoundError, NotADirectoryError):
        if not set(NAMES).issubset(os.listdir(folder_of(path))):
            _move_files(path)


def _made_under_other_names(path):
    """Returns the paths that are written, or removed, under temporary names."""
    return folder_of(path), subjects.path_beside(path), *(_aside(path, name) for name in NAMES)


def _aside(path, name):
    return f"{folder_of(path)}.{name}"


def _remove(path, folder, name):
    with suppress(FileNotFoundError):  # another process has removed it
        folder.remove(name, leftovers.own_name(_aside(path, name)))


def _move_files(path):
    """Moves the files of a cache to their places, if no frame is missing. Another process may do the same, and others
    may have the files open. Raises OSError."""
    with suppress(ValueError, FileNotFoundError, NotADirectoryError), systems.Folder(folder_of(path)) as folder:
        if not _read_marks(folder)[1].all():  # somebody has begun another cache
            return
        for name, target in (("world", subjects.world_beside(path)), ("positions", path)):
            with suppress(FileNotFoundError):  # another process has moved it
                folder.move(name, target)
        _remove(path, folder, "frames")
    with suppress(OSError):  # it is not empty, or somebody looks at it
        systems.remove_folder(folder_of(path))


class PartFiles:
    """The unfinished files of one cache, a context manager that marks the written frames on exit.

    Raises ValueError if the existing files belong to a different bake, and OSError, with a file name, if the disk is
    full or access is denied.
    """

    def __init__(self, path: str, subject: subjects.Subject) -> None:
        """path: of the complete cache, in an existing folder."""
        path = systems.native(path)
        self.path, self.subject, self._layout = path, subject, subject.layout
        self._line, self._world_header = subject.line(), subjects.world_header(len(subject.frames))
        self._pending: list[int]
        self._files: dict[str, int]
        self._pending, self._synced, self._files = [], time.monotonic(), {}
        for _ in range(ATTEMPTS):
            if self._open():
                break
            self._make()
        else:
            raise ValueError(NOT_A_BAKE.format(folder_of(path)))
        try:
            self._check()
            self.found = self.done()  # frames baked before this run
            self._check_space()
        except BaseException:
            self._close()
            raise

    def __enter__(self):
        return self

    def __exit__(self, kind, error, _trace):
        try:
            self.sync()
        except OSError:
            if kind is None:  # otherwise the first error is the one to report
                raise
        finally:
            self._close()

    # --- opening ---

    def _open(self):
        """Opens the folder and its files. Returns whether all of them exist."""
        try:
            with systems.Folder(folder_of(self.path)) as folder:
                for name in NAMES:
                    self._files[name] = folder.open(name, os.O_RDWR)
        except FileNotFoundError:
            self._close()
            return False
        except BaseException:
            self._close()
            raise
        return True

    def _make(self):
        """Makes the folder, unless another process has made it in the meantime or has just finished the cache."""
        folder = leftovers.own_name(folder_of(self.path))
        try:
            with advising_room(self.path):
                os.makedirs(folder, exist_ok=True)
                count = len(self.subject.frames)
                for name, start, size in (
                    ("frames", self._line, self._marks_size),
                    ("positions", self._layout.header(), self._layout.size),
                    ("world", self._world_header, self._world_offset(count)),
                ):
                    with open(os.path.join(folder, name), "wb") as file:
                        file.write(start)
                        file.flush()
                        systems.resize(file.fileno(), size)
                systems.rename_folder(folder, folder_of(self.path))
        except OSError as error:
            shutil.rmtree(folder, ignore_errors=True)
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOENT):
                raise

    def _check(self):
        line = systems.pread(self._files["frames"], len(self._line), 0)
        if line == self._line and os.fstat(self._files["frames"]).st_size == self._marks_size:
            return
        try:
            there, here = subjects.difference(read_marks(self.path)[0], self.subject)
        except ValueError as error:
            raise ValueError(NOT_A_BAKE.format(folder_of(self.path))) from error
        raise ValueError(f"{folder_of(self.path)} is an unfinished bake of {there}, not of {here}; {ADVICE}")

    def _check_space(self):
        needed = len(self.missing()) * (self._layout.frame_size + MATRIX_SIZE)
        free = shutil.disk_usage(folder_of(self.path)).free
        if needed > free:
            said = f"the bake needs {needed:,} bytes, but only {free:,} are free: {MAKE_ROOM}"
            raise OSError(errno.ENOSPC, said, self.path)

    def _close(self):
        while self._files:
            os.close(self._files.popitem()[1])

    @property
    def _marks_size(self):
        return len(self._line) + len(self.subject.frames)

    def _world_offset(self, index):
        return len(self._world_header) + MATRIX_SIZE * index

    # --- frames ---

    def _marks(self):
        return np.frombuffer(systems.pread(self._files["frames"], len(self.subject.frames), len(self._line)), np.uint8)

    def done(self) -> list[int]:
        """Returns the indices of the frames that are on the disk, whichever process wrote them."""
        return np.flatnonzero(self._marks() == 1).tolist()

    def has(self, index: int) -> bool:
        return systems.pread(self._files["frames"], 1, len(self._line) + index) == b"\1"

    def missing(self) -> list[int]:
        return np.flatnonzero(self._marks() != 1).tolist()

    def write(self, index: int, positions: np.ndarray, world: np.ndarray) -> None:
        """Writes one frame: positions (V, 3) float32, world (4, 4). Raises OSError."""
        with _naming(folder_of(self.path)):
            write_at(self._files["positions"], self._layout.encode(positions), self._layout.offset(index))
            write_at(self._files["world"], np.ascontiguousarray(world, "<f8").tobytes(), self._world_offset(index))
        self._pending.append(index)
        if time.monotonic() - self._synced > SECONDS_BETWEEN_SYNCS:
            self.sync()

    def sync(self) -> None:
        """Waits until the written frames are on the disk, then marks them. Raises OSError."""
        pending, self._pending, self._synced = self._pending, [], time.monotonic()
        if pending:
            with _naming(folder_of(self.path)):
                for name in ("positions", "world"):
                    sync_data(self._files[name])
                for index in pending:
                    systems.pwrite(self._files["frames"], b"\1", len(self._line) + index)
                os.fsync(self._files["frames"])

    def finish(self) -> list[int]:
        """Moves the cache to its place if no frame is missing, whichever process wrote them. Returns the missing
        indices. Another process may do the same at the same time."""
        self.sync()
        missing = self.missing()
        if missing:
            if subjects.is_whole(self.path, self.subject):  # others had finished before this process began
                with suppress(OSError):
                    discard(self.path)
                return []
            return missing
        self._describe()
        _move_files(self.path)
        for each in _made_under_other_names(self.path):
            leftovers.remove_all(each)
        return []

    def _describe(self):
        """Writes the description of the cache into the file beside it."""
        temporary = leftovers.own_name(subjects.path_beside(self.path))
        try:
            with open(temporary, "wb") as file:
                file.write(self._line)
            with suppress(FileNotFoundError):  # another process has finished the same cache and removed it
                systems.replace(temporary, subjects.path_beside(self.path))
        except OSError:
            with suppress(FileNotFoundError):
                os.remove(temporary)
            raise


@contextmanager
def _naming(path):
    """Adds a file name to errors of a file descriptor, which have none."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, path) from error
