"""How a random walk in Blender that fails is cut down to the steps that matter."""

import sys

import pytest

from walk.shrink import Walker, failure_of, options_of, shrink


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
    assert code != 0 and last == 3 and "about to" in said and walker.failure([3]) == (code, "")


@pytest.mark.parametrize(
    "code, said, kind",
    [
        (0, "walk: step 7: play", None),
        (1, "walk: FAILED: Tube 1 (bound, KEYS , OBJECT): shape: 1.29e-05 of the diagonal", (1, "shape")),
        (1, "walk: FAILED: Tube 2 (not bound, EDIT): modifiers [], due are ['Armature']", (1, "modifiers")),
        (1, "walk: FAILED: (mesh, bone that it does not wait for) {}", (1, "")),
        (-11, "walk: step 7: play", (-11, "")),
    ],
)
def test_a_failure_is_told_from_others(code, said, kind):
    """So that what is shrunk is the one that was found, whatever its numbers."""
    assert failure_of(code, said + "\nBlender 5.2.2 LTS\n") == kind
