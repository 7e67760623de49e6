"""The kernels' machine code: a compiler, a flag or an edit may turn vector code into scalar code
without any other test noticing. Looks at instructions, not at the clock."""

import os
import platform
import re
import shutil
import subprocess
from pathlib import Path

import pytest

LIBRARY = Path(os.environ["SINEW_BUILD"]) / "native" / "libsinew.a"
pytestmark = pytest.mark.skipif(
    platform.machine() != "x86_64" or not shutil.which("objdump"), reason="reads x86-64 code with objdump"
)


@pytest.fixture(scope="module")
def functions():
    """{name: [instruction]} of everything in the kernels' object file."""
    text = subprocess.run(
        ["objdump", "-d", "-C", "--no-show-raw-insn", LIBRARY], check=True, capture_output=True, text=True
    ).stdout
    result = {}
    for line in text.splitlines():
        if header := re.match(r"[0-9a-f]+ <(.*)>:$", line):
            instructions = result.setdefault(header.group(1), [])
        elif line.startswith(" ") and "\t" in line:
            instructions.append(line.split("\t", 1)[1])
    return result


def code(functions, target, kernel):
    own = [lines for name, lines in functions.items() if f"{target}::" in name and re.search(rf"::{kernel}\(", name)]
    assert own, f"no {kernel} for {target}"
    return [line for lines in own for line in lines]


def count(lines, pattern):
    return sum(1 for line in lines if re.search(pattern, line))


# A joint is 12 multiply-adds a group and two groups run at once; a rigid block has 9 a group.
@pytest.mark.parametrize("target, register", [("N_AVX2", "ymm"), ("N_AVX3", "zmm")])
def test_linear_blocks_are_vector_code(functions, target, register):
    lines = code(functions, target, "linear_blocks")
    assert count(lines, rf"vfn?m(add|sub)\w*ps.*%{register}") >= 2 * (12 + 9)
    assert not count(lines, rf"vmov\w+ +%{register}\d+,.*\(%r[sb]p"), "sums have left the registers"


@pytest.mark.parametrize("target, register", [("N_AVX2", "ymm"), ("N_AVX3", "zmm")])
def test_dual_quaternion_blocks_are_vector_code(functions, target, register):
    lines = code(functions, target, "dual_quaternion_blocks")
    assert count(lines, rf"vfn?m(add|sub)\w*ps.*%{register}") >= 8 + 20
    assert count(lines, r"vdivps") >= 1


# Applying a dual quaternion is 20 multiply-adds. A joint that stretches is another 20, or, where stretches come first,
# 12 and the 8 of a rigid joint; 12 about a center. AVX2 moves two groups at once, but stretches one.
@pytest.mark.parametrize("target, register, groups", [("N_AVX2", "ymm", 2), ("N_AVX3", "zmm", 1)])
def test_joints_that_stretch_are_vector_code(functions, target, register, groups):
    least = {
        "dual_quaternion_blocks": 20 + 20 + 12 + 8,
        "blended_blocks": groups * (12 + 9) + 20 + 20 + 12 + 8,
        "rotation_center_blocks": groups * (12 + 4 + 12) + 12,
    }
    for kernel, number in least.items():
        assert count(code(functions, target, kernel), rf"vfn?m(add|sub)\w*ps.*%{register}") >= number, kernel


def test_older_machines_get_vectors_too(functions):
    lines = code(functions, "N_SSE4", "linear_blocks")
    assert count(lines, r"^mulps") >= 2 * 12 and count(lines, r"^addps") >= 2 * 12


# Blender's bits: nothing is fused.
@pytest.mark.parametrize("kernel", ("simple_step", "length_step", "mean_step", "measure_losses", "restore[^:]*"))
@pytest.mark.parametrize("target, register", [("N_AVX2", "ymm"), ("N_AVX3", "zmm")])
def test_smoothing_is_vector_code_that_rounds_after_each_operation(functions, target, register, kernel):
    lines = code(functions, target, kernel)
    assert count(lines, rf"v(add|sub|mul)ps.*%{register}") >= 12
    assert not count(lines, r"vfn?m(add|sub)")
