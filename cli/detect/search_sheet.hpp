// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "detect/set_search.hpp"
#include "sightline/image/image.hpp"

namespace sightline::cli {

/// A contact sheet of searches: a row for each set of frames, a column for each camera. The outline
/// of the true pose is green; that of the pose found is yellow, red if it is wrong; that of the
/// best pose which was not believed (`sightline detect --explain`) is blue.
class SearchSheet {
 public:
  static constexpr size_t kMaxRows = 8;

  /// Adds a row, up to kMaxRows; what comes after them is left out.
  Status add(const SearchedObject& object, const SetResult& result,
             const std::vector<FramePtr>& frames);
  /// Null before the first row.
  std::shared_ptr<const Image> draw() const;

 private:
  std::vector<std::vector<std::shared_ptr<const Image>>> rows_;
};

}  // namespace sightline::cli
