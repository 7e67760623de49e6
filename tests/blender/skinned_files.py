"""Reads a glTF or FBX file with assimp, which knows nothing of Blender, and skins its meshes by what the file says:
joints, weights and clip. Needs the command `assimp` (Debian: assimp-utils)."""

import json
import re
import shutil
import subprocess

import numpy as np
import pytest

Y_UP_TO_Z_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)


class SkinnedFile:
    """The meshes of a file as one, in the space of its scene, with its one clip, or one of that name.

    rest: (N, 3), vertices as they are stored; counts: (N,), influences of each; joints: names; seconds: (first, last)
    of the clip."""

    def __init__(self, path, clip=None):
        if shutil.which("assimp") is None:
            pytest.skip("assimp is not there (Debian: assimp-utils)")
        if path.suffix == ".fbx" and version() == "5.4":
            pytest.skip("assimp 5.4 takes an FBX file's offset matrices for mere scales")
        dump = path.with_suffix(".assjson")
        done = subprocess.run(
            ["assimp", "export", str(path), str(dump), "-fassjson"], capture_output=True, text=True, check=False
        )
        assert dump.exists(), done.stdout + done.stderr
        scene = json.loads(dump.read_text())
        self._nodes = {}  # name -> (name of its parent, matrix)
        self._mesh_nodes = {}
        self._read_nodes(scene["rootnode"], None)
        self.clips = [each["name"] for each in scene["animations"]]
        (animation,) = (each for each in scene["animations"] if clip in (None, each["name"]))
        self._rate = animation["tickspersecond"]
        self._channels = {each["name"]: each for each in animation["channels"]}
        times = [key[0] for each in animation["channels"] for key in each["rotationkeys"]]
        self.seconds = min(times) / self._rate, max(times) / self._rate
        self.joints, rest, tables = [], [], []
        for mesh in scene["meshes"]:
            vertices = np.array(mesh["vertices"]).reshape(-1, 3)
            table = np.zeros((len(vertices), len(mesh["bones"])))
            for column, bone in enumerate(mesh["bones"]):
                for vertex, weight in bone.get("weights", ()):
                    table[vertex, column] += weight
            rest.append(vertices)
            tables.append((table, [(bone["name"], matrix(bone["offsetmatrix"])) for bone in mesh["bones"]]))
            self.joints += [bone["name"] for bone in mesh["bones"]]
        self._tables, self._rest = tables, rest
        self.rest = np.concatenate(rest)
        self.counts = np.concatenate([np.count_nonzero(table, axis=1) for table, _ in tables])

    def _read_nodes(self, node, parent):
        assert node["name"] not in self._nodes
        self._nodes[node["name"]] = parent, matrix(node["transformation"])
        for child in node.get("children", ()):
            self._read_nodes(child, node["name"])

    def posed(self, seconds):
        """Returns (N, 3): the vertices by linear skinning at that time of the clip, Z up, in the file's unit."""
        found = []
        for rest, (table, bones) in zip(self._rest, self._tables):
            weights = table / table.sum(axis=1, keepdims=True)  # as game engines do
            motions = np.array([self._world(name, seconds) @ offset for name, offset in bones])
            found.append(
                np.einsum("vj,jrc,vc->vr", weights, motions[:, :3], np.column_stack((rest, np.ones(len(rest)))))
            )
        return np.concatenate(found) @ Y_UP_TO_Z_UP.T

    def _world(self, name, seconds):
        parent, local = self._nodes[name]
        channel = self._channels.get(name)
        if channel is not None:
            local = self._local(channel, seconds * self._rate)
        return local if parent is None else self._world(parent, seconds) @ local

    def _local(self, channel, time):
        found = np.eye(4)
        found[:3, :3] = turn(at(channel["rotationkeys"], time)) * at(channel["scalingkeys"], time)
        found[:3, 3] = at(channel["positionkeys"], time)
        return found


def version():
    """Of the command assimp, for example "5.4"."""
    said = subprocess.run(["assimp", "version"], capture_output=True, text=True, check=False).stdout
    return re.search(r"Version (\d[\d.]*)", said)[1]


def matrix(numbers):
    return np.array(numbers, float).reshape(4, 4)


def at(keys, time):
    """The value of keyframes at a time, with straight lines between them. The dump has six digits of each time."""
    times, values = np.array([key[0] for key in keys], float), np.array([key[1] for key in keys], float)
    nearest = np.abs(times - time).argmin()
    if abs(times[nearest] - time) < 1e-4 * np.ptp(times):
        return values[nearest]
    if values.shape[1] == 4:  # the same rotation on the same side
        values[1:] *= np.cumprod(np.where((values[1:] * values[:-1]).sum(axis=1) < 0, -1, 1))[:, None]
    return np.array([np.interp(time, times, column) for column in values.T])


def turn(quaternion):
    """(3, 3) of w x y z."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
