#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Files that came from strangers, in the hands of the programs: what they may take along, and how they are refused."""
import json
import os
import shutil
import struct
import unittest

from support import BENCH, TemporaryFolder, installation, read_text, sightline

SECRET = "root:$6$of-another"


def glb(document, data):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    return (b"glTF" + struct.pack("<II", 2, 28 + len(text) + len(data)) + struct.pack("<I", len(text)) + b"JSON" + text +
            struct.pack("<I", len(data)) + b"BIN\0" + data)


def triangles(indices, nodes):
    """Two triangles as GLB."""
    data = struct.pack("<9f", 0, 0, 0, .1, 0, 0, 0, .1, 0) + struct.pack("<6H", 0, 1, 2, *indices)
    return glb({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes,
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
                "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                              {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}],
                "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 36},
                                {"buffer": 0, "byteOffset": 36, "byteLength": 12}],
                "buffers": [{"byteLength": 48}]}, data)


class Objects(TemporaryFolder):
    """An object folder that somebody sent."""

    def setUp(self):
        super().setUp()
        self.secret = self.write("secret", SECRET)
        shutil.copytree(os.path.join(BENCH, "objects"), self.path("objects"))
        self.object = self.path("objects", "carton.toml")

    def config(self):
        text = installation(8554, 9754).replace(f"{BENCH}/objects/carton.toml", self.object)
        return self.write("sightline.toml", text)

    def record(self):
        sightline("record", "--config", self.config(), self.path("out"), "--seconds", "1")
        return self.path("out")

    def taken(self, folder):
        """Names of the recording's object files, and whether any file of it holds the secret."""
        names, found = set(), False
        for place, _, files in os.walk(folder):
            for name in files:
                path = os.path.join(place, name)
                if "objects" in path:
                    names.add(os.path.relpath(path, os.path.join(folder, "objects")))
                with open(path, "rb") as file:
                    found = found or SECRET.encode() in file.read()
        return names, found

    def test_a_recording_takes_no_file_that_a_comment_mentions(self):
        with open(self.object, "a", encoding="utf-8") as file:
            file.write(f"\n# see {self.secret} and \"../secret\"\n")
        names, found = self.taken(self.record())
        self.assertFalse(found, "a file of the host went into the recording")
        self.assertIn("carton.toml", names)
        self.assertNotIn("secret", names)

    def test_what_a_mesh_names_outside_its_folder_is_left_out_and_said(self):
        shutil.copy(os.path.join(self.path("objects"), self.mesh()), self.path("objects", "odd.obj"))
        with open(self.path("objects", "odd.obj"), "a", encoding="utf-8") as file:
            file.write(f"\nmtllib {self.secret}\nmtllib linked.mtl\n")
        os.symlink(self.secret, self.path("objects", "linked.mtl"))
        text = read_text(self.object).replace(self.mesh(), "odd.obj")
        self.write("objects/carton.toml", text)
        out = self.record()
        names, found = self.taken(out)
        self.assertFalse(found)
        self.assertIn("odd.obj", names)
        self.assertNotIn("linked.mtl", names)
        manifest = read_text(os.path.join(out, "recording.toml"))
        self.assertIn("left_out", manifest)
        self.assertIn("linked.mtl", manifest)
        warnings = json.loads(sightline("check", out, "--json")[0])["warnings"]
        self.assertTrue(any("linked.mtl" in warning for warning in warnings), warnings)

    def mesh(self):
        return next(line.split('"')[1] for line in read_text(os.path.join(BENCH, "objects", "carton.toml")).split("\n")
                    if line.startswith("mesh"))


class Refusals(TemporaryFolder):
    """Bad input exits with 2 and is named, at once."""

    def check_mesh(self, name, content, word):
        with open(self.path(name), "wb") as file:
            file.write(content)
        self.write("object.toml", f'name = "odd"\nmesh = "{name}"\nunit = "m"\n')
        self.assertIn(word, sightline("model", self.path("object.toml"), status=2)[1])

    def test_corrupt_indices_of_a_glb(self):
        for index in (3, 65535):
            self.check_mesh("odd.glb", triangles([0, 1, index], [{"mesh": 0}]), "out of range")

    def test_nodes_in_a_circle(self):
        self.check_mesh("odd.glb", triangles([0, 1, 2], [{"mesh": 0}, {"children": [2]}, {"children": [1]}]), "circle")
        self.check_mesh("odd.glb", triangles([0, 1, 2], [{"mesh": 0, "children": [0]}]), "no root")

    def test_links_in_a_circle(self):
        os.symlink("b.obj", self.path("a.obj"))
        os.symlink("a.obj", self.path("b.obj"))
        self.write("object.toml", 'name = "odd"\nmesh = "a.obj"\nunit = "m"\n')
        self.assertIn("a.obj", sightline("model", self.path("object.toml"), status=2)[1])
        os.symlink("a.toml", self.path("a.toml"))
        self.assertIn("a.toml", sightline("check", self.path("a.toml"), status=2)[1])

    def test_materials_without_end(self):
        text = "".join(f"usemtl m{i}\nv {i}e-5 0 0\nv {i}e-5 .1 0\nv 0 .1 .1\nf -3 -2 -1\n" for i in range(60000))
        self.check_mesh("odd.obj", text.encode(), "materials")

    def test_lenses_that_no_camera_has(self):
        good = read_text(os.path.join(BENCH, "calibration.toml"))
        line = next(line for line in good.split("\n") if line.startswith("fx"))
        for value in ("1e300", "1e-300", "-1e300"):
            calibration = self.write("calibration.toml", good.replace(line, f"fx = {value}", 1))
            text = installation(8554, 9754).replace(f"{BENCH}/calibration.toml", calibration)
            self.assertIn("focal length", sightline("check", self.write("a.toml", text), status=2)[1])

    def test_depth_images_that_are_none(self):
        # OpenEXR, whose header says that it has two thousand million pixels a side.
        attributes = b""
        for name, kind, value in (
                (b"channels", b"chlist", b"Z\0" + struct.pack("<iiii", 2, 0, 1, 1) + b"\0"),
                (b"compression", b"compression", b"\0"),
                (b"dataWindow", b"box2i", struct.pack("<4i", 0, 0, 1999999999, 1999999999)),
                (b"displayWindow", b"box2i", struct.pack("<4i", 0, 0, 1999999999, 1999999999)),
                (b"lineOrder", b"lineOrder", b"\0"), (b"pixelAspectRatio", b"float", struct.pack("<f", 1)),
                (b"screenWindowCenter", b"v2f", struct.pack("<2f", 0, 0)),
                (b"screenWindowWidth", b"float", struct.pack("<f", 1))):
            attributes += name + b"\0" + kind + b"\0" + struct.pack("<I", len(value)) + value
        with open(self.path("depth.exr"), "wb") as file:
            file.write(b"v/1\x01" + struct.pack("<I", 2) + attributes + b"\0" + b"\0" * 64)
        text = installation(8554, 9754).replace('name = "left"\n',
                                                f'name = "left"\nscene_depth = "{self.path("depth.exr")}"\n', 1)
        self.assertIn("depth.exr", sightline("check", self.write("a.toml", text), status=2)[1])


if __name__ == "__main__":
    unittest.main()
