"""What reviewers refuse in an add-on, and why Sinew's needs none of it, is in docs/how-it-works.md."""

import ast
from pathlib import Path

import pytest

ADDON = Path(__file__).resolve().parents[2] / "addon" / "sinew"
REFUSED = {"eval", "exec", "compile", "__import__", "Thread", "_thread", "concurrent", "multiprocessing"}


def refused_in(text):
    """Returns the lines of Python code with a word that is refused, or that change sys.modules."""
    found = []
    for node in ast.walk(ast.parse(text)):
        names = [node.id] if isinstance(node, ast.Name) else []
        if isinstance(node, ast.Attribute):
            is_own = isinstance(node.value, ast.Name) and node.value.id in {"threading", "builtins"}
            names = [node.attr] if is_own else []
        elif isinstance(node, ast.Import):
            names = [alias.name.partition(".")[0] for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [(node.module or "").partition(".")[0], *(alias.name for alias in node.names)]
        elif isinstance(node, (ast.Delete, ast.Assign, ast.AugAssign)):
            targets = [node.target] if isinstance(node, ast.AugAssign) else node.targets
            names = ["eval"] if any("sys.modules" in ast.unparse(target) for target in targets) else []
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in {"sys.modules.pop", "sys.modules.clear"}:
            names = ["eval"]
        if REFUSED & set(names):
            found.append(node.lineno)
    return found


@pytest.mark.parametrize(
    "text",
    [
        "eval('1')",
        "exec('a = 1')",
        "import threading\nthreading.Thread(target=print)",
        "from threading import Thread",
        "from concurrent.futures import ThreadPoolExecutor",
        "import sys\ndel sys.modules['a']",
        "import sys\nsys.modules.pop('a')",
        "import sys\nsys.modules['a'] = None",
    ],
)
def test_words_are_found(text):
    assert refused_in(text)


def test_words_that_are_allowed():
    assert not refused_in("import re, threading\nre.compile('a'), threading.Lock()\n'eval'")


def test_nothing_that_is_installed_has_them():
    found = {str(path.relative_to(ADDON)): refused_in(path.read_text()) for path in ADDON.rglob("*.py")}
    assert not {name: lines for name, lines in found.items() if lines}
