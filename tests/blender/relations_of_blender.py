"""What Blender does in an evaluation, and what it does before that, from its own drawing of a dependency graph."""

import re
import tempfile
from pathlib import Path

from helpers import addon_module

_WHOLE = re.compile(r'^graph \[.*label="(?:ID_REF : .* \(orig: (\w+)|(.*?) : \()')
_OPERATION = re.compile(r'^"(\d+)" \[color="black", label="(.*)", shape="box"')
_RELATION = re.compile(r'^"(\d+)" -> "(\d+)"')


class Relations:
    """operations: {(address of an original data-block, component, operation)}. The names of data-blocks may be old."""

    def __init__(self, graph):
        self._numbers, self._before, around = {}, {}, []
        for line in _drawing(graph).splitlines():
            if line.startswith("subgraph"):
                around.append("")
            elif line == "}" and around:
                around.pop()
            elif found := _WHOLE.match(line):
                around[-1:] = [int(found[1], 16) if found[1] else found[2]]
            elif found := _OPERATION.match(line):
                self._numbers[(*around, found[2].replace("\\", ""))] = found[1]
            elif found := _RELATION.match(line):
                self._before.setdefault(found[2], set()).add(found[1])
        self.operations = set(self._numbers)

    def before(self, operation):
        """Those that are done before one of them. Blender adds backslashes to names; they are left out here."""
        reached, waiting = set(), [self._numbers[operation]]
        while waiting:
            found = self._before.get(waiting.pop(), set()) - reached
            reached |= found
            waiting += found
        return {key for key, number in self._numbers.items() if number in reached}


def _drawing(graph):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "relations.dot"
        try:
            graph.debug_relations_graphviz(filepath=str(path))
        except TypeError:  # before 5.0
            graph.debug_relations_graphviz(str(path))
        return path.read_text(encoding="utf-8", errors="replace")


def bones_not_awaited(graph):
    """The bones that a mesh which Sinew deforms moves by, but that may be evaluated after it: [(mesh, bone)]."""
    characters, wiring = addon_module("run.characters"), addon_module("plan.wiring")
    relations, found = None, []
    for ob in characters.known():
        entry = characters.of(ob)
        modifiers = [each for each in ob.modifiers if each.name in entry.plan.replaced and each.type == "ARMATURE"]
        armatures = [each.object for each in modifiers if each.show_viewport and each.object is not None]
        hook = entry.plan.hook_of(ob)
        is_deforming = entry.is_deforming and hook is not None and not wiring.waits_for_nothing(hook)
        if not is_deforming or not armatures or not ob.evaluated_get(graph).is_evaluated:
            continue
        relations = relations or Relations(graph)
        driver = f"DRIVER({hook.data_path})".replace("\\", "")
        done = relations.before((ob.as_pointer(), "[Parameters Component]", driver))
        names = wiring.weighted_groups(ob)
        for armature in armatures:
            for bone in armature.data.bones:
                last = "BONE_DONE()" if bone.bbone_segments == 1 else "BONE_SEGMENTS()"
                operation = armature.as_pointer(), f"[Bone Component] '{bone.name}'", last
                # A bone that was renamed has its old name until Blender builds relations.
                is_known = operation in relations.operations
                if bone.name in names and bone.use_deform and is_known and operation not in done:
                    found.append((ob.name, bone.name))
    return found
