"""Outside of Blender: has it walk, and if a walk fails finds the steps that matter.

python3 tests/blender/walk/shrink.py --seed S --steps N -- blender ...
"""

import argparse
import re
import subprocess
import sys
from pathlib import Path

LENGTH = 100  # steps of a walk


def options_of(arguments):
    parser = argparse.ArgumentParser(prog="./dev walk")
    parser.add_argument("--seed", default="1", help="any word")
    parser.add_argument("--steps", type=int, default=300, help="how many, from 0 on")
    parser.add_argument(
        "--only", type=lambda text: [int(word) for word in text.split(",")], help="these alone: 3,17,44"
    )
    parser.add_argument(
        "--without", type=lambda text: text.split(","), default=[], help="kinds of steps that are left out: bind,undo"
    )
    return parser.parse_args(arguments)


def shrink(items, fails):
    """A part of the list for which fails(part) holds too, such that it does not if any one more is left out. fails
    holds for the list itself."""
    size = max(len(items) // 2, 1)
    while True:
        start, before = 0, len(items)
        while start < len(items):
            fewer = items[:start] + items[start + size :]
            if fewer and fails(fewer):
                items = fewer
            else:
                start += size
        if size == 1 and len(items) == before:
            return items
        size = max(size // 2, 1)


class Walker:
    """Has Blender walk, each time in a new process."""

    def __init__(self, command, seed, without):
        script = str(Path(__file__).with_name("run.py"))
        self.command = [*command, "-b", "--python-exit-code", "2", "--python", script, "--", "--seed", seed]
        self.command += ["--without", ",".join(without)] if without else []

    def walk(self, *which):
        """which: options for run.py. Returns (exit code, number of the last step, what was said about it)."""
        last, said = None, []
        with subprocess.Popen(
            [*self.command, *which], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
        ) as process:
            for line in process.stdout:
                step = re.match(r"walk: step (\d+)", line)
                if step:
                    last, said = int(step[1]), []
                said.append(line)
        return process.returncode, last, "".join(said)

    def failure(self, steps):
        """What is wrong behind some of these steps, see failure_of; None if nothing is."""
        code, _last, said = self.walk("--only", as_text(steps))
        return failure_of(code, said)


def failure_of(code, said):
    """What an exit code and the last step's words say is wrong, without numbers, so that fewer steps may show the same
    with other ones; None if nothing is."""
    found = re.search(r"^walk: FAILED: [^(]*.*: ([a-z]+)", said, re.M)
    return None if code == 0 else (code, found[1] if found else "")


def as_text(steps):
    return ",".join(map(str, steps))


def main():
    split = sys.argv.index("--")
    options, command = options_of(sys.argv[1:split]), sys.argv[split + 1 :]
    walker = Walker(command, options.seed, options.without)
    code, last, said = walker.walk(
        *(("--only", as_text(options.only)) if options.only else ("--steps", str(options.steps)))
    )
    print(said.rstrip(), flush=True)
    if code == 0:
        return 0
    print(f"exit code {code} at step {last}; looking for the steps that matter", flush=True)
    taken = [step for step in options.only or range(last + 1) if step <= last]
    candidates = [step for step in taken if step // LENGTH == last // LENGTH]
    wanted = failure_of(code, said)

    def fails(steps):
        return walker.failure(steps) == wanted

    for steps in candidates, taken:
        if fails(steps):
            left = shrink(steps, fails)
            code, _last, said = walker.walk("--only", as_text(left))
            print(f"exit code {code}:\n{said.rstrip()}\nagain: ./dev walk --seed {options.seed} --only {as_text(left)}")
            return 1
    print(f"run again, steps 0 to {last} do not fail")
    return 1


if __name__ == "__main__":
    sys.exit(main())
