// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "sightline/base/files.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/config/installation.hpp"

namespace sightline {
namespace {

bool same_but_overlay(CameraConfig a, const CameraConfig& b) {
  a.overlay = b.overlay;
  return a == b;
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

}  // namespace

uint64_t camera_hash(const CalibratedCamera& camera) {
  return content_hash(format_calibration({camera}));
}

bool shows_textures(const Installation& installation) {
  const auto shows = [](const auto& where) {
    return where.overlay.fill && where.overlay.fill_kind == FillKind::kTextured;
  };
  return std::ranges::any_of(installation.cameras, shows) ||
         std::ranges::any_of(installation.virtual_cameras, shows);
}

InstallationChanges compare(const Installation& before, const Installation& after) {
  InstallationChanges changes;
  changes.camera_ids =
      match(before.cameras, after.cameras, name_of_camera, changes.cameras_added,
            changes.cameras_removed, [&](const CameraConfig& old, const CameraConfig& now) {
              if (old == now) return;
              const bool restyled = same_but_overlay(old, now);
              (restyled ? changes.cameras_restyled : changes.cameras_changed).push_back(now.name);
              changes.scene_depth = changes.scene_depth || !same_scene_depth(old, now);
            });
  changes.object_ids =
      match(before.objects, after.objects, name_of_object, changes.objects_added,
            changes.objects_removed, [&](const ObjectConfig& old, const ObjectConfig& now) {
              if (old != now) changes.objects_changed.push_back(now.description.name);
            });
  changes.name = before.name != after.name;
  changes.calibration = before.calibration != after.calibration;
  changes.views = before.virtual_cameras != after.virtual_cameras;
  changes.scene = before.scene != after.scene;
  changes.surfaces = before.render.crease_deg != after.render.crease_deg ||
                     shows_textures(before) != shows_textures(after);
  changes.render = before.render != after.render;
  changes.observe = before.fiducial != after.fiducial || before.detect != after.detect ||
                    before.tracker != after.tracker || before.points != after.points;
  changes.estimator = before.estimator != after.estimator;
  changes.rtsp = before.rtsp != after.rtsp;
  changes.encoder = before.encoder != after.encoder;
  changes.http = before.http != after.http;
  changes.record = before.record != after.record;
  changes.mqtt = before.mqtt != after.mqtt;
  changes.cell = before.cell != after.cell;
  changes.action = before.action != after.action;
  changes.zones = before.zones != after.zones;
  changes.watch = before.watch != after.watch;
  changes.daemon = before.daemon != after.daemon;
  return changes;
}

bool InstallationChanges::none() const { return *this == InstallationChanges{}; }

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
  const std::pair<bool, const char*> sections[] = {{name, "name"},
                                                   {scene_depth, "scene depth"},
                                                   {calibration, "calibration file"},
                                                   {views, "virtual cameras"},
                                                   {scene, "scene"},
                                                   {surfaces, "surfaces of meshes"},
                                                   {render, "overlay backend, font and depth"},
                                                   {observe, "observe"},
                                                   {estimator, "estimator"},
                                                   {rtsp, "rtsp"},
                                                   {encoder, "encoder"},
                                                   {http, "http"},
                                                   {record, "record"},
                                                   {mqtt, "mqtt"},
                                                   {cell, "cell"},
                                                   {action, "action"},
                                                   {watch, "watch"},
                                                   {zones, "zones"},
                                                   {daemon, "daemon"}};
  for (const auto& [changed, section] : sections) {
    if (changed) parts.emplace_back(section);
  }
  return parts.empty() ? "nothing" : fmt::format("{}", fmt::join(parts, "; "));
}

}  // namespace sightline
