"""How a random walk in Blender that fails is cut down to the steps that matter."""

import sys

import pytest

from walk.shrink import Walker, options_of, shrink


@pytest.mark.parametrize("culprits", ((0,), (99,), (3, 17, 44), (0, 1, 98, 99), tuple(range(20, 30))))
def test_what_matters_is_left(culprits):
    assert shrink(list(range(100)), lambda steps: set(culprits) <= set(steps)) == list(culprits)


def test_steps_that_need_each_other_go_together():
    """No single step of 10 to 13 can be left out without the others."""

    def fails(steps):
        return 50 in steps and len({10, 11, 12, 13} & set(steps)) in (0, 4)

    assert shrink(list(range(60)), fails) == [50]


def test_a_walk_without_steps_is_never_tried():
    assert shrink([7, 8], lambda steps: bool(steps)) == [8]


def test_steps_are_chosen_by_number():
    options = options_of(["--seed", "gate", "--only", "3,17,44"])
    assert (options.seed, options.only) == ("gate", [3, 17, 44])


def test_a_crash_is_a_failure(tmp_path):
    """Whatever takes the program down: the last step that it spoke of is the one."""
    blender = tmp_path / "blender.py"
    blender.write_text(
        "import os\nprint('walk: step 3: undo', flush=True)\nprint('about to', flush=True)\nos.abort()\n"
    )
    walker = Walker([sys.executable, str(blender)], "1", [])
    code, last, said = walker.walk("--steps", "5")
    assert code != 0 and last == 3 and "about to" in said and walker.fails([3])
