# SPDX-License-Identifier: Apache-2.0
"""How far one surface is from another, by points on both: for meshes (OBJ) at poses."""
import bisect
import itertools
import random

POINTS, TARGETS = 100, 6000  # that are asked, and that are answered with


def read_obj(path):
    """Vertices and triangles (indices) of an OBJ file."""
    vertices, faces = [], []
    for line in path.read_text(encoding="utf-8").splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append(tuple(float(word) for word in words[1:4]))
        elif words[:1] == ["f"]:
            indices = [int(word.split("/")[0]) for word in words[1:]]
            indices = [i - 1 if i > 0 else len(vertices) + i for i in indices]
            faces += [(indices[0], *pair) for pair in itertools.pairwise(indices[1:])]
    return vertices, faces


def diagonal(vertices):
    return sum((max(v[i] for v in vertices) - min(v[i] for v in vertices)) ** 2 for i in range(3)) ** 0.5


def _area(a, b, c):
    u, v = [[p[i] - a[i] for i in range(3)] for p in (b, c)]
    return sum((u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2]) ** 2 for i in range(3)) ** 0.5


def sample_surface(vertices, faces, count):
    """Points spread evenly over the area; the same each time."""
    source = random.Random(1)
    sums = list(itertools.accumulate(_area(*(vertices[i] for i in face)) for face in faces))
    points = []
    for _ in range(count):
        at = min(bisect.bisect(sums, source.random() * sums[-1]), len(faces) - 1)
        a, b, c = (vertices[i] for i in faces[at])
        s, t = source.random(), source.random()
        if s + t > 1:
            s, t = 1 - s, 1 - t
        points.append(tuple(a[i] + s * (b[i] - a[i]) + t * (c[i] - a[i]) for i in range(3)))
    return points


class Targets:
    """Points of a surface in cells, for the distance to the nearest one."""

    def __init__(self, points, cell):
        self.cell, self.cells = cell, {}
        for point in points:
            self.cells.setdefault(self._key(point), []).append(point)

    def _key(self, point):
        return tuple(int(x // self.cell) for x in point)

    def distance(self, point, most):
        """At most `most`."""
        key, best = self._key(point), most * most
        reach = int(most / self.cell) + 1
        for ring in range(reach + 1):
            if best <= (max(0, ring - 1) * self.cell) ** 2:
                break
            for step in itertools.product(range(-ring, ring + 1), repeat=3):
                if max(map(abs, step)) != ring:
                    continue
                for other in self.cells.get(tuple(k + s for k, s in zip(key, step)), ()):
                    best = min(best, sum((p - q) ** 2 for p, q in zip(point, other)))
        return best ** 0.5


def rotate(q, v):
    """By a unit quaternion (w, x, y, z)."""
    w, u = q[0], q[1:]
    cross = [u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2] for i in range(3)]
    again = [u[i - 2] * cross[i - 1] - u[i - 1] * cross[i - 2] for i in range(3)]
    return [v[i] + 2 * (w * cross[i] + again[i]) for i in range(3)]


def transform(pose, v):
    """`pose`: tx, ty, tz, qw, qx, qy, qz."""
    turned = rotate(pose[3:], v)
    return tuple(turned[i] + pose[i] for i in range(3))


def transform_back(pose, v):
    return tuple(rotate((pose[3], -pose[4], -pose[5], -pose[6]), [v[i] - pose[i] for i in range(3)]))


class SurfaceDistance:
    """Between the surface of a mesh and that of another one, both ways; in units of the first's diagonal 95 % of the
    points of either surface are nearer to the other one."""

    def __init__(self, true_mesh, claimed_mesh):
        true, claimed = read_obj(true_mesh), read_obj(claimed_mesh)
        self.diagonal = diagonal(true[0])
        cell = 0.025 * self.diagonal
        self.true, self.claimed = sample_surface(*true, TARGETS), sample_surface(*claimed, TARGETS)
        self.true_cells, self.claimed_cells = Targets(self.true, cell), Targets(self.claimed, cell)

    def share(self, true_pose, claimed_pose):
        most = 0.1 * self.diagonal
        step = TARGETS // POINTS
        off = [self.true_cells.distance(transform_back(true_pose, transform(claimed_pose, p)), most)
               for p in self.claimed[::step]]
        off += [self.claimed_cells.distance(transform_back(claimed_pose, transform(true_pose, p)), most)
                for p in self.true[::step]]
        return sorted(off)[int(0.95 * len(off))] / self.diagonal
