# SPDX-License-Identifier: Apache-2.0
"""Faults that modellers and converters leave in meshes, put into .obj files. Textures stay, normals go."""
import random
import re

NUMBER = "{:.9g} {:.9g} {:.9g}"


def corners(line):
    """(vertex, place in the texture or None) of a face's corners, counted from 1."""
    out = []
    for corner in line.split()[1:]:
        indices = corner.split("/")
        out.append((int(indices[0]), int(indices[1]) if len(indices) > 1 and indices[1] else None))
    return out


def face(corner_list):
    return "f " + " ".join(f"{v}" if t is None else f"{v}/{t}" for v, t in corner_list)


def lines_of(mesh):
    """Lines without normals; faces as lists of corners."""
    lines = [line for line in mesh.read_text(encoding="utf-8").splitlines() if not line.startswith("vn ")]
    return [corners(line) if line.startswith("f ") else line for line in lines]


def rewrite(mesh, faces_of):
    """Writes the mesh with the faces that `faces_of` makes of each."""
    out = []
    for line in lines_of(mesh):
        out += [line] if isinstance(line, str) else [face(f) for f in faces_of(line)]
    mesh.write_text("\n".join(out) + "\n", encoding="utf-8")


def mixed(mesh):
    """Every other face, by chance, runs the other way round."""
    chance = random.Random(3)
    rewrite(mesh, lambda f: [f[::-1] if chance.random() < 0.5 else f])


def inside_out(mesh):
    rewrite(mesh, lambda f: [f[::-1]])


def two_sided(mesh):
    """Every face twice, once from either side."""
    rewrite(mesh, lambda f: [f, f[::-1]])


def split(mesh):
    """Every face has corners of its own, which miss those of its neighbors by 1e-6 of the mesh's size."""
    chance = random.Random(3)
    lines = lines_of(mesh)
    places = [[float(x) for x in line.split()[1:4]] for line in lines
              if isinstance(line, str) and line.startswith("v ")]
    size = max(max(axis) - min(axis) for axis in zip(*places))
    vertices, out = [], []
    for line in lines:
        if isinstance(line, str):
            out += [] if re.match(r"v ", line) else [line]
            continue
        own = []
        for vertex, texture in line:
            vertices.append("v " + NUMBER.format(*(x + chance.uniform(-1e-6, 1e-6) * size for x in places[vertex - 1])))
            own.append((len(vertices), texture))
        out.append(face(own))
    first = next((i for i, line in enumerate(out) if not line.startswith(("#", "mtllib", "o "))), 0)
    mesh.write_text("\n".join(out[:first] + vertices + out[first:]) + "\n", encoding="utf-8")


FAULTS = {"mixed": mixed, "inside-out": inside_out, "two-sided": two_sided, "split": split}
