// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "sightline/pipeline/replay_library.hpp"
#include "sightline/pipeline/rig.hpp"
#include "sightline/record/evaluate.hpp"

namespace sightline::bench {

/// A recording with truth, whose objects are known by region, edge and texture alone.
struct TruthRecording {
  std::shared_ptr<const Recording> recording;
  Installation installation;
  Rig rig;
  std::vector<std::vector<TruthRow>> truth;  ///< by object
};

/// `objects`: so many of them, from the `first`; all that follow it if not given. Refused: without
/// truth, or with fewer.
inline Result<TruthRecording> open_truth_recording(const std::filesystem::path& path,
                                                   std::optional<size_t> objects = {},
                                                   size_t first = 0) {
  TruthRecording out;
  SL_ASSIGN(Recording opened, open_recording(path));
  out.recording = std::make_shared<const Recording>(std::move(opened));
  if (!out.recording->truth) {
    return make_error(ErrorCode::kInvalidInput, path.string(), "has no truth.csv");
  }
  SL_ASSIGN(const std::vector<TruthRow> truth, read_truth(*out.recording->truth));
  SL_ASSIGN(out.installation, recording_installation(path));
  std::vector<ObjectConfig>& known = out.installation.objects;
  const size_t count = objects.value_or(known.size() - std::min(first, known.size()));
  if (first + count > known.size()) {
    return make_error(ErrorCode::kInvalidInput, path.string(), "has {} objects, not {}",
                      known.size(), first + count);
  }
  known.erase(known.begin(), known.begin() + static_cast<ptrdiff_t>(first));
  known.resize(count);
  for (ObjectConfig& object : known) object.description.modalities = {false, true, true, true};
  SL_ASSIGN(out.rig, load_rig(out.installation));
  out.truth.resize(count);
  for (const TruthRow& row : truth) {
    for (size_t i = 0; i < count; ++i) {
      if (row.object == out.rig.objects[i].named.name) out.truth[i].push_back(row);
    }
  }
  return out;
}

}  // namespace sightline::bench
