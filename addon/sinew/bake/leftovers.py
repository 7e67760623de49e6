"""Temporary files of this process and of others. Their names contain the machine and process that made them. Pure."""

import os
import platform
import re
import shutil
import sys
from contextlib import suppress


def own_name(path: str, end: str = "") -> str:
    """Returns a name beside path that no other process uses."""
    return f"{path}.{platform.node()}-{os.getpid()}{end}"


def remove_dead(path: str, end: str = "") -> None:
    """Removes the temporary files of dead processes of this machine. Whether processes on other machines are alive
    cannot be known here."""
    for name, machine, process in _all_of(path, end):
        if machine == platform.node() and not _is_alive(int(process)):
            _remove(name)


def remove_all(path: str, end: str = "") -> None:
    """Removes all temporary files, once nobody needs them."""
    for name, *_ in _all_of(path, end):
        _remove(name)


def _all_of(path, end):
    """Returns [(path, machine, process)] of all temporary files, whoever made them."""
    folder, start = os.path.split(path)
    pattern = re.compile(rf"{re.escape(start)}\.(.+)-(\d+){re.escape(end)}")
    found = [pattern.fullmatch(name) for name in os.listdir(folder or os.curdir)]
    return [(os.path.join(folder, match[0]), match[1], match[2]) for match in found if match]


def _is_alive(process):
    if sys.platform == "win32":  # there, os.kill would end the process
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        pass
    return True


def _remove(path):
    """Removes a file or folder. Another process may do the same at the same time."""
    if os.path.isdir(path):
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            os.remove(path)
