"""What Blender does in an evaluation, and what it does before that, from its own drawing of a dependency graph."""

import re

_WHOLE = re.compile(r'^graph \[.*label="(.*?) (?:\(orig|: \()')
_OPERATION = re.compile(r'^"(\d+)" \[color="black", label="(.*)", shape="box"')
_RELATION = re.compile(r'^"(\d+)" -> "(\d+)"')


class Relations:
    """operations: {(data-block after two letters of its type, component, operation)}."""

    def __init__(self, graph, path):
        """path: of a file for the drawing."""
        self._numbers, self._before, around = {}, {}, []
        _draw(graph, path)
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("subgraph"):
                around.append("")
            elif line == "}" and around:
                around.pop()
            elif found := _WHOLE.match(line):
                around[-1:] = [found[1].removeprefix("ID_REF : ")]
            elif found := _OPERATION.match(line):
                self._numbers[(*around, found[2].replace("\\", ""))] = found[1]
            elif found := _RELATION.match(line):
                self._before.setdefault(found[2], set()).add(found[1])
        self.operations = set(self._numbers)

    def before(self, operation):
        """Those that are done before one of them."""
        reached, waiting = set(), [self._numbers[operation]]
        while waiting:
            found = self._before.get(waiting.pop(), set()) - reached
            reached |= found
            waiting += found
        return {key for key, number in self._numbers.items() if number in reached}


def _draw(graph, path):
    try:
        graph.debug_relations_graphviz(filepath=str(path))
    except TypeError:  # before 5.0
        graph.debug_relations_graphviz(str(path))
