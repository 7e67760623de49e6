"""Finds out at the next start whether Blender crashed while Sinew used its memory. Does not use Blender.

While Sinew may use Blender's memory, each process has a small file in Sinew's data folder, which it removes when it
ends. If it crashes, Python writes into that file what each of its threads was doing (faulthandler). So nothing has to
be noted while it runs, and a process that was killed, or whose computer lost power, leaves a file without that. What
begins later looks at the files of processes that are gone, and removes them.
"""

import contextlib
import faulthandler
import json
import os
import re
import sys
import time
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).parents[1].name
_RUNNING, _NEW = ".running", ".new"  # the ends of the files' names; a new one is not locked yet
_RECORD = "crashes.json"
_MOST_BYTES = 1 << 18  # that are read of a file
_SECONDS_ELSEWHERE = 7 * 24 * 3600  # for which files of other computers are left alone: locks may not reach this one


def where_it_crashed(dump: str) -> str:
    """Returns in which function Sinew used Blender's memory when the process crashed, or "".

    dump: what faulthandler wrote. A thread that Python does not know, such as one of Sinew's own or of Blender's, has
    no stack in it: then a thread of Sinew counts that was waiting for others."""
    *_before, last = re.split(r"^(?:Fatal Python error|Windows fatal exception): ", dump, flags=re.M)
    if not _before:
        return ""
    threads = re.split(r"^(?=Current thread |Thread )", last, flags=re.M)
    current = [each for each in threads if each.startswith("Current thread ")]
    for stack in current or threads:
        for path, function in re.findall(r'^  File "(.*)", line \S+ in (.*)$', stack, flags=re.M):
            if _uses_memory(re.split(r"[\\/]+", path), function.strip()):
                return function.strip()
    return ""


def _uses_memory(parts: list[str], function: str) -> bool:
    """Whether a function reads or writes Blender's memory, or calls what does. parts: of its file's path."""
    in_pass = [_PACKAGE, "run", "in_pass.py"]
    return parts[-3:-1] == [_PACKAGE, "host"] or parts[-3:] == in_pass and function == "deform_now"


def _computer() -> str:
    return os.environ.get("COMPUTERNAME", "") if sys.platform == "win32" else os.uname().nodename


def _lock(file: Any) -> bool:
    """Whether a file is locked by this process from now on, until it ends. On Windows, an open file is as good as
    locked: it cannot be removed."""
    if sys.platform == "win32":
        return True
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


class Watch:
    """The file of this process."""

    def __init__(self, folder: Path, blender: str, sinew: str) -> None:
        """folder: Sinew's data folder; blender, sinew: their versions. Raises OSError if there can be no such file, or
        somebody else watches for crashes."""
        if faulthandler.is_enabled():
            raise OSError("somebody else watches for crashes")
        self._process = os.getpid()
        name = f"{self._process}-{time.time_ns():x}"
        self._path = folder / (name + _RUNNING)
        new = self._path if sys.platform == "win32" else folder / (name + _NEW)
        self._file = open(new, "xb", buffering=0)  # it stays open
        try:
            header = {"computer": _computer(), "blender": blender, "sinew": sinew}
            self._file.write(json.dumps(header).encode() + b"\n")
            if not _lock(self._file):
                raise OSError("files cannot be locked there")
            if new != self._path:
                os.rename(new, self._path)
            more: dict[str, Any] = {"c_stack": False} if sys.version_info >= (3, 14) else {}
            faulthandler.enable(self._file, **more)
        except (OSError, ValueError, RuntimeError) as error:
            self._file.close()
            for path in (new, self._path):
                with contextlib.suppress(OSError):
                    os.remove(path)
            raise OSError(str(error)) from error

    def end(self) -> None:
        """Removes the file, since the process ends, or watches no more. A process that was forked from it leaves it."""
        if os.getpid() != self._process or self._file.closed:
            return
        faulthandler.disable()
        self._file.close()
        with contextlib.suppress(OSError):
            os.remove(self._path)


def take_stock(folder: Path) -> bool:
    """Removes the files of processes that are gone, and records those that crashed while Sinew used Blender's memory.
    Returns whether there was one. Does not fail if the folder cannot be read or written."""
    found = False
    with contextlib.suppress(OSError):
        for path in folder.iterdir():
            with contextlib.suppress(OSError):
                if path.suffix == _RUNNING:
                    found |= _judge(path)
                elif path.suffix == _NEW and time.time() - path.stat().st_mtime > _SECONDS_ELSEWHERE:
                    path.unlink()
    return found


def _judge(path: Path) -> bool:
    """Looks at the file of a process. Returns whether that is gone, and crashed while Sinew used Blender's memory."""
    with open(path, "rb") as file:
        first, _, dump = file.read(_MOST_BYTES).decode("utf-8", "replace").partition("\n")
        try:
            header = {key: str(value) for key, value in json.loads(first).items()}
        except (ValueError, AttributeError):
            header = {}
        is_young = time.time() - os.fstat(file.fileno()).st_mtime < _SECONDS_ELSEWHERE
        if header.get("computer", "") != _computer() and is_young or not _lock(file):
            return False
        if sys.platform != "win32":
            path.unlink()
    if sys.platform == "win32":
        path.unlink()  # fails if another process has it open
    where = where_it_crashed(dump)
    if where and {"blender", "sinew"} <= header.keys():
        _record(path.parent, header["blender"], {"sinew": header["sinew"], "where": where, "dump": dump})
        return True
    return False


def _records(folder: Path) -> dict[str, dict[str, str]]:
    try:
        found = json.loads((folder / _RECORD).read_text(encoding="utf-8"))
        return {str(key): dict(value) for key, value in found.items()}
    except (OSError, ValueError, AttributeError, TypeError):
        return {}


def _record(folder: Path, blender: str, crash: dict[str, str] | None) -> None:
    records = _records(folder)
    records.pop(blender, None)
    if crash is not None:
        records[blender] = crash
    new = folder / f"{_RECORD}.{os.getpid()}"
    try:
        new.write_text(json.dumps(records, indent=1), encoding="utf-8")
        os.replace(new, folder / _RECORD)
    except OSError:
        with contextlib.suppress(OSError):
            new.unlink()


def crashed_in(folder: Path, blender: str, sinew: str) -> str:
    """Returns in which function Sinew used Blender's memory when this version of Blender crashed with this version of
    Sinew, or "" if it did not."""
    crash = _records(folder).get(blender, {})
    return str(crash.get("where", "")) if crash.get("sinew") == sinew else ""


def forgive(folder: Path, blender: str) -> None:
    """Forgets the crash of a version of Blender."""
    if blender in _records(folder):
        _record(folder, blender, None)
