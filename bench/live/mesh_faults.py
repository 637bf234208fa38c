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


def numbers(lines, kind):
    return [[float(x) for x in line.split()[1:4]] for line in lines if isinstance(line, str) and line.startswith(kind)]


def size_of(places):
    return max(max(axis) - min(axis) for axis in zip(*places))


def write(mesh, lines, places, textures, faces_of):
    """The mesh with these vertices, places in the texture, and the faces that `faces_of` makes of each."""
    kept = [line for line in lines if not isinstance(line, str) or not re.match(r"vt? ", line)]
    body = []
    for line in kept:
        body += [line] if isinstance(line, str) else [face(f) for f in faces_of(line)]
    first = next((i for i, line in enumerate(body) if not line.startswith(("#", "mtllib", "o "))), 0)
    points = ["v " + NUMBER.format(*place) for place in places] + ["vt {:.9g} {:.9g}".format(*t[:2]) for t in textures]
    mesh.write_text("\n".join(body[:first] + points + body[first:]) + "\n", encoding="utf-8")


def split(mesh):
    """Every face has corners of its own, which miss those of its neighbors by 1e-6 of the mesh's size."""
    chance = random.Random(3)
    lines = lines_of(mesh)
    places = numbers(lines, "v ")
    size = size_of(places)
    own_places, faces = [], {}
    for line in lines:
        if isinstance(line, str):
            continue
        own = faces[id(line)] = []
        for vertex, texture in line:
            own_places.append([x + chance.uniform(-1e-6, 1e-6) * size for x in places[vertex - 1]])
            own.append((len(own_places), texture))
    write(mesh, lines, own_places, numbers(lines, "vt "), lambda f: [faces[id(f)]])


def scanned(mesh):
    """Triangles of a scanner: so fine that there are 30,000 or more, each corner off by 0.06 % of the mesh's size."""
    chance = random.Random(3)
    lines = lines_of(mesh)
    places, textures = numbers(lines, "v "), numbers(lines, "vt ")
    size = size_of(places)
    middles = {}

    def middle(a, b):
        key = (min(a, b, key=str), max(a, b, key=str))
        if key not in middles:
            places.append([(x + y) / 2 for x, y in zip(places[a[0] - 1], places[b[0] - 1])])
            if a[1] and b[1]:
                textures.append([(x + y) / 2 for x, y in zip(textures[a[1] - 1], textures[b[1] - 1])])
            middles[key] = (len(places), len(textures) if a[1] and b[1] else None)
        return middles[key]

    def finer(triangles):
        out = []
        for a, b, c in triangles:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            out += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        return out

    faces = {id(f): [(f[0], f[i], f[i + 1]) for i in range(1, len(f) - 1)] for f in lines if not isinstance(f, str)}
    while sum(map(len, faces.values())) < 30000:
        faces = {key: finer(triangles) for key, triangles in faces.items()}
    places[:] = [[x + chance.gauss(0, 6e-4) * size for x in place] for place in places]
    write(mesh, lines, places, textures, lambda f: faces[id(f)])


FAULTS = {"mixed": mixed, "inside-out": inside_out, "two-sided": two_sided, "split": split, "scanned": scanned}
