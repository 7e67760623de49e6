"""What an evaluation in another thread leaves for the main thread."""

import threading

import pytest

from helpers import addon_module


def test_letters_wait_for_the_main_thread():
    mail, read = addon_module("run.mail"), []

    def worker():
        mail.post(read.append, "first")
        mail.deliver()  # not here
        mail.post(read.append, "second")

    thread = threading.Thread(target=worker)
    thread.start()
    thread.join()
    assert read == [] and not mail.is_empty()
    mail.deliver()
    assert read == ["first", "second"] and mail.is_empty()


@pytest.mark.says_errors
def test_a_letter_that_cannot_be_done_does_not_stop_the_others():
    mail, read = addon_module("run.mail"), []
    mail.post(lambda: 1 / 0)
    mail.post(read.append, "after it")
    mail.deliver()
    assert read == ["after it"]


def test_a_letter_may_have_the_others_delivered():
    """As one does that has Blender evaluate the scene."""
    mail, done = addon_module("run.mail"), []
    mail.post(mail.deliver)
    mail.post(done.append, 1)
    mail.post(done.append, 2)
    mail.deliver()
    assert done == [1, 2] and mail.is_empty()


def test_a_thread_asks_and_waits():
    """The main thread does it, and none of it if it comes too late."""
    mail, done, answers = addon_module("run.mail"), [], []

    def do(what):
        done.append((what, threading.current_thread()))

    def worker(seconds, what):
        answers.append(mail.ask(seconds, do, what))
        done.append((what, "goes on"))

    late = threading.Thread(target=worker, args=(0.01, "late"))
    late.start()
    late.join()
    mail.deliver()
    assert answers == [False] and done == [("late", "goes on")]
    thread = threading.Thread(target=worker, args=(60, "in time"))
    thread.start()
    while thread.is_alive():
        mail.deliver()
    assert answers == [False, True] and mail.is_asked()
    assert done[1:] == [("in time", threading.main_thread()), ("in time", "goes on")]


@pytest.mark.says_errors
def test_a_thread_that_asks_for_what_fails_goes_on():
    mail, answers = addon_module("run.mail"), []
    thread = threading.Thread(target=lambda: answers.append(mail.ask(60, lambda: 1 / 0)))
    thread.start()
    while thread.is_alive():
        mail.deliver()
    assert answers == [True]
