// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "sections.hpp"
#include "sightline/config/installation.hpp"

namespace sightline {
namespace {

// Writes the fields of a section down; two sections are equal if their texts are.
class SectionPrinter {
 public:
  std::string text_out;

  void flag(std::string_view key, bool field) { put(key, field); }
  template <typename Field>
  void integer(std::string_view key, Field field, int64_t, int64_t, std::string_view) {
    put(key, static_cast<int64_t>(field));
  }
  template <typename Field>
  void number(std::string_view key, Field field, double, double, std::string_view) {
    put(key, field);
  }
  template <typename Allowed>
  void number_of(std::string_view key, double field, const Allowed&) {
    put(key, field);
  }
  void text(std::string_view key, const std::string& field) { put(key, field); }
  void file(std::string_view key, const std::filesystem::path& field) { put(key, field.string()); }
  void directory(std::string_view key, const std::filesystem::path& field) {
    put(key, field.string());
  }
  template <typename Value, typename Known>
  void choice(std::string_view key, Value field, const Known&) {
    put(key, static_cast<int>(field));
  }
  void seconds(std::string_view key, Duration field, double, double) { put(key, field.count()); }
  template <typename Value>
  void controls(std::string_view key, const std::map<std::string, Value>& field) {
    for (const auto& [name, value] : field) {
      const std::string full = fmt::format("{}.{}", key, name);
      std::visit([&](const auto& v) { put(full, v); }, value);
    }
  }
  void point(std::string_view key, const std::optional<Eigen::Vector3d>& field) {
    if (field) direction(key, *field);
  }
  void direction(std::string_view key, const Eigen::Vector3d& v) {
    put(key, fmt::format("{} {} {}", v.x(), v.y(), v.z()));
  }
  void color(std::string_view key, Rgb c) { put(key, fmt::format("{} {} {}", c.r, c.g, c.b)); }
  /// Where the other keys start from; they say it all.
  void theme(std::string_view, const OverlayStyle&) {}
  void styles(std::string_view key, OverlayStyle& style) {
    for (const std::string_view name : style_names()) put(key, *style_flag(style, name));
  }
  void encoders(std::string_view key, const std::vector<std::string>& field) {
    put(key, fmt::format("{}", fmt::join(field, " ")));
  }

 private:
  template <typename Value>
  void put(std::string_view key, const Value& value) {
    fmt::format_to(std::back_inserter(text_out), "{}={}\n", key, value);
  }
};

template <typename Section>
bool differ(Section a, Section b) {
  SectionPrinter first, second;
  config::visit(first, a);
  config::visit(second, b);
  return first.text_out != second.text_out;
}

bool same_pose(const Rigid3& a, const Rigid3& b) {
  return a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}

bool same_calibration(const CalibratedCamera& a, const CalibratedCamera& b) {
  const CameraModel::Parameters &p = a.model.parameters(), &q = b.model.parameters();
  return a.name == b.name && p.lens == q.lens && p.width == q.width && p.height == q.height &&
         p.fx == q.fx && p.fy == q.fy && p.cx == q.cx && p.cy == q.cy &&
         p.distortion == q.distortion && same_pose(a.world_from_camera, b.world_from_camera) &&
         a.rms_px == b.rms_px;
}

bool same_source(const CameraConfig& a, const CameraConfig& b) {
  return a.source == b.source && a.network.url == b.network.url && a.aravis.id == b.aravis.id &&
         a.v4l2.device == b.v4l2.device && a.libcamera.id == b.libcamera.id &&
         !differ(a.network, b.network) && !differ(a.aravis, b.aravis) && !differ(a.v4l2, b.v4l2) &&
         !differ(a.libcamera, b.libcamera);
}

bool same_camera(const CameraConfig& a, const CameraConfig& b) {
  return same_source(a, b) && a.recording == b.recording && a.recorded_as == b.recorded_as &&
         a.scene_depth == b.scene_depth && a.scene_depth_scale == b.scene_depth_scale &&
         a.scene_depth_content == b.scene_depth_content && a.loop == b.loop &&
         a.rate_hz == b.rate_hz && a.role == b.role && a.gamma == b.gamma &&
         same_calibration(a.calibration, b.calibration);
}

// The hash covers everything that the files say; the rest is which files they are.
bool same_object(const ObjectConfig& a, const ObjectConfig& b) {
  return a.content == b.content && a.description.file == b.description.file &&
         a.description.mesh == b.description.mesh;
}

template <typename List, typename NameOf>
auto find_by_name(const List& list, const std::string& name, NameOf name_of) {
  return std::find_if(list.begin(), list.end(),
                      [&](const auto& entry) { return name_of(entry) == name; });
}

const std::string& name_of_camera(const CameraConfig& camera) { return camera.name; }
const std::string& name_of_object(const ObjectConfig& object) { return object.description.name; }

// Calls both(old, new) for entries that stay; tells whether one of them has another index now.
template <typename List, typename NameOf, typename Both>
bool match(const List& before, const List& after, NameOf name_of, std::vector<std::string>& added,
           std::vector<std::string>& removed, Both both) {
  bool moved = false;
  for (auto now = after.begin(); now != after.end(); ++now) {
    const auto old = find_by_name(before, name_of(*now), name_of);
    if (old == before.end()) {
      added.push_back(name_of(*now));
      continue;
    }
    moved = moved || old - before.begin() != now - after.begin();
    both(*old, *now);
  }
  for (const auto& old : before) {
    if (find_by_name(after, name_of(old), name_of) == after.end()) removed.push_back(name_of(old));
  }
  return moved;
}

bool same_views(const std::vector<ViewConfig>& a, const std::vector<ViewConfig>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const ViewConfig& x, const ViewConfig& y) {
                      return x.name == y.name && !differ(x, y) && !differ(x.overlay, y.overlay) &&
                             same_calibration(x.view, y.view);
                    });
}

