"""Every instruction set of the machine gives the same shape, to rounding."""

import threading

import numpy as np
import pytest
import sinew_native as sinew

import rigs


@pytest.fixture(autouse=True)
def best_set_again():
    yield
    sinew.set_instruction_set("auto")


def test_names():
    names = sinew.instruction_sets()
    assert len(names) == len(set(names)) >= 1
    assert sinew.instruction_set() == names[0]
    for name in names:
        sinew.set_instruction_set(name)
        assert sinew.instruction_set() == name


def test_an_unknown_name_is_refused():
    with pytest.raises(ValueError, match='no instruction set "MMX"; expected auto or one of'):
        sinew.set_instruction_set("MMX")


@pytest.mark.parametrize("function", (sinew.skin_linear, sinew.skin_dual_quaternion))
def test_all_sets_agree(function):
    random = np.random.default_rng(5)
    rest = random.uniform(-1, 1, (1003, 3)).astype(np.float32)
    weights = np.zeros((1003, 8))
    for vertex, row in enumerate(weights):
        row[(vertex // 100 + np.arange(3)) % 8] = random.dirichlet((1, 1, 1))
    skin = sinew.Skin.from_dense(rest, weights)
    angles = random.uniform(-1, 1, 8)
    rotations = np.stack([np.cos(angles / 2), *np.zeros((2, 8)), np.sin(angles / 2)], axis=1)
    matrices = sinew.rotation_transforms(rotations).astype(np.float32)
    results = []
    for name in sinew.instruction_sets():
        sinew.set_instruction_set(name)
        results.append(function(skin, matrices))
    assert not np.allclose(results[0], rest, atol=0.05)
    for result in results[1:]:
        np.testing.assert_allclose(result, results[0], atol=1e-6)


def test_another_set_may_be_chosen_while_threads_skin():
    """A skin that is packed for other registers than the kernels have would come out as garbage."""
    random = np.random.default_rng(6)
    rest = random.uniform(-1, 1, (100_000, 3)).astype(np.float32)
    joints = np.stack((np.arange(100_000) // 5000, np.arange(100_000) // 5000 + 1), 1).reshape(-1)
    skin = sinew.Skin(rest, np.arange(0, 200_001, 2), joints, np.full(200_000, 0.5), 21)
    matrices = rigs.random_matrices(random, 21, dtype=np.float32)
    expected = sinew.skin_linear(skin, matrices)
    differences = []

    def skin_again_and_again():
        for _ in range(100):
            differences.append(np.abs(sinew.skin_linear(skin, matrices) - expected).max())

    threads = [threading.Thread(target=skin_again_and_again) for _ in range(2)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        for name in sinew.instruction_sets():
            sinew.set_instruction_set(name)
    assert len(differences) == 200 and max(differences) < 1e-5
