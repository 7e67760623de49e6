"""The node group of a crowd. Its formulas:

Lanes are copies of the path's splines, side by side; placed end to end, they have the total length T. Agent i of N
starts at (i + 1/2 + jitter) T / N, which is on spline k with the length l(k). At frame f, with
c(f) = (f - first) speed(k) / frames per cycle:

    distance along its spline   (start + stride c(f)) mod l(k)
    phase                       (c(h) / size(i) + offset(i)) mod 1,  h = floor(f + 0.49)

so that feet do not slide: a larger agent makes fewer steps. h is constant while Blender samples the times around a
frame for motion blur: an agent that showed a different mesh there would not be recognized as the same one.
"""

from typing import Any

from ..blender.graph import Graph, enabled

NAME = "Sinew Crowd"
VERSION_PROPERTY = "sinew_crowd_version"
VERSION = 1
HELD = 0.49
INPUTS = (
    ("Geometry", "Geometry", None, None, ""),
    ("Path", "Object", None, None, "The curve that the agents walk along; each of its splines has agents"),
    ("Phases", "Collection", None, None, "The shapes of the clip, in the order of their names"),
    ("Agents", "Int", 100, 0, "Number of agents"),
    ("Lanes", "Int", 1, 1, "How many walk side by side"),
    ("Lane Distance", "Float", 1.0, 0.0, "Distance from one lane to the next"),
    (
        "Jitter",
        "Float",
        0.35,
        0.0,
        "How irregular the distances are: 0 is even, 1 shifts an agent by up to half a distance",
    ),
    ("Seed", "Int", 0, None, "A different number gives a different crowd"),
    (
        "Speed",
        "Float",
        1.0,
        None,
        "How fast the clip plays and the agents walk. To change it over time, animate Frame Offset",
    ),
    ("Speed Variation", "Float", 0.0, 0.0, "How much faster or slower than that a lane may be, as a share"),
    ("Size Variation", "Float", 0.0, 0.0, "How much larger or smaller than the character an agent may be, as a share"),
    ("Frame Offset", "Float", 0.0, None, "Added to the scene's frame. Animate it to slow the crowd down or to stop it"),
    ("First Frame", "Float", 1.0, None, "The scene's frame on which the first phase is shown"),
    ("Frames a Cycle", "Float", 24.0, 0.001, "How long the clip is"),
    ("Phase Count", "Int", 24, 1, "How many shapes Phases has"),
    ("Stride", "Float", 0.0, None, "How far the clip walks in a cycle. Change it if feet slide"),
    (
        "Heading",
        "Float",
        0.0,
        None,
        "The direction of the clip's walk, from the X axis, in radians. Change it if agents walk sideways",
    ),
)


def make() -> Any:
    """Makes the node group."""
    graph = Graph(NAME, INPUTS, "Instances")
    graph.tree[VERSION_PROPERTY] = VERSION
    given = graph.input
    lanes = _lanes(graph)
    agents = graph.node("GeometryNodeMeshLine", {"Count": given("Agents"), "Offset": (0.0, 0.0, 0.0)}, mode="OFFSET")
    index = graph.node("GeometryNodeInputIndex").outputs[0]
    length = enabled(graph.node("GeometryNodeSplineLength").outputs, "Length")
    sums = graph.node("GeometryNodeAccumulateField", {"Value": length}, data_type="FLOAT", domain="CURVE")
    total = _at(graph, lanes, enabled(sums.outputs, "Total"), 0)

    jitter = graph.random(-0.5, 0.5, index, given("Seed"))
    place = graph.math("ADD", graph.math("ADD", index, 0.5), graph.math("MULTIPLY", jitter, given("Jitter")))
    place = graph.math("WRAP", graph.math("DIVIDE", place, given("Agents")), 1.0, 0.0)
    spline = _spline_at(graph, lanes, place)
    spline_length = _at(graph, lanes, length, spline)
    before = _at(graph, lanes, enabled(sums.outputs, "Trailing"), spline)
    start = graph.math("SUBTRACT", graph.math("MULTIPLY", place, total), before)

    frame = graph.math("ADD", graph.node("GeometryNodeInputSceneTime").outputs["Frame"], given("Frame Offset"))
    varied = graph.math("MULTIPLY", graph.random(-1.0, 1.0, spline, _other(graph, 1)), given("Speed Variation"))
    speed = graph.math("MULTIPLY", given("Speed"), graph.math("ADD", varied, 1.0))
    rate = graph.math("DIVIDE", speed, given("Frames a Cycle"))

    def cycles(time):
        return graph.math("MULTIPLY", graph.math("SUBTRACT", time, given("First Frame")), rate)

    size = graph.math("MULTIPLY", graph.random(-1.0, 1.0, index, _other(graph, 2)), given("Size Variation"))
    size = graph.math("ADD", size, 1.0)
    walked = graph.math("ADD", start, graph.math("MULTIPLY", cycles(frame), given("Stride")))
    walked = graph.math("WRAP", walked, spline_length, 0.0)
    position, tangent = _on_spline(graph, lanes, walked, spline)

    held = graph.math("FLOOR", graph.math("ADD", frame, HELD))
    count = given("Phase Count")
    offset = graph.math("FLOOR", graph.math("MULTIPLY", graph.random(0.0, 1.0, index, _other(graph, 3)), count))
    phase = graph.math("ADD", graph.math("MULTIPLY", graph.math("DIVIDE", cycles(held), size), count), offset)
    # Rounding can put a whole number slightly below its value.
    phase = graph.math("FLOOR", graph.math("WRAP", graph.math("ADD", phase, 1e-3), count, 0.0))

    axes = graph.node("ShaderNodeSeparateXYZ", {0: tangent})
    turn = graph.math("SUBTRACT", graph.math("ARCTAN2", axes.outputs["Y"], axes.outputs["X"]), given("Heading"))
    placed = graph.node("GeometryNodeSetPosition", {"Geometry": agents.outputs[0], "Position": position})
    shapes = graph.node(
        "GeometryNodeCollectionInfo",
        {"Collection": given("Phases"), "Separate Children": True, "Reset Children": True},
        transform_space="ORIGINAL",
    )
    instances = graph.node(
        "GeometryNodeInstanceOnPoints",
        {
            "Points": placed.outputs[0],
            "Selection": graph.node("FunctionNodeCompare", {0: total, 1: 0.0}, operation="GREATER_THAN").outputs[0],
            "Instance": shapes.outputs[0],
            "Pick Instance": True,
            "Instance Index": phase,
            "Rotation": graph.node("ShaderNodeCombineXYZ", {"Z": turn}).outputs[0],
            "Scale": graph.node("ShaderNodeCombineXYZ", {"X": size, "Y": size, "Z": size}).outputs[0],
        },
    )
    return graph.close(instances.outputs[0])


