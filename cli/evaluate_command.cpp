// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "report.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "sightline/pipeline/object_views.hpp"
#include "sightline/record/evaluate.hpp"
#include "split.hpp"

namespace sightline::cli {
namespace {

struct EvaluateCommandOptions {
  std::filesystem::path truth;
  std::filesystem::path poses;
  std::vector<std::filesystem::path> object_files;  ///< whose symmetry counts
  std::vector<std::string> alike;                   ///< names, separated by commas
  bool keyframes = false;                           ///< the truth holds at its own times only
  bool json = false;
};

// Middle and symmetries of an object's mesh.
Result<EvaluatedShape> shape_of(const ObjectDescription& object) {
  MeshOptions options;
  options.meters_per_unit = object.meters_per_unit;
  SL_ASSIGN(const TriangleMesh mesh, read_mesh(object.mesh, options));
  const auto renderable = std::make_shared<const RenderMesh>(make_render_mesh(mesh));
  SL_ASSIGN(const auto views,
            ViewpointModel::load_or_build(mesh, mesh_depth_renderer_factory(renderable), {},
                                          cache_folder()));
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& vertex : mesh.vertices) box.extend(vertex.cast<double>());
  return EvaluatedShape{box.center(), views->symmetry_rotations()};
}

Result<Evaluation> evaluate_files(const EvaluateCommandOptions& options) {
  SL_ASSIGN(const auto truth, read_truth(options.truth));
  SL_ASSIGN(const auto poses, read_pose_log(options.poses));
  EvaluateOptions rules;
  rules.keyframes = options.keyframes || options.truth.filename() == "keyframes.csv";
  for (const std::string& names : options.alike) {
    rules.alike.push_back(split(names, ','));
    if (rules.alike.back().size() > EvaluateOptions::kMostAlike) {
      return make_error(ErrorCode::kInvalidInput, "--alike", "{} names, at most {} of a kind",
                        rules.alike.back().size(), EvaluateOptions::kMostAlike);
    }
    for (const std::string& name : rules.alike.back()) {
      const bool known = std::any_of(truth.begin(), truth.end(),
                                     [&](const TruthRow& row) { return row.object == name; });
      if (!known) {
        return make_error(ErrorCode::kInvalidInput, "--alike", "no truth of '{}' in {}", name,
                          options.truth.string());
      }
    }
  }
  for (const auto& file : options.object_files) {
    SL_ASSIGN(const ObjectDescription object, read_object_file(file));
    rules.symmetry[object.name] = {object.symmetry, object.symmetry_axis, object.symmetry_order};
    if (!rules.keyframes || object.mesh.empty()) continue;
    SL_ASSIGN(rules.shape[object.name], shape_of(object));
  }
  Evaluation evaluation = sightline::evaluate(truth, poses, rules);
  if (evaluation.objects.empty()) {
    return make_error(ErrorCode::kInvalidInput, options.truth.string(), "holds no truth");
  }
  return evaluation;
}

int evaluate(const EvaluateCommandOptions& options) {
  const auto evaluation = evaluate_files(options);
  if (!evaluation) return report(evaluation.error());
  fmt::print("{}", options.json ? to_json(*evaluation) + "\n" : to_text(*evaluation));
  return 0;
}

}  // namespace

void add_evaluate(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<EvaluateCommandOptions>();
  auto* command = app.add_subcommand("evaluate", "errors of a pose log against the truth");
  command->add_option("TRUTH", options->truth, "truth.csv")->required();
  command->add_option("POSES", options->poses, "poses.csv")->required();
  command
      ->add_option("--object", options->object_files,
                   "object file whose symmetry the errors respect; with keyframes, also those that "
                   "its mesh has, and positions are those of its middle; may be repeated")
      ->allow_extra_args(false);
  command
      ->add_option("--alike", options->alike,
                   "NAME,NAME[,...]: they look the same, so that nobody can say which is which at "
                   "first: the log's names are given to them as fits the truth best, once; may be "
                   "repeated")
      ->allow_extra_args(false);
  command->add_flag("--keyframes", options->keyframes,
                    "the truth holds at its own times only, and each is judged (default for a file "
                    "called keyframes.csv)");
  command->add_flag("--json", options->json, "as JSON");
  command->callback([options, &chosen] { chosen = [options] { return evaluate(*options); }; });
}

}  // namespace sightline::cli
