# SPDX-License-Identifier: Apache-2.0
"""Faults that modellers and converters leave in meshes, put into .obj files. Textures stay, normals go."""
import math
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


def finer(lines, places, textures, most):
    """Triangles instead of the faces among the lines, divided into four until there are so many. New vertices are added;
    returns the triangles of each face by its id."""
    middles = {}

    def middle(a, b):
        key = (min(a, b, key=str), max(a, b, key=str))
        if key not in middles:
            places.append([(x + y) / 2 for x, y in zip(places[a[0] - 1], places[b[0] - 1])])
            if a[1] and b[1]:
                textures.append([(x + y) / 2 for x, y in zip(textures[a[1] - 1], textures[b[1] - 1])])
            middles[key] = (len(places), len(textures) if a[1] and b[1] else None)
        return middles[key]

    def divided(triangles):
        out = []
        for a, b, c in triangles:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            out += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        return out

    faces = {id(f): [(f[0], f[i], f[i + 1]) for i in range(1, len(f) - 1)] for f in lines if not isinstance(f, str)}
    while sum(map(len, faces.values())) < most:
        faces = {key: divided(triangles) for key, triangles in faces.items()}
    return faces


def scanned(mesh):
    """Triangles of a scanner: so fine that there are 30,000 or more, each corner off by 0.06 % of the mesh's size."""
    chance = random.Random(3)
    lines = lines_of(mesh)
    places, textures = numbers(lines, "v "), numbers(lines, "vt ")
    size = size_of(places)
    faces = finer(lines, places, textures, 30000)
    places[:] = [[x + chance.gauss(0, 6e-4) * size for x in place] for place in places]
    write(mesh, lines, places, textures, lambda f: faces[id(f)])


def smooth(mesh):
    """Edges rounded, as of a scanner that sees less: 10,000 triangles or more, whose corners move half way to the mean of
    their neighbors, ten times."""
    lines = lines_of(mesh)
    places, textures = numbers(lines, "v "), numbers(lines, "vt ")
    faces = finer(lines, places, textures, 10000)
    neighbors = [set() for _ in places]
    for a, b, c in (triangle for triangles in faces.values() for triangle in triangles):
        for vertex, others in ((a, (b, c)), (b, (c, a)), (c, (a, b))):
            neighbors[vertex[0] - 1].update(other[0] - 1 for other in others)
    for _ in range(10):
        places = [[x / 2 + sum(places[n][i] for n in near) / (2 * len(near)) for i, x in enumerate(place)] if near else place
                  for place, near in zip(places, neighbors)]
    write(mesh, lines, places, textures, lambda f: faces[id(f)])


def coarse(mesh):
    """Few faces: vertices are joined within cells of a twentieth of the mesh's size."""
    lines = lines_of(mesh)
    places = numbers(lines, "v ")
    cell = size_of(places) / 20
    cells = {}
    for i, place in enumerate(places):
        cells.setdefault(tuple(math.floor(x / cell) for x in place), []).append(i)
    joined = {i: members for members in cells.values() for i in members}
    new = [[sum(places[m][axis] for m in joined[i]) / len(joined[i]) for axis in range(3)] for i in range(len(places))]

    def kept(f):
        first = [(joined[vertex - 1][0] + 1, texture) for vertex, texture in f]
        triangles = [(first[0], first[i], first[i + 1]) for i in range(1, len(first) - 1)]
        return [t for t in triangles if len({vertex for vertex, _ in t}) == 3]

    write(mesh, lines, new, numbers(lines, "vt "), kept)


def normal(places, f):
    a, b, c = (places[vertex - 1] for vertex, _ in f[:3])
    u, v = [x - y for x, y in zip(b, a)], [x - y for x, y in zip(c, a)]
    n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    return [x / (math.hypot(*n) or 1) for x in n]


def opened(mesh):
    """Without the side on which the object lay when it was scanned: what points down the mesh's shortest axis."""
    lines = lines_of(mesh)
    places = numbers(lines, "v ")
    extents = [max(axis) - min(axis) for axis in zip(*places)]
    shortest = extents.index(min(extents))
    rewrite(mesh, lambda f: [f] if normal(places, f)[shortest] > -0.7 else [])


def enlarged(mesh):
    """One percent too large, about its middle."""
    lines = lines_of(mesh)
    places = numbers(lines, "v ")
    middle = [(max(axis) + min(axis)) / 2 for axis in zip(*places)]
    write(mesh, lines, [[m + 1.01 * (x - m) for x, m in zip(place, middle)] for place in places],
          numbers(lines, "vt "), lambda f: [f])


def plain(mesh):
    """Without colors."""
    text = mesh.read_text(encoding="utf-8")
    mesh.write_text(re.sub(r"(?m)^(mtllib|usemtl) .*\n", "", text), encoding="utf-8")


def faded(mesh):
    """Colors as someone guessed them: half way to gray. Textures stay."""
    for library in re.findall(r"(?m)^mtllib (.*)$", mesh.read_text(encoding="utf-8")):
        path = mesh.parent / library.strip()
        fade = lambda m: "Kd " + " ".join(f"{0.5 * float(x) + 0.25:.4f}" for x in m[1].split())  # noqa: E731
        path.write_text(re.sub(r"(?m)^Kd (.*)$", fade, path.read_text(encoding="utf-8")), encoding="utf-8")


FAULTS = {"mixed": mixed, "inside-out": inside_out, "two-sided": two_sided, "split": split, "scanned": scanned,
          "smooth": smooth, "coarse": coarse, "open": opened, "enlarged": enlarged, "plain": plain, "faded": faded}
