"""Instructions in the compiled modules for Linux and Windows on x86-64: only Highway's functions for newer processors
have what some x86-64 processor lacks. Anything else would end Blender with "illegal instruction" on an older computer.

The assembler judges: it knows what a processor of the baseline has. The modules have no names of functions, so each is
linked once more with them, which must give the same code.
"""

import re
import shlex
import shutil
import subprocess

import pytest
from test_modules import modules, read

# Highway's namespaces of functions that are called after a look at the processor.
TARGETS = re.compile(r"\bN_(SSSE3|SSE4|AVX2|AVX3\w*)\b")
# Instructions that are no fault elsewhere: in which functions, and why.
HARMLESS = {
    "endbr64": "",  # older processors do nothing
    "tzcnt": "",  # they do `bsf`, with the same result for all but 0, for which compilers do not use it
    "xgetbv": r"hwy::SupportedTargets|__cpu_indicator_init",  # which have asked whether it is there
    **dict.fromkeys(("tpause", "xbegin", "xend", "xabort"), r"tbb::detail::"),  # the same
    **dict.fromkeys(("rdrand", "rdseed"), r"x86_rd(rand|seed)"),  # std::random_device, the same
}
# Addresses among the code, which are none, and constants of the mathematics of MinGW-w64's C library.
DATA = re.compile(r"^(\.[cd]tors|__[CD]TOR_LIST__|(one|limit)$)")
# What objdump writes but the assembler does not read, or what is the same for all processors.
PADDING = re.compile(r"^(data16|cs|rex\.\w+) .*")
HEX = re.compile(r"0x[0-9a-f]+")
BRANCH = re.compile(r"(j|call|loop|xbegin|notrack j|bnd )")


def with_names(path, folder):
    """Links the module once more, with the names of its functions. Returns the file's path."""
    build = path.parent.parent
    if not (build / "build.ninja").is_file() or not shutil.which("ninja"):
        pytest.skip(f"{path} is not where it was built with ninja")
    output = path.relative_to(build)
    asked = ["ninja", "-C", build, "-t", "commands", output]
    command = subprocess.run(asked, check=True, capture_output=True, text=True).stdout.splitlines()[-1]
    words = shlex.split(command.removeprefix(": && ").removesuffix(" && :"))
    # In a folder that looks the same: for Windows, the address of the code depends on the name of the output.
    for entry in build.iterdir():
        if entry.name != output.parts[0]:
            (folder / entry.name).symlink_to(entry)
    (folder / output).parent.mkdir(parents=True)
    subprocess.run([word for word in words if word != "-s"], check=True, cwd=folder)
    return folder / output


def code(path):
    (section,) = [each for each in read(path).sections if each.name == ".text"]
    return bytes(section.content)


def disassemble(path):
    """Returns {instruction: functions that have it}. Numbers are all alike, and addresses without names."""
    command = ["objdump", "-d", "-C", "--no-show-raw-insn", "--section=.text", path]
    found, function = {}, ""
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            if line.endswith(">:\n"):
                function = line.split(" <", 1)[1][:-3]
            elif "\t" in line:
                text, names, _ = line.rstrip("\n").split("\t", 1)[1].partition(" <")
                text = HEX.sub("0x10", text.partition(" #")[0].strip())
                if names and BRANCH.match(text):
                    text = text.rpartition(" ")[0] + " 0x10"
                found.setdefault(text, set()).add(function)
    assert process.returncode == 0, f"objdump cannot read {path}"
    return found


def refused(instructions):
    """Yields (instruction, what the assembler says) for those that a processor of the baseline does not have."""
    listed = [each for each in instructions if not PADDING.match(each)]
    command = ["as", "--64", "-march=generic64", "-o", "/dev/null", "-"]
    said = subprocess.run(command, input="\n".join(listed) + "\n", capture_output=True, text=True).stderr
    for number, why in re.findall(r"^\{standard input\}:(\d+): Error: (.*)$", said, re.MULTILINE):
        yield listed[int(number) - 1], why


def faults(instructions):
    """Returns sentences. instructions: as returned by disassemble."""
    found = []
    for instruction, why in refused(instructions):
        allowed = HARMLESS.get(instruction.split()[0])
        functions = sorted(
            name
            for name in instructions[instruction]
            if not TARGETS.search(name) and not DATA.match(name) and (allowed is None or not re.search(allowed, name))
        )
        if functions:
            found.append(
                f"{instruction}: {why}: {functions[0]}{f' and {len(functions) - 1} more' * (len(functions) > 1)}"
            )
    return found


needs_x86_tools = pytest.mark.skipif(
    not shutil.which("objdump") or not shutil.which("as"), reason="reads and writes x86-64 code with binutils"
)


@needs_x86_tools
def test_an_instruction_beyond_the_baseline_is_found():
    code = {
        "vaddps %ymm1,%ymm2,%ymm3": {"sinew::N_AVX2::add()", "std::vector<float>::resize()"},
        "pshufb %xmm1,%xmm2": {"sinew::N_SSSE3::shuffle()"},
        "popcnt %eax,%eax": {"count()"},
        "tpause %edi": {"tbb::detail::r1::wait()"},
        "xgetbv": {"other()"},
        "(bad)": {"one", "limit"},
        "addps %xmm1,%xmm2": {"add()"},
        "data16 cs nopw 0x0(%rax,%rax,1)": {"add()"},
    }
    assert [(each.split()[0], each.rpartition(": ")[2]) for each in faults(code)] == [
        ("vaddps", "std::vector<float>::resize()"),
        ("popcnt", "count()"),
        ("xgetbv:", "other()"),
    ]


@needs_x86_tools
@modules("-x86_64-linux-gnu.so", "-win_amd64.pyd")
def test_old_processors_have_each_instruction_outside_of_highways_targets(path, tmp_path):
    named = with_names(path, tmp_path)
    assert code(named) == code(path)
    instructions = disassemble(named)
    assert any("N_AVX2::" in name for names in instructions.values() for name in names), "there are no names"
    found = faults(instructions)
    assert not found, "\n".join(found)
