"""Temporary files of this process and of others. Their names say which machine and which process made them. Pure."""

import os
import platform
import re
import shutil
import sys
from contextlib import suppress


def own_name(path, end=""):
    """Beside path; no other process has it."""
    return f"{path}.{platform.node()}-{os.getpid()}{end}"


def remove_dead(path, end=""):
    """Those of processes of this machine that are gone. Of other machines' processes nobody here can know."""
    for name, machine, process in _all_of(path, end):
        if machine == platform.node() and not _is_alive(int(process)):
            _remove(name)


def remove_all(path, end=""):
    """Once nobody needs them."""
    for name, *_ in _all_of(path, end):
        _remove(name)


def _all_of(path, end):
    """[(path, machine, process)], whoever has made them."""
    folder, start = os.path.split(path)
    pattern = re.compile(rf"{re.escape(start)}\.(.+)-(\d+){re.escape(end)}")
    found = [pattern.fullmatch(name) for name in os.listdir(folder or os.curdir)]
    return [(os.path.join(folder, match[0]), match[1], match[2]) for match in found if match]


def _is_alive(process):
    if sys.platform == "win32":  # where this would end it
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        pass
    return True


def _remove(path):
    """Another process may do the same."""
    if os.path.isdir(path):
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            os.remove(path)
