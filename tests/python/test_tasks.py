"""sinew_native.Task: a function in a thread of the library's own."""

import subprocess
import sys
import threading
import time
import weakref
from pathlib import Path

import pytest
from sinew_native import Task


def test_it_runs_in_another_thread_and_returns():
    task = Task(threading.get_ident)
    assert task.result() not in (None, threading.get_ident()) and task.is_done and task.wait(0)
    assert task.result() == task.result()


def test_it_runs_meanwhile():
    may_end = threading.Event()
    task = Task(lambda: may_end.wait(60))
    assert not task.is_done and not task.wait(0) and not task.wait(0.05)
    may_end.set()
    assert task.wait() and task.result() is True


def test_what_it_raises_is_raised():
    def fail():
        raise KeyError("gone")

    task = Task(fail)
    for _ in range(2):
        with pytest.raises(KeyError, match="gone") as raised:
            task.result()
    assert raised.traceback[-1].name == "fail"


def test_nothing_is_kept():
    class Work:
        def __call__(self):
            return self

    work = Work()
    known, task = weakref.ref(work), Task(work)
    task.wait()
    del work, task
    end = time.monotonic() + 60
    while known() is not None and time.monotonic() < end:
        time.sleep(0.01)
    assert known() is None


def python(code):
    start = f"import sys, time; sys.path.insert(0, {str(Path(sys.modules['sinew_native'].__file__).parent)!r})\n"
    start += "from sinew_native import Task\n"
    return subprocess.run([sys.executable, "-c", start + code], capture_output=True, text=True, timeout=60, check=False)


def test_python_waits_for_it_before_it_ends():
    done = python("Task(lambda: (time.sleep(0.3), print('done', flush=True)))")
    assert (done.returncode, done.stdout, done.stderr) == (0, "done\n", "")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such timer")
def test_ctrl_c_ends_waiting():
    done = python("""
import signal, threading
may_end = threading.Event()
task = Task(lambda: may_end.wait(60))
signal.setitimer(signal.ITIMER_REAL, 0.2)
signal.signal(signal.SIGALRM, lambda *_: signal.default_int_handler(signal.SIGINT, None))
try:
    task.wait()
except KeyboardInterrupt:
    may_end.set()
    print(task.result())
""")
    assert done.stdout == "True\n", done.stderr


@pytest.mark.parametrize("work", (None, 1, "print"))
def test_what_cannot_be_called(work):
    with pytest.raises(TypeError, match="^work is .*; expected a function"):
        Task(work)
