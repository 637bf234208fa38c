// SPDX-License-Identifier: Apache-2.0
#include "system/overlay_overrides.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "sightline/config/overlay_keys.hpp"

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

// Calls visit(name, style, is_view) for all that is drawn into.
template <typename Installations, typename Visit>
void for_each_style(Installations& installation, const Visit& visit) {
  for (auto& camera : installation.cameras) {
    if (streams(camera.role)) visit(camera.name, camera.overlay, false);
  }
  for (auto& view : installation.virtual_cameras) visit(view.name, view.overlay, true);
}

Json style_json(const OverlayStyle& style) {
  Json json = Json::object();
  for (const auto& [key, value] : overlay_keys(style)) {
    std::visit([&, &name = key](const auto& v) { json[name] = v; }, value);
  }
  return json;
}

template <typename Names>
Json names_json(const Names& names) {
  Json json = Json::array();
  for (const std::string_view name : names) json.push_back(name);
  return json;
}

}  // namespace

void OverlayOverrides::note_file(const Installation& as_read) {
  auto styles = std::make_shared<Styles>();
  for_each_style(as_read, [&](const std::string& name, const OverlayStyle& style, bool) {
    styles->emplace(name, style);
  });
  in_file_.publish(std::move(styles));
}

void OverlayOverrides::carry_over(const Installation& running, Installation& next) const {
  const auto before = in_file_.read();
  Styles chosen;
  for_each_style(running, [&](const std::string& name, const OverlayStyle& style, bool) {
    chosen.emplace(name, style);
  });
  for_each_style(next, [&](const std::string& name, OverlayStyle& style, bool) {
    const auto known = before->find(name);
    const auto found = chosen.find(name);
    if (known == before->end() || found == chosen.end() || known->second != style) return;
    style = found->second;
  });
}

Status OverlayOverrides::change(const OverlayRequest& request, Installation& installation) const {
  Status result;
  bool any = false;
  Installation changed = installation;
  for_each_style(changed, [&](const std::string& name, OverlayStyle& style, bool is_view) {
    if (!result || (!request.camera.empty() && request.camera != name)) return;
    any = true;
    const OverlayStyle before = style;
    result = apply_overlay_keys(request.keys, style);
    // A theme for all is one for cameras: in a view an object is a body among others.
    const bool theme = request.keys.find("\"theme\" = ") != std::string::npos;
    if (result && is_view && request.camera.empty() && theme && style != before) {
      style = virtual_camera_style(style);
    }
  });
  if (!any) {
    return make_error(ErrorCode::kNotFound, request.camera,
                      "there is no camera of that name that streams");
  }
  if (!result) {
    Error error = result.error();
    error.where.clear();  // a place in what the client never wrote
    return error;
  }
  installation = std::move(changed);
  return {};
}

void OverlayOverrides::reset(Installation& installation) const {
  const auto in_file = in_file_.read();
  for_each_style(installation, [&](const std::string& name, OverlayStyle& style, bool) {
    const auto known = in_file->find(name);
    if (known != in_file->end()) style = known->second;
  });
}

std::string OverlayOverrides::json(const Installation& running) const {
  const auto in_file = in_file_.read();
  std::vector<std::string_view> marks;
  for (const std::string_view name : style_names()) {
    if (!is_overlay_key(name)) marks.push_back(name);
  }
  Json json{{"themes", names_json(theme_names())},
            {"styles", names_json(marks)},
            {"cameras", Json::array()}};
  for_each_style(running, [&](const std::string& name, const OverlayStyle& style, bool is_view) {
    const auto known = in_file->find(name);
    json["cameras"].push_back({{"name", name},
                               {"virtual", is_view},
                               {"as_in_file", known != in_file->end() && known->second == style},
                               {"overlay", style_json(style)}});
  });
  return json.dump(2) + "\n";
}

}  // namespace sightline
