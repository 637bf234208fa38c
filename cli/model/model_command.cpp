// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <span>
#include <string>
#include <vector>

#include "commands.hpp"
#include "model/contact_sheet.hpp"
#include "model/symmetry_sheet.hpp"
#include "report.hpp"
#include "sightline/base/time.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/observe/shape/near_symmetry.hpp"
#include "sightline/pipeline/mesh_color_renderer.hpp"
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
  std::filesystem::path symmetries;     ///< picture of near symmetries (PNG); empty: none
  bool json = false;
};

constexpr int kListSide = 128, kSheetSide = 160, kMapSide = 64;  // pictures to compare [px]

using Json = nlohmann::ordered_json;

struct LoadedMesh {
  TriangleMesh shape;
  std::shared_ptr<const RenderMesh> painted;
};

Result<LoadedMesh> load(const ModelOptions& options) {
  std::filesystem::path file = options.file;
  MeshOptions mesh;
  mesh.meters_per_unit = options.meters_per_unit;
  if (file.extension() == ".toml") {
    SL_ASSIGN(const ObjectDescription object, read_object_file(file));
    mesh.meters_per_unit = object.meters_per_unit;
    file = object.mesh;
  }
  SL_ASSIGN(TriangleMesh shape, read_mesh(file, mesh));
  SL_ASSIGN(auto painted, read_painted_mesh(shape, file, mesh));
  return LoadedMesh{std::move(shape), std::move(painted)};
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

Json to_json(const ListedSymmetry& listed, size_t row) {
  const NearSymmetry& symmetry = listed.symmetry;
  const double degrees = std::round(symmetry.turn.angle() * 180 / std::numbers::pi);
  Json json{{"row", row},
            {"axis", to_json(symmetry.turn.axis())},
            {"turn_deg", degrees},
            {"any_turn", listed.turns.size() > 1},
            {"silhouette_differs_percent", percent(symmetry.mean.silhouette)},
            {"surface_differs_percent", percent(symmetry.mean.surface)},
            {"least_percent", percent(symmetry.least)},
            {"hidden_from", to_json(symmetry.hides)},
            {"most_percent", percent(symmetry.most)},
            {"shown_from", to_json(symmetry.shows)}};
  json["broken_by"] = {{"mean_percent", percent(listed.broken_by.mean)},
                       {"least_percent", percent(listed.broken_by.least)},
                       {"hidden_from", to_json(listed.broken_by.hidden_from)},
                       {"most_percent", percent(listed.broken_by.most)},
                       {"of_it_color_percent", percent(listed.broken_by.color)},
                       {"shown_from", to_json(listed.broken_by.shown_from)}};
  if (listed.broken_by.centroid) {
    json["broken_by"]["centroid_mm"] = to_json(1e3 * *listed.broken_by.centroid);
  }
  return json;
}

// Near symmetries and what breaks them, in two lines each.
void print_near_symmetries(const Json& symmetries) {
  for (const Json& s : symmetries) {
    const Json& by = s["broken_by"];
    fmt::print(
        "nearly symmetric, row {:<4}  {}{:.0f} deg about {}: {:.1f} % of the silhouette "
        "differ, {:.1f} % of the surface\n",
        s["row"].get<int>(), s["any_turn"] ? "every turn; at most " : "",
        s["turn_deg"].get<double>(), s["axis"].dump(),
        s["silhouette_differs_percent"].get<double>(), s["surface_differs_percent"].get<double>());
    fmt::print(
        "{:<26} broken by {:.1f} % of what is seen from {} (color alone {:.1f} %){}, by "
        "{:.1f} % from {}\n",
        "", by["most_percent"].get<double>(), by["shown_from"].dump(),
        by["of_it_color_percent"].get<double>(),
        by.contains("centroid_mm") ? ", around " + by["centroid_mm"].dump() + " mm" : "",
        by["least_percent"].get<double>(), by["hidden_from"].dump());
  }
}

// The turns that count as others about an axis: as in the estimator, what is near is no other pose.
std::vector<Rigid3> other_turns(const NearSymmetry& axis) {
  constexpr double kLeast = 29.0 * std::numbers::pi / 180;
  std::vector<Rigid3> turns =
      near_rotations_of({{}, {axis}}, SIZE_MAX, [](const Rigid3&) { return false; });
  std::erase_if(
      turns, [](const Rigid3& turn) { return Eigen::AngleAxisd(turn.rotation).angle() < kLeast; });
  return turns;
}

std::vector<ListedSymmetry> list_symmetries(const NearSymmetries& near,
                                            SymmetryComparer& comparer) {
  std::vector<ListedSymmetry> out;
  for (const NearSymmetry& axis : near.axes) out.push_back({axis, other_turns(axis), {}});
  for (const NearSymmetry& turn : near.turns) out.push_back({turn, {turn.transform}, {}});
  for (ListedSymmetry& listed : out) listed.broken_by = comparer.from_all_sides(listed.turns);
  return out;
}

Result<SymmetryComparer> comparer_of(const LoadedMesh& mesh, int side) {
  const RenderMesh& shape = *mesh.painted;
  return SymmetryComparer::create(
      shape.center.cast<double>(), double{shape.radius}, side,
      mesh_depth_renderer_factory(mesh.painted),
      shape.paint.empty() ? ColorRendererFactory() : mesh_color_renderer_factory(mesh.painted));
}

Status write_symmetry_sheet(const LoadedMesh& mesh, std::span<const ListedSymmetry> symmetries,
                            const std::filesystem::path& file) {
  if (symmetries.empty()) {
    return make_error(ErrorCode::kInvalidInput, file.string(),
                      "nothing to draw: no turn of the object looks nearly the same");
  }
  SL_ASSIGN(SymmetryComparer comparer, comparer_of(mesh, kSheetSide));
  SL_ASSIGN(SymmetryComparer coarse, comparer_of(mesh, kMapSide));
  SL_ASSIGN(const auto sheet, draw_symmetry_sheet(symmetries, comparer, coarse));
  return write_png(file, sheet->view());
}

Result<Json> run(const ModelOptions& options) {
  SL_ASSIGN(const LoadedMesh loaded, load(options));
  const TriangleMesh& mesh = loaded.shape;
  const DepthRendererFactory factory = mesh_depth_renderer_factory(loaded.painted);
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
  SL_ASSIGN(SymmetryComparer comparer, comparer_of(loaded, kListSide));
  const std::vector<ListedSymmetry> symmetries = list_symmetries(near, comparer);
  json["nearly_symmetric"] = Json::array();
  for (const ListedSymmetry& symmetry : symmetries) {
    json["nearly_symmetric"].push_back(to_json(symmetry, json["nearly_symmetric"].size() + 1));
  }
  if (!options.symmetries.empty()) {
    SL_RETURN_IF_ERROR(write_symmetry_sheet(loaded, symmetries, options.symmetries));
    json["symmetries"] = options.symmetries.string();
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
  command->add_option("--symmetries", options->symmetries,
                      "write a picture of near symmetries and what breaks them (PNG)");
  auto* cache_option = command->add_option("--cache", options->cache, "cache folder");
  command->add_flag("--no-cache", options->no_cache, "make it anew, write nothing")
      ->excludes(cache_option);
  command->add_flag("--json", options->json, "as JSON");
  command->callback([options, &chosen] { chosen = [options] { return model(*options); }; });
}

}  // namespace sightline::cli
