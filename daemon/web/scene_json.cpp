// SPDX-License-Identifier: Apache-2.0
#include "web/scene_json.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "system/system_status.hpp"
#include "web/mesh_bytes.hpp"

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kMostSceneFaces = 2'000'000;

Json numbers(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json pose_json(const Rigid3& pose) {
  const auto& q = pose.rotation;
  return {{"translation_m", numbers(pose.translation)},
          {"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}}};
}

// Unit rays of the corners, clockwise from the top left; the middle where a lens does not see them.
Json corners_json(const CameraModel& lens) {
  Json corners = Json::array();
  const double right = lens.width() - 0.5, bottom = lens.height() - 0.5;
  for (const auto& [x, y] : {std::pair(-0.5, -0.5), std::pair(right, -0.5),
                             std::pair(right, bottom), std::pair(-0.5, bottom)}) {
    const auto ray = lens.unproject({x, y});
    corners.push_back(numbers(ray.value_or(Eigen::Vector3d::UnitZ())));
  }
  return corners;
}

Json box_json(const Box3& box) { return {{"min", numbers(box.min)}, {"max", numbers(box.max)}}; }

size_t faces_of(const std::vector<RenderMesh>& meshes) {
  size_t faces = 0;
  for (const RenderMesh& mesh : meshes) faces += mesh.faces.size();
  return faces;
}

HttpReply bytes_reply(std::string bytes) {
  return {200, "application/octet-stream", std::move(bytes)};
}

}  // namespace

std::string scene_json(const System& system) {
  const Installation& now = system.installation;
  Json json{{"calibration", feed_names(system).calibration},
            {"content", now.content},
            {"cameras", Json::array()},
            {"objects", Json::array()},
            {"zones", Json::array()}};
  for (const CameraConfig& camera : now.cameras) {
    json["cameras"].push_back(
        {{"name", camera.name},
         {"width", camera.calibration.model.width()},
         {"height", camera.calibration.model.height()},
         {"world_from_camera", pose_json(camera.calibration.world_from_camera)},
         {"corners", corners_json(camera.calibration.model)}});
  }
  const std::shared_ptr<const Rig> rig = system.rig;  // null while the system is being started
  for (size_t i = 0; rig && i < rig->objects.size(); ++i) {
    const RigObject& object = rig->objects[i];
    const RenderMesh& mesh = *object.mesh;
    json["objects"].push_back({{"name", object.named.name},
                               {"triangles", shown_level(*object.levels).faces.size()},
                               {"center_m", numbers(mesh.center.cast<double>())},
                               {"radius_m", mesh.radius}});
  }
  json["scene_triangles"] = rig ? faces_of(*rig->scene) : size_t{0};
  if (now.scene.volume) json["volume"] = box_json(*now.scene.volume);
  for (const ZoneConfig& zone : now.zones) {
    Json box = box_json(zone.box);
    box["name"] = zone.name;
    json["zones"].push_back(std::move(box));
  }
  return json.dump() + "\n";
}

std::string points_json(const System& system) {
  const Time now = MonotonicClock::now();
  const auto points = system.points ? system.points->points_at(now) : nullptr;
  Json json{{"points_m", Json::array()}, {"kinds", Json::array()}};
  if (!points) return json.dump() + "\n";
  json["t_ns"] = to_ns(points->time);
  json["utc_ns"] = utc_ns_of(points->time);
  const auto tenth_mm = [](double v) { return std::round(v * 1e4) / 1e4; };
  for (const ScenePoint& point : points->points) {
    const Eigen::Vector3d& p = point.point_in_world;
    json["points_m"].push_back({tenth_mm(p.x()), tenth_mm(p.y()), tenth_mm(p.z())});
    json["kinds"].push_back(to_string(point.kind));
  }
  return json.dump() + "\n";
}

HttpReply object_mesh_reply(const System& system, const std::string& object) {
  if (!system.rig) return HttpReply::error(503, "the system is being started; try again");
  const auto& objects = system.rig->objects;
  const auto found = std::ranges::find(
      objects, object, [](const RigObject& one) -> const std::string& { return one.named.name; });
  if (found == objects.end()) return HttpReply::error(404, "there is no object of that name");
  const RenderMesh* const mesh = &shown_level(*found->levels);
  return bytes_reply(mesh_bytes({&mesh, 1}));
}

HttpReply scene_mesh_reply(const System& system) {
  if (!system.rig) return HttpReply::error(503, "the system is being started; try again");
  const std::vector<RenderMesh>& meshes = *system.rig->scene;
  if (meshes.empty()) return HttpReply::error(404, "this installation has no static scene");
  const size_t all = faces_of(meshes);
  if (all > kMostSceneFaces) {
    return HttpReply::error(
        503,
        fmt::format("the static scene has {} triangles; up to {} are shown", all, kMostSceneFaces));
  }
  std::vector<LevelOfDetail> levels;
  std::vector<const RenderMesh*> shown;
  for (const RenderMesh& mesh : meshes) {
    if (all > kShownFaces) {
      // Shared with nobody: it outlives the levels.
      levels.emplace_back(std::shared_ptr<const RenderMesh>(std::shared_ptr<void>(), &mesh));
      shown.push_back(&shown_level(levels.back()));
    } else {
      shown.push_back(&mesh);
    }
  }
  return bytes_reply(mesh_bytes(shown));
}

}  // namespace sightline
