"""Every instruction set of the machine gives the same shape, to rounding."""

import numpy as np
import pytest
import sinew_native as sinew


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
