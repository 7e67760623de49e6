"""How far a clip walks: known walks."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

PATH = Path(__file__).resolve().parents[2] / "addon/sinew/crowd/stride.py"
spec = importlib.util.spec_from_file_location("stride", PATH)
stride = importlib.util.module_from_spec(spec)
spec.loader.exec_module(stride)

P, WALKED = 24, np.array([0.6, -0.8, 0.0])


def walker(walked, stance=0.6, flight=0.0):
    """(P, V, 3): a body and two feet. A foot stands for a share of the cycle and is carried ahead in the rest of it."""
    random = np.random.default_rng(1)
    body = random.uniform(-0.2, 0.2, (800, 3)) + (0, 0, 1.5)
    foot = random.uniform(-0.05, 0.05, (60, 3)) * (1, 1, 0.2) + (0, 0, 0.01)
    phases = []
    for number in range(P):
        parts = [body]
        for begin in (0.0, 0.5):
            share = (number / P + begin) % 1
            if share < stance:
                place, height = 0.5 - share / stance, flight
            else:
                swing = (share - stance) / (1 - stance)
                place, height = swing - 0.5, 0.15 * np.sin(np.pi * swing) + flight
            parts.append(foot + place * stance * np.asarray(walked) + (0, 0, height))
        phases.append(np.concatenate(parts))
    return np.float32(phases)


@pytest.mark.parametrize("walked", (WALKED, 3 * WALKED, (0, 0.5, 0)))
@pytest.mark.parametrize("stance", (0.5, 0.6, 0.75))
def test_a_walk_in_place(walked, stance):
    assert np.allclose(stride.stride_of(walker(walked, stance)), walked, rtol=0.05, atol=0.02)


def test_standing_is_no_walk():
    phases = walker((0, 0, 0))
    assert not stride.stride_of(phases).any()
    phases[:, :800] += np.float32(0.1 * np.sin(np.arange(P) * 2 * np.pi / P))[:, None, None]
    assert not stride.stride_of(phases).any()


def test_one_phase_and_none():
    assert not stride.stride_of(walker(WALKED)[:1]).any()
    assert not stride.stride_of(np.zeros((0, 5, 3), np.float32)).any()


def test_drift():
    first = walker(WALKED)[0]
    assert np.allclose(stride.drift_of(first, first + np.float32((2, 1, 0.5))), (2, 1, 0), atol=1e-5)
    assert not stride.drift_of(first, first + np.float32(0.01)).any()


def test_closing():
    first, second = walker(WALKED)[:2]
    assert stride.closes(first, first + np.float32(1e-5))
    assert not stride.closes(first, second)


def test_velocities_of_a_turning_point():
    """Around a circle, once in two seconds."""
    angle = np.arange(64) * 2 * np.pi / 64
    phases = np.float32(np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1))[:, None]
    expected = np.pi * np.stack([-np.sin(angle), np.cos(angle), 0 * angle], -1)[:, None]
    assert np.allclose(stride.velocities(phases, 2.0), expected, atol=0.01)
