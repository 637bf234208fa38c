# SPDX-License-Identifier: Apache-2.0
"""Poses of a running sightlined as they are estimated (docs/poses.md). No dependencies.

    for pose in sightline_poses.follow("http://127.0.0.1:8080"):
        print(pose["object"], pose["state"], pose.get("translation_m"))
"""
import json
import time
import urllib.error
import urllib.request


def follow(server="http://127.0.0.1:8080", token=None, again=True, timeout_s=30):
    """Yields each pose as a dictionary, for ever. With `again` False a lost connection is an OSError; the daemon gives a
    sign of life every ten seconds, so silence for `timeout_s` is one."""
    headers = {"Authorization": "Bearer " + token} if token else {}
    while True:
        try:
            request = urllib.request.Request(server.rstrip("/") + "/api/v1/events", headers=headers)
            with urllib.request.urlopen(request, timeout=timeout_s) as answer:
                event = ""
                for line in answer:
                    line = line.decode().rstrip("\n")
                    if line.startswith("event: "):
                        event = line[7:]
                    elif line.startswith("data: ") and event == "pose":
                        yield json.loads(line[6:])
            raise ConnectionError(server + " closed the connection")
        except OSError as error:
            refused = isinstance(error, urllib.error.HTTPError)  # another attempt would be refused, too
            if not again or refused:
                raise
            time.sleep(1)


def rotation_matrix(w, x, y, z):
    """Rows of the rotation of a unit quaternion."""
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]


def ros_covariance(pose):
    """The 36 numbers of geometry_msgs/PoseWithCovariance: (x, y, z, turns about x, y, z), in the axes of the world. Ours are
    (turns, translation) in the axes of the object."""
    turn = rotation_matrix(*pose["rotation_wxyz"])
    c = pose["covariance"]
    blocks = [[[c[6 * (3 * a + i) + 3 * b + k] for k in range(3)] for i in range(3)] for a in (1, 0) for b in (1, 0)]

    def turned(m):
        left = [[sum(turn[i][j] * m[j][k] for j in range(3)) for k in range(3)] for i in range(3)]
        return [[sum(left[i][j] * turn[k][j] for j in range(3)) for k in range(3)] for i in range(3)]
    blocks = [turned(block) for block in blocks]
    return [blocks[2 * (row // 3) + column // 3][row % 3][column % 3] for row in range(6) for column in range(6)]
