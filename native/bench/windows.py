"""./dev bench windows: the core compiled by MinGW for Windows, run by Wine, beside the core compiled by GCC for Linux,
on the same machine. Both run this file as it is.

windows.py measure          prints {kernel: milliseconds}, medians
windows.py compare ROUNDS JSON MODULES MODULES PYTHON PYTHON
                            runs both Pythons alternately, Linux's first, each with the folder of its modules; writes
                            all times to JSON and prints a table
"""

import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

VERTICES = 100_000
AROUND = 100  # vertices of each ring of the tube
JOINTS = 22
CALLS = 15


def tube():
    """Returns (positions (V, 3), weights (V, J), quads (Q, 4)) of a tube along z, with two to three influences each."""
    import numpy as np

    rows = VERTICES // AROUND
    angle = np.tile(np.arange(AROUND) * 2 * np.pi / AROUND, rows)
    height = np.repeat(np.linspace(0.0, JOINTS - 1.0, rows), AROUND)
    positions = np.stack((np.cos(angle), np.sin(angle), height), axis=1).astype(np.float32)
    weights = np.maximum(0.0, 1.5 - np.abs(height[:, None] - np.arange(JOINTS)))
    weights /= weights.sum(axis=1, keepdims=True)
    corner = np.arange((rows - 1) * AROUND).reshape(rows - 1, AROUND)
    beside = np.roll(corner, -1, axis=1)
    quads = np.stack((corner, beside, beside + AROUND, corner + AROUND), axis=-1).reshape(-1, 4)
    return positions, weights, quads


def matrices(turn=2.0):
    """Returns skinning matrices (J, 4, 4) that twist the tube up to the angle turn, and bend it."""
    import numpy as np

    angle = np.linspace(0.0, turn, JOINTS)
    found = np.tile(np.eye(4, dtype=np.float32), (JOINTS, 1, 1))
    found[:, 0, 0], found[:, 0, 1] = np.cos(angle), -np.sin(angle)
    found[:, 1, 0], found[:, 1, 1] = np.sin(angle), np.cos(angle)
    found[:, 0, 3] = angle
    return found


def kernels():
    """Returns {name: function of nothing}."""
    import numpy as np
    import sinew_native as sinew

    positions, weights, quads = tube()
    skin, moved = sinew.Skin.from_dense(positions, weights), matrices()
    out = np.empty_like(positions)
    offsets, corners = np.arange(0, quads.size + 1, 4), quads.ravel()
    sides = np.stack((quads, np.roll(quads, -1, axis=1)), axis=-1).reshape(-1, 2)
    edges = np.unique(np.sort(sides, axis=1), axis=0)
    topology = sinew.Topology(len(positions), edges, offsets, corners)
    corrective = sinew.CorrectiveSmooth(topology, positions).stage(0.5, 5)
    smooth = sinew.Smooth(topology).stage(0.5, 5)
    waves = [
        positions + np.float32(0.01 * n) * np.sin(positions[:, [2, 0, 1]] * n, dtype=np.float32) for n in range(20)
    ]
    keyed = sinew.Deformer(keys=sinew.ShapeKeys(waves, [0] * len(waves)))
    values = np.full(len(waves), 0.3, np.float32)
    ends = np.stack((np.zeros(JOINTS), np.zeros(JOINTS), np.arange(JOINTS) - 0.5), axis=1)
    few = sinew.Skin.from_dense(positions[::4], weights[::4])
    frames = np.stack([sinew.skin_linear(few, matrices(turn)) for turn in (0.5, 1.0, 1.5, 2.0)])
    no_faces = np.zeros(1, np.int32), np.empty(0, np.int32)

    def smoothed(stage):
        np.copyto(out, positions)
        stage.apply(out)

    return {
        "linear": lambda: sinew.skin_linear(skin, moved, out=out),
        "dual quaternion": lambda: sinew.skin_dual_quaternion(skin, moved, out=out),
        "20 shape keys": lambda: keyed.deform([], out, key_values=values),
        "Corrective Smooth, 5 times": lambda: smoothed(corrective),
        "Smooth, 5 times": lambda: smoothed(smooth),
        "automatic weights": lambda: sinew.automatic_weights(
            positions, offsets, corners, ends, ends + [0, 0, 1], resolution=64
        ),
        "decompose": lambda: sinew.decompose(few.rest_positions, frames, *no_faces, bones=8, iterations=3),
    }


def measure():
    times = {}
    for name, kernel in kernels().items():
        kernel()
        taken = []
        for _ in range(CALLS if name not in ("automatic weights", "decompose") else 3):
            start = time.perf_counter()
            kernel()
            taken.append(time.perf_counter() - start)
        times[name] = 1e3 * statistics.median(taken)
    print(json.dumps(times))


def compare(rounds, path, folders, pythons):
    found = {"Linux": [], "Windows": []}
    for _ in range(rounds):
        for times, folder, python in zip(found.values(), folders, pythons):
            environment = {**os.environ, "PYTHONPATH": folder}
            command = [python, __file__, "measure"]
            said = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True).stdout
            times.append(json.loads(said.splitlines()[-1]))
    Path(path).write_text(json.dumps(found, indent=1))
    print(f"Milliseconds, medians of {rounds} rounds; {VERTICES:,} vertices.\n")
    print("| kernel | GCC, Linux | MinGW, Wine | ratio | of each round |\n|---|---|---|---|---|")
    for name in found["Linux"][0]:
        ours, theirs = ([each[name] for each in times] for times in found.values())
        ratios = sorted(b / a for a, b in zip(ours, theirs))
        print(
            f"| {name} | {statistics.median(ours):.3f} | {statistics.median(theirs):.3f} "
            f"| {statistics.median(ratios):.2f} | {ratios[0]:.2f} to {ratios[-1]:.2f} |"
        )


if __name__ == "__main__":
    if sys.argv[1:] == ["measure"]:
        measure()
    else:
        _, _, rounds, path, *rest = sys.argv
        compare(int(rounds), path, rest[:2], rest[2:])
