// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "commands.hpp"
#include "contact_sheet.hpp"
#include "report.hpp"
#include "sightline/base/time.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/observe/shape/near_symmetry.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "sightline/pipeline/object_views.hpp"
#include "sightline/record/overlay_video.hpp"

namespace sightline::cli {
namespace {

struct ModelOptions {
  std::filesystem::path file;   ///< object file, or mesh
  double meters_per_unit = 1;   ///< of a mesh
  std::filesystem::path cache;  ///< folder; empty: the user's
  bool no_cache = false;
  std::filesystem::path contact_sheet;  ///< contact sheet (PNG); empty: none
  bool json = false;
};

using Json = nlohmann::ordered_json;

Result<TriangleMesh> load(const ModelOptions& options) {
  MeshOptions mesh;
  mesh.meters_per_unit = options.meters_per_unit;
  if (options.file.extension() != ".toml") return read_mesh(options.file, mesh);
  SL_ASSIGN(const ObjectDescription object, read_object_file(options.file));
  mesh.meters_per_unit = object.meters_per_unit;
  return read_mesh(object.mesh, mesh);
}

Json statistics(const ViewpointModel& model) {
  size_t contour = 0, edges = 0, creases = 0, fewest = SIZE_MAX;
  float min_area = INFINITY, largest_area = 0;
  for (size_t i = 0; i < model.size(); ++i) {
    const View view = model.view(i);
    contour += view.contour.size();
    fewest = std::min(fewest, view.contour.size());
    edges += view.edges.size();
    for (const InnerEdgeSample& edge : view.edges) creases += edge.crease;
    min_area = std::min(min_area, view.area);
    largest_area = std::max(largest_area, view.area);
  }
  const auto per_view = [&](size_t n) {
    return std::round(10.0 * static_cast<double>(n) / static_cast<double>(model.size())) / 10;
  };
  return Json{{"views", model.size()},
              {"outline_samples_per_view", per_view(contour)},
              {"outline_samples_fewest", fewest},
              {"edge_samples_per_view", per_view(edges)},
              {"crease_samples_per_view", per_view(creases)},
              {"radius_mm", 1e3 * model.radius()},
              {"silhouette_least_cm2", 1e4 * double{min_area}},
              {"silhouette_largest_cm2", 1e4 * double{largest_area}}};
}

Json to_json(const Eigen::Vector3d& v) {
  Json out = Json::array();
  for (int i = 0; i < 3; ++i) out.push_back(std::round(100 * v[i]) / 100);
  return out;
}

double percent(double share) { return std::round(1000 * share) / 10; }

Json to_json(const NearSymmetry& symmetry, bool any_turn) {
  const double degrees = std::round(symmetry.turn.angle() * 180 / std::numbers::pi);
  return {{"axis", to_json(symmetry.turn.axis())},
          {"turn_deg", degrees},
          {"any_turn", any_turn},
          {"silhouette_differs_percent", percent(symmetry.mean.silhouette)},
          {"surface_differs_percent", percent(symmetry.mean.surface)},
          {"least_percent", percent(symmetry.least)},
          {"hidden_from", to_json(symmetry.hides)},
          {"most_percent", percent(symmetry.most)},
          {"shown_from", to_json(symmetry.shows)}};
}

// What tells turns of the object apart, in a line each.
void print_near_symmetries(const Json& symmetries) {
  for (const Json& s : symmetries) {
    fmt::print(
        "{:<26} {}{:.0f} deg about {}: {:.1f} % of the silhouette differ ({:.1f} % seen from {}, "
        "{:.1f} % from {}), {:.1f} % of the surface\n",
        "nearly symmetric", s["any_turn"] ? "every turn; at most " : "",
        s["turn_deg"].get<double>(), s["axis"].dump(),
        s["silhouette_differs_percent"].get<double>(), s["least_percent"].get<double>(),
        s["hidden_from"].dump(), s["most_percent"].get<double>(), s["shown_from"].dump(),
        s["surface_differs_percent"].get<double>());
  }
}

Result<Json> run(const ModelOptions& options) {
  SL_ASSIGN(const TriangleMesh mesh, load(options));
  const auto render_mesh = std::make_shared<const RenderMesh>(make_render_mesh(mesh));
  const DepthRendererFactory factory = mesh_depth_renderer_factory(render_mesh);
  const ViewpointModelOptions model_options;
  const auto folder = options.no_cache        ? std::filesystem::path()
                      : options.cache.empty() ? cache_folder()
                                              : options.cache;
  const double start = process_cpu_ms();
  SL_ASSIGN(const auto model, ViewpointModel::load_or_build(mesh, factory, model_options, folder));
  Json json{{"file", options.file.string()}, {"faces", mesh.faces.size()}};
  json["cpu_ms"] = std::round(process_cpu_ms() - start);
  if (!folder.empty()) {
    json["cache"] = (folder / ViewpointModel::cache_name(model->key())).string();
  }
  json.update(statistics(*model));
  SL_ASSIGN(const NearSymmetries near, find_near_symmetries(mesh, factory));
  json["nearly_symmetric"] = Json::array();
  for (const NearSymmetry& axis : near.axes)
    json["nearly_symmetric"].push_back(to_json(axis, true));
  for (const NearSymmetry& turn : near.turns) {
    json["nearly_symmetric"].push_back(to_json(turn, false));
  }
  if (!options.contact_sheet.empty()) {
    SL_ASSIGN(const auto sheet, draw_contact_sheet(*model, factory));
    SL_RETURN_IF_ERROR(write_png(options.contact_sheet, sheet->view()));
    json["contact_sheet"] = options.contact_sheet.string();
  }
  return json;
}

int model(const ModelOptions& options) {
  const auto made = run(options);
  if (!made) return report(made.error());
  if (options.json) {
    fmt::print("{}\n", made->dump(2));
    return 0;
  }
  for (const auto& [key, value] : made->items()) {
    if (value.is_array()) {
      print_near_symmetries(value);
      continue;
    }
    fmt::print("{:<26} {}\n", key, value.is_string() ? value.get<std::string>() : value.dump());
  }
  return 0;
}

}  // namespace

void add_model(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<ModelOptions>();
  auto* command = app.add_subcommand("model", "make and inspect the viewpoint model of an object");
  command->add_option("FILE", options->file, "object file, or mesh")->required();
  command->add_option("--meters-per-unit", options->meters_per_unit, "of a mesh (default 1)")
      ->check(CLI::PositiveNumber);
  command->add_option("--contact-sheet", options->contact_sheet, "write a contact sheet (PNG)");
  auto* cache_option = command->add_option("--cache", options->cache, "cache folder");
  command->add_flag("--no-cache", options->no_cache, "make it anew, write nothing")
      ->excludes(cache_option);
  command->add_flag("--json", options->json, "as JSON");
  command->callback([options, &chosen] { chosen = [options] { return model(*options); }; });
}

}  // namespace sightline::cli
