"""Gives F-curves random modifiers of all types that programs compute, for comparing them with Blender."""

from typing import Any

TYPES = "CYCLES", "GENERATOR", "FNGENERATOR", "ENVELOPE", "LIMITS", "STEPPED"


def modify(curve: Any, random: Any) -> None:
    """Adds up to three modifiers."""
    for _ in range(random.randint(0, 3)):
        kind = random.choice(TYPES[1:] if len(curve.modifiers) else TYPES)
        modifier = curve.modifiers.new(kind)
        globals()[f"_{kind.lower()}"](modifier, random)
        if kind != "CYCLES" and random.random() < 0.3:
            modifier.use_influence, modifier.influence = True, random.random()
        if kind not in ("CYCLES", "STEPPED") and random.random() < 0.3:
            modifier.use_restricted_range = True
            modifier.frame_start, modifier.frame_end = random.uniform(0, 15), random.uniform(16, 40)
            modifier.blend_in, modifier.blend_out = random.choice((0, 3.3)), random.choice((0, 4.1))
        modifier.mute = random.random() < 0.1


def _cycles(modifier: Any, random: Any) -> None:
    modes = "NONE", "REPEAT", "REPEAT_OFFSET", "MIRROR"
    modifier.mode_before, modifier.mode_after = random.choice(modes), random.choice(modes)
    modifier.cycles_before, modifier.cycles_after = random.choice((0, 0, 1, 2)), random.choice((0, 0, 1, 2))


def _generator(modifier: Any, random: Any) -> None:
    modifier.mode = random.choice(("POLYNOMIAL", "POLYNOMIAL_FACTORISED"))
    modifier.poly_order, modifier.use_additive = random.randint(1, 3), random.random() < 0.7
    modifier.coefficients = [random.uniform(-0.3, 0.3) for _ in modifier.coefficients]


def _fngenerator(modifier: Any, random: Any) -> None:
    modifier.function_type = random.choice(("SIN", "COS", "TAN", "SQRT", "LN", "SINC"))
    modifier.use_additive, modifier.value_offset = random.random() < 0.6, random.uniform(-1, 1)
    modifier.amplitude, modifier.phase_multiplier = random.uniform(-2, 2), random.uniform(-1, 1)
    modifier.phase_offset = random.uniform(-2, 2)


def _envelope(modifier: Any, random: Any) -> None:
    """Without points: Blender (4.2 to 5.2) writes into memory of something else when a script adds one."""
    modifier.reference_value = random.uniform(-1, 1)
    modifier.default_min, modifier.default_max = random.uniform(-1, 0), random.uniform(0.1, 1)


def _limits(modifier: Any, random: Any) -> None:
    for name, low, high in (("min_x", 0, 20), ("max_x", 5, 30), ("min_y", -1, 0.5), ("max_y", -0.5, 1)):
        setattr(modifier, name, random.uniform(low, high))
        setattr(modifier, f"use_{name}", random.random() < 0.5)


def _stepped(modifier: Any, random: Any) -> None:
    modifier.frame_step, modifier.frame_offset = random.choice((1, 2, 3, 2.5)), random.uniform(0, 3)
    modifier.frame_start, modifier.frame_end = random.uniform(0, 20), random.uniform(20, 40)
    modifier.use_frame_start, modifier.use_frame_end = random.random() < 0.4, random.random() < 0.4
