"""Writes and reads the text files of a rig folder: mesh.obj, skeleton.bf, *.dmat.

Arrays: V vertices, J skeleton rows, B weight columns (bones), P poses.
File space: metres, Y up, facing +Z, the character's left at +X.
"""

import os

import numpy as np


def write_text(path, text):
    """Replaces the file in one step, so that a reader never sees half of it."""
    scratch = f"{path}.part"
    with open(scratch, "w", encoding="ascii", newline="\n") as file:
        file.write(text)
    os.replace(scratch, path)


def write_obj(path, vertices, groups, title, material_library=None):
    """vertices (V, 3) in metres; groups: list of (material or None, list of vertex tuples)."""
    lines = [f"# {title}"]
    if material_library:
        lines.append(f"mtllib {material_library}")
    lines += ["v %.5f %.5f %.5f" % tuple(v) for v in vertices]
    for material, faces in groups:
        if material:
            lines.append(f"usemtl {material}")
        lines += ["f " + " ".join(str(index + 1) for index in face) for face in faces]
    write_text(path, "\n".join(lines) + "\n")


def write_mtl(path, colours):
    """colours: material -> (red, green, blue), linear 0..1."""
    lines = []
    for name, (red, green, blue) in colours.items():
        lines += [f"newmtl {name}", f"Kd {red:.4f} {green:.4f} {blue:.4f}", ""]
    write_text(path, "\n".join(lines))


def write_bf(path, rows):
    """rows: list of (weight index, parent, offset (3) in metres, joint name)."""
    lines = ["%d %d %.5f %.5f %.5f %s" % (weight, parent, *offset, name) for weight, parent, offset, name in rows]
    write_text(path, "\n".join(lines) + "\n")


def write_dmat(path, matrix):
    """matrix (rows, columns), six digits, zeros as `0`."""
    rows, columns = matrix.shape
    entries = ["%.6f" % value if value else "0" for value in matrix.T.ravel().tolist()]
    write_text(path, f"{columns} {rows}\n" + "\n".join(entries) + "\n")


def write_quaternions(path, poses):
    """poses (P, J, 4), w x y z, more digits than weights have, so that they stay unit."""
    lines = [f"{poses.shape[0]} {poses.shape[1] * 4}"]
    lines += [" ".join("%.9g" % value for value in quaternion) for pose in poses for quaternion in pose]
    write_text(path, "\n".join(lines) + "\n")


def write_eulers(path, poses):
    """poses (P, J, 3), degrees, applied X then Y then Z."""
    lines = [f"{poses.shape[0]} {poses.shape[1] * 3}"]
    lines += [" ".join("%g" % angle for angle in joint) for pose in poses for joint in pose]
    write_text(path, "\n".join(lines) + "\n")


def round_convex(weights, digits=6):
    """Rounds each row of weights (V, B) so that the written numbers still sum to one."""
    unit = 10**digits
    steps = np.rint(weights * unit).astype(np.int64)
    rows = np.arange(len(steps))
    steps[rows, steps.argmax(axis=1)] += unit - steps.sum(axis=1)
    return steps / unit


def read_obj(path):
    """Returns vertices (V, 3) and a list of (material or None, face tuple)."""
    vertices, faces, material = [], [], None
    with open(path, encoding="ascii") as file:
        for line in file:
            fields = line.split()
            if not fields:
                continue
            if fields[0] == "v":
                vertices.append([float(value) for value in fields[1:4]])
            elif fields[0] == "usemtl":
                material = fields[1]
            elif fields[0] == "f":
                faces.append((material, tuple(int(f.split("/")[0]) - 1 for f in fields[1:])))
    return np.array(vertices), faces


def read_bf(path):
    """Returns weight indices (J,), parents (J,), offsets (J, 3), names."""
    with open(path, encoding="ascii") as file:
        rows = [line.split() for line in file if line.strip()]
    return (
        np.array([int(row[0]) for row in rows]),
        np.array([int(row[1]) for row in rows]),
        np.array([[float(value) for value in row[2:5]] for row in rows]),
        [row[5] for row in rows],
    )


def read_dmat(path):
    """Returns the (rows, columns) matrix of a text DMAT."""
    with open(path, encoding="ascii") as file:
        columns, rows = (int(value) for value in file.readline().split())
        return np.array(file.read().split(), dtype=float).reshape(columns, rows).T
