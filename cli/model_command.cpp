// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "contact_sheet.hpp"
#include "mesh_depth_renderer.hpp"
#include "object_views.hpp"
#include "report.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/record/overlay_video.hpp"

namespace sightline::cli {
namespace {

using Json = nlohmann::ordered_json;

double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

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
  float least_area = INFINITY, largest_area = 0;
  for (size_t i = 0; i < model.size(); ++i) {
    const View view = model.view(i);
    contour += view.contour.size();
    fewest = std::min(fewest, view.contour.size());
    edges += view.edges.size();
    for (const InnerEdgeSample& edge : view.edges) creases += edge.crease;
    least_area = std::min(least_area, view.area);
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
              {"silhouette_least_cm2", 1e4 * double{least_area}},
              {"silhouette_largest_cm2", 1e4 * double{largest_area}}};
}

Result<Json> run(const ModelOptions& options) {
  SL_ASSIGN(const TriangleMesh mesh, load(options));
  const auto render_mesh = std::make_shared<const RenderMesh>(make_render_mesh(mesh));
  const DepthRendererFactory factory = mesh_depth_renderer_factory(render_mesh);
  const ViewpointModelOptions model_options;
  const auto folder = options.no_cache        ? std::filesystem::path()
                      : options.cache.empty() ? cache_folder()
                                              : options.cache;
  const double start = cpu_ms();
  SL_ASSIGN(const auto model, ViewpointModel::load_or_build(mesh, factory, model_options, folder));
  Json json{{"file", options.file.string()}, {"faces", mesh.faces.size()}};
  json["cpu_ms"] = std::round(cpu_ms() - start);
  if (!folder.empty()) {
    json["cache"] = (folder / ViewpointModel::cache_name(model->key())).string();
  }
  json.update(statistics(*model));
  if (!options.sheet.empty()) {
    SL_ASSIGN(const auto sheet, draw_contact_sheet(*model, factory));
    SL_RETURN_IF_ERROR(write_png(options.sheet, sheet->view()));
    json["sheet"] = options.sheet.string();
  }
  return json;
}

}  // namespace

int model(const ModelOptions& options) {
  const auto made = run(options);
  if (!made) return report(made.error());
  if (options.json) {
    fmt::print("{}\n", made->dump(2));
    return 0;
  }
  for (const auto& [key, value] : made->items()) {
    fmt::print("{:<26} {}\n", key, value.is_string() ? value.get<std::string>() : value.dump());
  }
  return 0;
}

}  // namespace sightline::cli
