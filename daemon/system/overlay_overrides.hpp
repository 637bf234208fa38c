// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>

#include "sightline/base/snapshot.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/control/http_content.hpp"

namespace sightline {

/// Styles that an operator chose while the system runs. They are in no file: a restart forgets
/// them, and a reload whose file has another overlay for a camera takes that.
class OverlayOverrides {
 public:
  OverlayOverrides() { in_file_.publish(std::make_shared<const Styles>()); }

  /// `next` as read from its file: what was chosen for cameras whose overlay is the same in this
  /// file as in the one before stays. One thread, as the rest but json().
  void carry_over(const Installation& running, Installation& next) const;
  /// What the file in force says.
  void note_file(const Installation& as_read);

  /// Changes the overlays of `installation` as ordered; refused with nothing changed.
  Status change(const OverlayRequest& request, Installation& installation) const;
  /// As the file says.
  void reset(Installation& installation) const;

  /// What is in force, and what there is to choose from. Any thread.
  std::string json(const Installation& running) const;

 private:
  using Styles = std::map<std::string, OverlayStyle>;  // by camera or virtual camera
  Snapshot<const Styles> in_file_;                     // never null inside
};

}  // namespace sightline