def _other(graph, number):
    """Returns a different seed for each random property of an agent."""
    return graph.math("ADD", graph.math("MULTIPLY", graph.input("Seed"), 16.0), float(number))


def _lanes(graph):
    """Returns the path's splines, with one copy per lane, side by side."""
    path = graph.node("GeometryNodeObjectInfo", {"Object": graph.input("Path")}, transform_space="RELATIVE")
    step = graph.math("MAXIMUM", graph.math("MULTIPLY", graph.input("Lane Distance"), 0.2), 1e-3)
    even = graph.node("GeometryNodeResampleCurve", {"Curve": path.outputs["Geometry"], "Length": step}, mode="LENGTH")
    copies = graph.node(
        "GeometryNodeDuplicateElements", {"Geometry": even.outputs[0], "Amount": graph.input("Lanes")}, domain="SPLINE"
    )
    tangent = graph.node("GeometryNodeInputTangent").outputs[0]
    side = graph.vector("NORMALIZE", graph.vector("CROSS_PRODUCT", tangent, (0.0, 0.0, 1.0)))
    middle = graph.math("MULTIPLY", graph.math("SUBTRACT", graph.input("Lanes"), 1.0), 0.5)
    lane = graph.math("SUBTRACT", copies.outputs["Duplicate Index"], middle)
    away = graph.node("ShaderNodeVectorMath", {0: side}, operation="SCALE")
    graph.put(graph.math("MULTIPLY", lane, graph.input("Lane Distance")), enabled(away.inputs, "Scale"))
    moved = graph.node("GeometryNodeSetPosition", {"Geometry": copies.outputs[0], "Offset": away.outputs[0]})
    return moved.outputs[0]


def _at(graph, lanes, value, spline):
    """Returns a value of one of the splines."""
    sample = graph.node(
        "GeometryNodeSampleIndex", {"Geometry": lanes, "Index": spline}, data_type="FLOAT", domain="CURVE"
    )
    graph.put(value, enabled(sample.inputs, "Value"))
    return enabled(sample.outputs)


def _spline_at(graph, lanes, share):
    """Returns the index of the spline at a fraction of the total length."""
    number = graph.node("GeometryNodeFieldOnDomain", data_type="FLOAT", domain="CURVE")
    graph.put(graph.node("GeometryNodeInputIndex").outputs[0], enabled(number.inputs))
    sample = graph.node(
        "GeometryNodeSampleCurve",
        {"Curves": lanes, "Factor": share},
        data_type="FLOAT",
        mode="FACTOR",
        use_all_curves=True,
    )
    graph.put(enabled(number.outputs), enabled(sample.inputs, "Value"))
    return graph.math("ROUND", enabled(sample.outputs, "Value"))


def _on_spline(graph, lanes, distance, spline):
    """Returns the position and the tangent."""
    sample = graph.node(
        "GeometryNodeSampleCurve",
        {"Curves": lanes, "Length": distance, "Curve Index": spline},
        mode="LENGTH",
        use_all_curves=False,
    )
    return enabled(sample.outputs, "Position"), enabled(sample.outputs, "Tangent")
