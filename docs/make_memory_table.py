#!/usr/bin/env python3
"""Makes the tables in blenders-memory.md, from addon/sinew/host/features.py.

    docs/make_memory_table.py [--check]

--check writes nothing and exits 1 with a sentence if the page is not what it would be.
"""

import importlib
import sys
import types
from pathlib import Path

PAGE = Path(__file__).resolve().parent / "blenders-memory.md"
MARK = "<!-- From here on made by docs/make_memory_table.py, from addon/sinew/host: change it there. -->\n"


def table():
    """Returns the module features, which needs no Blender."""
    package = sys.modules.setdefault("sinew_memory", types.ModuleType("sinew_memory"))
    package.__path__ = [str(PAGE.parents[1] / "addon" / "sinew" / "host")]
    return importlib.import_module("sinew_memory.features")


MOST_NAMED = 4


def code(words):
    """Returns members, each as Struct.member, as text: those of a struct together."""
    by_struct = {}
    for word in words:
        kind, _, name = word.partition(".")
        by_struct.setdefault(kind, []).append(name)
    return "; ".join(
        " ".join([f"`{kind}`", *(f"`{name}`" for name in names if name)]) for kind, names in by_struct.items()
    )


def with_others(own, others):
    """Returns the names of features, and of others that need them."""
    if len(others) > MOST_NAMED:
        others = ["all that needs one of them" if len(own) > 1 else "all that needs it"]
    return ", ".join(own) + (f" ({', '.join(others)})" if others else "")


def wanted():
    """Returns all that comes after MARK."""
    features = table()
    lines = ["", "| feature | needs | and | is compared with the API | without it |", "|---|---|---|---|---|"]
    for name, each in features.FEATURES.items():
        also = ", ".join(each.also)
        lines.append(f"| {name} | {code(each.needs.split())} | {also} | {each.compared} | {each.without} |")
    lines += [
        "",
        "## Without one member",
        "",
        "The features that are lost if Blender describes one member in another way, or not at all. Those in brackets",
        "need one of the others.",
        "",
        "| members | lost |",
        "|---|---|",
    ]
    rows = {}
    for feature in features.FEATURES:
        for kind, name in features.needs(feature):
            own = features.users(kind, name)
            others = [each for each in features.lost_with(own) if each not in own]
            rows.setdefault(with_others(own, others), {})[f"{kind}.{name}"] = None
    lines += [f"| {code(names)} | {lost} |" for lost, names in rows.items()]
    return "\n".join(lines) + "\n"


def check():
    """Returns what is wrong with the page, a sentence, or None."""
    text = PAGE.read_text(encoding="utf-8")
    if text.partition(MARK)[2] == wanted():
        return None
    return f"docs/{PAGE.name} is not what addon/sinew/host says: run docs/make_memory_table.py"


def main(arguments):
    if "--check" in arguments:
        return check()
    head = PAGE.read_text(encoding="utf-8").partition(MARK)[0]
    PAGE.write_text(head + MARK + wanted(), encoding="utf-8")
    return None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
