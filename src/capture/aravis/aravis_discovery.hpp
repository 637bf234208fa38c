// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "capture/aravis/aravis_ref.hpp"

namespace sightline::capture {

/// A camera that answered.
struct FoundCamera {
  std::string id;        ///< "Vendor-Model-Serial"
  std::string physical;  ///< MAC or USB GUID
  std::string address;   ///< IPv4 of GigE Vision cameras
  std::string vendor, model, serial;
  bool gige = false;
};

/// Who answers within a second. Callers that wait for each other share one answer.
std::vector<FoundCamera> discover_aravis();

/// "Vendor-Model-Serial at 10.0.0.7, ..." or "no camera answers", for messages.
std::string to_string(const std::vector<FoundCamera>& cameras);

/// Finds the camera (AravisOptions::id) and takes control of it. At most about 4 s.
Result<ObjectRef<ArvCamera>> connect_aravis(const std::string& id, const std::string& name);

/// Same, of one that discover_aravis() found.
Result<ObjectRef<ArvCamera>> connect_aravis(const FoundCamera& found, const std::string& interface,
                                            const std::string& name);

}  // namespace sightline::capture
