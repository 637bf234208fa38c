// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdio>

#include "commands.hpp"
#include "report.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/record/evaluate.hpp"

namespace sightline::cli {
namespace {

Result<Evaluation> evaluate_files(const EvaluateCommandOptions& options) {
  SL_ASSIGN(const auto truth, read_truth(options.truth));
  SL_ASSIGN(const auto poses, read_pose_log(options.poses));
  EvaluateOptions rules;
  for (const auto& file : options.object_files) {
    SL_ASSIGN(const ObjectDescription object, read_object_file(file));
    rules.symmetry[object.name] = {object.symmetry, object.symmetry_axis, object.symmetry_order};
  }
  Evaluation evaluation = sightline::evaluate(truth, poses, rules);
  if (evaluation.objects.empty()) {
    return make_error(ErrorCode::kInvalidInput, options.truth.string(), "holds no truth");
  }
  return evaluation;
}

}  // namespace

int evaluate(const EvaluateCommandOptions& options) {
  const auto evaluation = evaluate_files(options);
  if (!evaluation) return report(evaluation.error());
  fmt::print("{}", options.json ? to_json(*evaluation) + "\n" : to_text(*evaluation));
  return 0;
}

}  // namespace sightline::cli
