// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <mutex>
#include <utility>

namespace sightline {

/// A unit that others use while a reload may put another in its place; null: there is none. Any
/// thread.
template <typename Unit>
class UnitSlot {
 public:
  std::shared_ptr<Unit> get() const {
    std::lock_guard lock(mutex_);
    return unit_;
  }
  /// Stops the unit that was there and waits for it.
  void replace(std::shared_ptr<Unit> unit) {
    {
      std::lock_guard lock(mutex_);
      unit_.swap(unit);
    }
    if (unit) unit->stop();
  }

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<Unit> unit_;
};

}  // namespace sightline
