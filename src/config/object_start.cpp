// SPDX-License-Identifier: Apache-2.0
#include "config/object_start.hpp"

#include <fmt/format.h>

namespace sightline::config {

void read_start(TomlTable& table, ObjectConfig& object) {
  if (table.is_text("start")) {
    const auto word = table.text("start");
    object.start_last = word && word->text == "last";
    if (word && !object.start_last) {
      table.problem(
          "start",
          fmt::format("\"{}\" is neither \"last\" nor a pose, 4 rows of 4 numbers", word->text));
    }
    return;
  }
  const auto matrix = table.matrix("start", "\"last\", or a pose: 4 rows of 4 finite numbers");
  if (!matrix) return;
  const auto pose = Rigid3::from_matrix(*matrix, "");
  if (pose) {
    object.start = *pose;
  } else {
    table.problem("start", pose.error().text);
  }
}

}  // namespace sightline::config
