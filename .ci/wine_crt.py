"""Gives compiled modules for Windows the complex functions of Microsoft's C library that Wine's lacks.

    wine_crt.py FOLDER TARGET

Whatever modules in FOLDER import from the C library's mathematics they will import from a DLL that this program makes
in TARGET. It has the complex functions itself, and hands the others on.
"""

import re
import subprocess
import sys
from pathlib import Path

THEIRS = b"api-ms-win-crt-math-l1-1-0.dll"
OURS = b"sinew-wine-math-l1-1-0-now.dll"  # as long, for it is written in place
# Microsoft's long double is a double, and its complex numbers are structs of two.
KINDS = {"": "double", "f": "float", "l": "double"}
REAL = {"abs", "arg", "imag", "real"}
COMPLEX = ("acos", "acosh", "asin", "asinh", "atan", "atanh", "conj", "cos", "cosh", "exp", "log", "pow", "proj", "sin",
           "sinh", "sqrt", "tan", "tanh")  # fmt: skip
FUNCTIONS = {
    f"c{name}{suffix}": (f"c{name}{'f' if suffix == 'f' else ''}", KINDS[suffix], name)
    for suffix in KINDS
    for name in (*COMPLEX, *REAL)
}


def imported(module):
    """Returns the names that a module imports from THEIRS."""
    listing = subprocess.run(
        ["x86_64-w64-mingw32-objdump", "-p", module], capture_output=True, text=True, check=True
    ).stdout
    found, library = set(), ""
    for line in listing.splitlines():
        named = re.match(r"\s*DLL Name: (\S+)", line)
        entry = re.match(r"\t[0-9a-f]+\t\s*\d+\s+(\S+)$", line)
        if named:
            library = named[1].lower()
        elif entry and library == THEIRS.decode():
            found.add(entry[1])
    return found


def source(names):
    """Returns the C code of the complex functions among the names."""
    lines = [
        "#include <complex.h>",
        "typedef struct { double re, im; } of_double;",
        "typedef struct { float re, im; } of_float;",
    ]
    for name in sorted(names & FUNCTIONS.keys()):
        called, kind, plain = FUNCTIONS[name]
        given = ("a", "b") if plain == "pow" else ("a",)
        values = ", ".join(f"__builtin_complex({each}.re, {each}.im)" for each in given)
        parameters = ", ".join(f"of_{kind} {each}" for each in given)
        if plain in REAL:
            lines.append(f"{kind} own_{name}({parameters}) {{ return {called}({values}); }}")
        else:
            lines.append(
                f"of_{kind} own_{name}({parameters}) {{ {kind} _Complex z = {called}({values}); "
                f"return (of_{kind}){{__real__ z, __imag__ z}}; }}"
            )
    return "\n".join(lines) + "\n"


def exports(names):
    """Returns the module definition: own functions, and the others of Wine's C library."""
    lines = [f"  {name} = {f'own_{name}' if name in FUNCTIONS else f'ucrtbase.{name}'}" for name in sorted(names)]
    return "\n".join([f"LIBRARY {OURS.decode()}", "EXPORTS", *lines]) + "\n"


def main(folder, target):
    assert len(OURS) == len(THEIRS)
    modules = [path for path in folder.rglob("*") if path.suffix in {".pyd", ".dll"} and THEIRS in path.read_bytes()]
    names = set().union(*map(imported, modules))
    if not names & FUNCTIONS.keys():
        return
    code, definition = target / "wine_crt.c", target / "wine_crt.def"
    code.write_text(source(names))
    definition.write_text(exports(names))
    subprocess.run(
        ["x86_64-w64-mingw32-gcc-posix", "-O2", "-shared", "-s", "-static-libgcc"]
        + ["-o", target / OURS.decode(), code, definition],
        check=True,
    )
    code.unlink()
    definition.unlink()
    for path in modules:
        path.write_bytes(path.read_bytes().replace(THEIRS, OURS))


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
