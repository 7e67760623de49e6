"""What a process leaves when it ends, and what a later one makes of it (main/crash_files.py), with real processes."""

import errno
import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "addon/sinew/main/crash_files.py"
IS_WINDOWS = sys.platform == "win32"
# Watches, says so, and does something in a function of a file of Sinew's.
PROCESS = """
import ctypes, importlib.util, os, signal, sys, threading
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # and what nohup starts, this
sys.path.insert(0, sys.argv[3])
spec = importlib.util.spec_from_file_location("crash_files", sys.argv[1])
crash_files = importlib.util.module_from_spec(spec)
spec.loader.exec_module(crash_files)
from pathlib import Path
watch = crash_files.Watch(Path(sys.argv[2]), "5.2.2", "0.2.0")
print("ready", flush=True)
from sinew.host import marks
from sinew.run import in_pass
from sinew.weights import table
def crash():
    ctypes.string_at(0)
def wait():
    sys.stdin.readline()
{what}
watch.end()
"""


@pytest.fixture(scope="module")
def crash_files():
    spec = importlib.util.spec_from_file_location("crash_files", FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def code(tmp_path):
    """A folder with files that are called as some of Sinew's."""
    folder = tmp_path / "code"
    text = "def call(function):\n    function()\n\n\ndef deform_now(function):\n    function()\n"
    for name in ("host/marks", "run/in_pass", "weights/table"):
        path = folder / "sinew" / f"{name}.py"
        path.parent.mkdir(parents=True)
        path.write_text(text)
    return folder


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "data"
    made.mkdir()
    return made


def start(folder, code, what):
    process = subprocess.Popen(
        [sys.executable, "-c", PROCESS.format(what=what), str(FILE), str(folder), str(code)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert process.stdout.readline() == "ready\n"
    return process


def end(process):
    process.communicate("\n", timeout=60)
    return process.returncode


def names(folder):
    return sorted(path.suffix for path in folder.iterdir())


def test_a_process_that_ends_leaves_nothing(crash_files, folder, code):
    process = start(folder, code, "wait()")
    assert names(folder) == [".running"]
    assert not crash_files.take_stock(folder) and names(folder) == [".running"]
    assert end(process) == 0 and names(folder) == []


@pytest.mark.parametrize(
    "what, where",
    [
        ("in_pass.deform_now(crash)", "deform_now"),
        ("marks.call(crash)", "call"),
        ("marks.call(lambda: table.call(crash))", "call"),
        ("in_pass.deform_now(os.abort)", "deform_now"),
        # Not while it uses Blender's memory.
        ("crash()", ""),
        ("table.call(crash)", ""),
        ("in_pass.call(crash)", ""),
        ("in_pass.deform_now(lambda: sys.exit(3))", ""),
        ("in_pass.deform_now(lambda: os._exit(3))", ""),
        ("os.abort()", ""),
        # In another thread: of the crash or of the memory.
        ("t = threading.Thread(target=in_pass.deform_now, args=(crash,)); t.start(); t.join()", "deform_now"),
        (
            "import time; threading.Thread(target=in_pass.deform_now, args=(lambda: time.sleep(9),), daemon=True)"
            ".start(); time.sleep(0.3); crash()",
            "",
        ),
    ],
)
def test_a_crash_counts_while_the_memory_is_used(crash_files, folder, code, what, where):
    process = start(folder, code, what)
    assert end(process) != 0
    assert crash_files.take_stock(folder) == bool(where)
    assert crash_files.crashed_in(folder, "5.2.2", "0.2.0") == where
    assert crash_files.crashed_in(folder, "5.2.1", "0.2.0") == crash_files.crashed_in(folder, "5.2.2", "0.2.1") == ""
    assert names(folder) == ([".json"] if where else [])
    assert not crash_files.take_stock(folder)
    if where:
        assert "Current thread" in json.loads((folder / "crashes.json").read_text())["5.2.2"]["dump"]
    crash_files.forgive(folder, "5.2.2")
    assert crash_files.crashed_in(folder, "5.2.2", "0.2.0") == ""


@pytest.mark.skipif(IS_WINDOWS, reason="Windows has no such signals")
@pytest.mark.parametrize("number", ("SIGKILL", "SIGTERM", "SIGINT", "SIGHUP"))
@pytest.mark.parametrize("what", ("wait()", "in_pass.deform_now(wait)"))
def test_who_is_killed_did_not_crash(crash_files, folder, code, what, number):
    """Wherever it was: a farm that stops a job, or a computer without memory, says nothing about Sinew."""
    process = start(folder, code, what)
    process.send_signal(getattr(signal, number))
    assert end(process) != 0
    assert not crash_files.take_stock(folder) and names(folder) in ([], [".running"])
    assert crash_files.crashed_in(folder, "5.2.2", "0.2.0") == ""


def test_each_process_has_its_own(crash_files, folder, code):
    """One that runs is left alone, while another one that crashed is recorded."""
    running = start(folder, code, "wait()")
    crashed = start(folder, code, "in_pass.deform_now(crash)")
    assert end(crashed) != 0
    assert names(folder) == [".running", ".running"]
    assert crash_files.take_stock(folder) and names(folder) == [".json", ".running"]
    assert end(running) == 0 and names(folder) == [".json"]
    assert crash_files.crashed_in(folder, "5.2.2", "0.2.0") == "deform_now"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_a_fork_leaves_its_parents_file(crash_files, folder, code):
    process = start(
        folder, code, "pid = os.fork()\nif not pid:\n    watch.end()\n    os._exit(0)\nos.waitpid(pid, 0); wait()"
    )
    time.sleep(0.5)
    assert names(folder) == [".running"]
    assert not crash_files.take_stock(folder)
    assert end(process) == 0 and names(folder) == []


def test_files_of_other_computers_are_left_alone_for_a_week(crash_files, folder):
    path = folder / "1-2.running"
    path.write_text(json.dumps({"computer": "elsewhere", "blender": "5.2.2", "sinew": "0.2.0"}) + "\n")
    assert not crash_files.take_stock(folder) and path.exists()
    os.utime(path, (time.time() - 8 * 24 * 3600,) * 2)
    assert not crash_files.take_stock(folder) and not path.exists()


@pytest.mark.parametrize("text", ("", "{}", "[1]", "no json\nFatal Python error: Segmentation fault\n", "\0" * 100))
def test_damaged_files_harm_nothing(crash_files, folder, text):
    for name in ("1-2.running", "crashes.json"):
        (folder / name).write_text(text)
    os.utime(folder / "1-2.running", (0, 0))
    assert not crash_files.take_stock(folder)
    assert crash_files.crashed_in(folder, "5.2.2", "0.2.0") == ""
    crash_files.forgive(folder, "5.2.2")
    assert names(folder) == [".json"]


def test_a_folder_that_is_not_there(crash_files, tmp_path):
    missing = tmp_path / "missing"
    assert not crash_files.take_stock(missing)
    assert crash_files.crashed_in(missing, "5.2.2", "0.2.0") == ""
    crash_files.forgive(missing, "5.2.2")
    with pytest.raises(OSError):
        crash_files.Watch(missing, "5.2.2", "0.2.0")


def test_a_full_disk(crash_files, folder, monkeypatch):
    monkeypatch.setattr(crash_files.faulthandler, "is_enabled", lambda: False)  # pytest's
    monkeypatch.setattr(crash_files.faulthandler, "enable", lambda *_, **__: None)

    def full(*_, **__):
        raise OSError(errno.ENOSPC, "no space")

    monkeypatch.setattr(crash_files.json, "dumps", full)
    with pytest.raises(OSError, match="no space"):
        crash_files.Watch(folder, "5.2.2", "0.2.0")
    assert names(folder) == []
    crash_files.forgive(folder, "5.2.2")
    (folder / "crashes.json").write_text('{"5.2.2": {"sinew": "0.2.0", "where": "deform_now"}}')
    monkeypatch.setattr(crash_files.Path, "write_text", full)
    crash_files.forgive(folder, "5.2.2")
    assert names(folder) == [".json"]


def test_somebody_else_watches(crash_files, folder, monkeypatch):
    monkeypatch.setattr(crash_files.faulthandler, "is_enabled", lambda: True)
    with pytest.raises(OSError, match="somebody else"):
        crash_files.Watch(folder, "5.2.2", "0.2.0")
    assert names(folder) == []


NO_CURRENT = """Fatal Python error: Segmentation fault

Thread 0x00007f7054994780 [blender] (most recent call first):
  File "/a/sinew/run/fast_path.py", line 42 in run
  File "/a/sinew/run/in_pass.py", line 49 in deform_now
"""


def test_a_thread_that_python_does_not_know(crash_files):
    assert crash_files.where_it_crashed(NO_CURRENT) == "deform_now"
    assert crash_files.where_it_crashed(NO_CURRENT.replace("deform_now", "_leave")) == ""
    other = NO_CURRENT.replace("Thread", "Current thread").replace("/a/sinew", "/a/other")
    assert crash_files.where_it_crashed(other + "\n" + NO_CURRENT.partition("\n\n")[2]) == ""


def test_on_windows_the_last_exception_counts(crash_files):
    """Others were handled."""
    dump = NO_CURRENT.replace("Fatal Python error: Segmentation fault", "Windows fatal exception: access violation")
    dump = dump.replace("/", "\\")
    assert crash_files.where_it_crashed(dump) == "deform_now"
    assert crash_files.where_it_crashed(dump + "\n" + dump.replace("sinew", "other")) == ""