bool same_scene(const SceneConfig& a, const SceneConfig& b) {
  return a.meshes == b.meshes && a.meters_per_unit == b.meters_per_unit && a.content == b.content &&
         a.learn == b.learn;
}

}  // namespace

bool shows_textures(const Installation& installation) {
  const auto shows = [](const auto& where) {
    return where.overlay.fill && where.overlay.fill_kind == FillKind::kTextured;
  };
  return std::ranges::any_of(installation.cameras, shows) ||
         std::ranges::any_of(installation.views, shows);
}

InstallationChanges compare(const Installation& before, const Installation& after) {
  InstallationChanges changes;
  changes.camera_ids =
      match(before.cameras, after.cameras, name_of_camera, changes.cameras_added,
            changes.cameras_removed, [&](const CameraConfig& old, const CameraConfig& now) {
              if (!same_camera(old, now)) {
                changes.cameras_changed.push_back(now.name);
              } else if (differ(old.overlay, now.overlay)) {
                changes.cameras_restyled.push_back(now.name);
              }
            });
  changes.object_ids =
      match(before.objects, after.objects, name_of_object, changes.objects_added,
            changes.objects_removed, [&](const ObjectConfig& old, const ObjectConfig& now) {
              if (!same_object(old, now)) changes.objects_changed.push_back(now.description.name);
            });
  changes.views = !same_views(before.views, after.views);
  changes.scene = !same_scene(before.scene, after.scene);
  changes.surfaces = before.render.crease_deg != after.render.crease_deg ||
                     shows_textures(before) != shows_textures(after);
  changes.render = differ(before.render, after.render);
  changes.observe = differ(before.observe, after.observe) || differ(before.detect, after.detect) ||
                    differ(before.points, after.points);
  changes.estimator = differ(before.estimator, after.estimator);
  changes.rtsp = differ(before.rtsp, after.rtsp);
  changes.encoder = differ(before.encoder, after.encoder);
  changes.http = differ(before.http, after.http);
  changes.record = differ(before.record, after.record);
  changes.action = differ(before.action, after.action);
  changes.daemon = differ(before.daemon, after.daemon);
  return changes;
}

bool InstallationChanges::none() const {
  return cameras_added.empty() && cameras_removed.empty() && cameras_changed.empty() &&
         cameras_restyled.empty() && objects_added.empty() && objects_removed.empty() &&
         objects_changed.empty() && !views && !camera_ids && !object_ids && !scene && !surfaces &&
         !render && !observe && !estimator && !rtsp && !encoder && !http && !record && !action &&
         !daemon;
}

std::string InstallationChanges::summary() const {
  std::vector<std::string> parts;
  const auto names = [&parts](const char* what, const std::vector<std::string>& list) {
    if (!list.empty()) parts.push_back(fmt::format("{} {}", what, fmt::join(list, ", ")));
  };
  names("new camera", cameras_added);
  names("removed camera", cameras_removed);
  names("changed camera", cameras_changed);
  names("overlay of", cameras_restyled);
  names("new object", objects_added);
  names("removed object", objects_removed);
  names("changed object", objects_changed);
  if (camera_ids) parts.emplace_back("order of cameras");
  if (object_ids) parts.emplace_back("order of objects");
  const std::pair<bool, const char*> sections[] = {{views, "views"},
                                                   {scene, "scene"},
                                                   {surfaces, "surfaces of meshes"},
                                                   {render, "overlay backend, font and depth"},
                                                   {observe, "observe"},
                                                   {estimator, "estimator"},
                                                   {rtsp, "rtsp"},
                                                   {encoder, "encoder"},
                                                   {http, "http"},
                                                   {record, "record"},
                                                   {action, "action"},
                                                   {daemon, "daemon"}};
  for (const auto& [changed, name] : sections) {
    if (changed) parts.emplace_back(name);
  }
  return parts.empty() ? "nothing" : fmt::format("{}", fmt::join(parts, "; "));
}

}  // namespace sightline
