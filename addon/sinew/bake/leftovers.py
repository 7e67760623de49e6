"""Temporary files of this process and of others. Their names contain the machine and process that made them. Pure."""

import os
import platform
import re
import shutil
from contextlib import suppress

from . import systems


def own_name(path: str, end: str = "") -> str:
    """Returns a name beside path that no other process uses."""
    return f"{path}.{platform.node()}-{os.getpid()}{end}"


def remove_dead(path: str, end: str = "") -> None:
    """Removes the temporary files of dead processes of this machine. Whether processes on other machines are alive
    cannot be known here."""
    for name, machine, process in _all_of(path, end):
        if machine == platform.node() and not systems.is_alive(int(process)):
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


def _remove(path):
    """Removes a file or folder. A folder goes as a whole, so that its maker, if it lives, notices and makes another.
    Another process may do the same at the same time."""
    with suppress(OSError):
        if os.path.isdir(path):
            gone = own_name(path)
            os.rename(path, gone)
            shutil.rmtree(gone, ignore_errors=True)
        else:
            os.remove(path)
