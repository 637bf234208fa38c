#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Poses of a running sightlined as ROS 2 messages (docs/poses.md): `pose/OBJECT` (geometry_msgs/PoseWithCovarianceStamped)
and the transform world -> OBJECT on /tf. Needs rclpy, geometry_msgs and tf2_ros of any ROS 2 distribution.

    ros2_bridge.py [http://127.0.0.1:8080 [WORLD_FRAME]]
"""
import sys

import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from rclpy.node import Node
from tf2_ros import TransformBroadcaster

import sightline_poses


def main():
    server = sys.argv[1] if len(sys.argv) > 1 else "http://127.0.0.1:8080"
    world = sys.argv[2] if len(sys.argv) > 2 else "world"
    rclpy.init()
    node, publishers = Node("sightline"), {}
    broadcaster = TransformBroadcaster(node)
    for pose in sightline_poses.follow(server):
        if not rclpy.ok():
            return
        if "translation_m" not in pose:  # searching or lost: silence is what ROS has for it
            continue
        name = pose["object"]
        if name not in publishers:
            publishers[name] = node.create_publisher(PoseWithCovarianceStamped, f"pose/{name}", 10)
        message, transform = PoseWithCovarianceStamped(), TransformStamped()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(pose["utc_ns"], 10 ** 9)
        message.header.frame_id = world
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        place.x, place.y, place.z = map(float, pose["translation_m"])
        turn.w, turn.x, turn.y, turn.z = map(float, pose["rotation_wxyz"])
        message.pose.covariance = sightline_poses.ros_covariance(pose)
        transform.header, transform.child_frame_id = message.header, name
        transform.transform.rotation = turn
        shift = transform.transform.translation
        shift.x, shift.y, shift.z = place.x, place.y, place.z
        publishers[name].publish(message)
        broadcaster.sendTransform(transform)


if __name__ == "__main__":
    main()
