// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "capture/v4l2/v4l2_system.hpp"
#include "sightline/base/result.hpp"
#include "sightline/capture/common/device_info.hpp"

namespace sightline::capture {

/// Where the kernel and udev tell about cameras; tests put a tree of their own here.
struct V4l2Places {
  std::string sys = "/sys/class/video4linux";
  std::string dev = "/dev";
};

/// A device node and what it hangs on. Fields are empty where unknown.
struct V4l2Node {
  std::string path;      ///< /dev/video0: the number of today
  std::string card;      ///< the driver's name of it
  int index = 0;         ///< of the nodes of one device; webcams capture at 0
  std::string by_id;     ///< /dev/v4l/by-id/...
  std::string by_path;   ///< /dev/v4l/by-path/...
  std::string serial;    ///< USB serial number
  std::string usb_port;  ///< "1-2.3": bus and the ports on the way
  std::string model;     ///< USB manufacturer and product
};

/// All nodes, ordered by number.
std::vector<V4l2Node> find_v4l2_nodes(const V4l2Places& places = {});

/// The node that V4l2Options::device means. kUnavailable: none (yet), with a list of what is there;
/// kInvalidInput: not understood, more than one, or an identity mismatch.
Result<V4l2Node> choose_v4l2_node(const std::string& device, const std::vector<V4l2Node>& nodes,
                                  const std::string& where);

/// The most stable name by which choose_v4l2_node() finds this node again.
std::string stable_v4l2_id(const V4l2Node& node);

Result<std::vector<DeviceInfo>> list_v4l2_in(const V4l2Places& places,
                                             const std::shared_ptr<V4l2System>& system);

}  // namespace sightline::capture
