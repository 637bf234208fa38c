// SPDX-License-Identifier: Apache-2.0
#include "init/installation_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace sightline::cli {
namespace {

namespace fs = std::filesystem;

// What cameras call themselves may hold anything.
std::string remark(const std::string& text) {
  std::string line = toml_text(text);  // valid UTF-8, control characters escaped
  line = line.substr(1, line.size() - 2);
  std::string out = "# ";
  for (size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '\\' && i + 1 < line.size() && (line[i + 1] == '"' || line[i + 1] == '\\')) ++i;
    out += line[i];
  }
  return out + "\n";
}

std::string path_text(const fs::path& path, const fs::path& file) {
  const fs::path folder = fs::absolute(file).parent_path().lexically_normal();
  const fs::path target = fs::absolute(path).lexically_normal();
  const fs::path relative = target.lexically_relative(folder);
  const bool below = !relative.empty() && *relative.begin() != "..";
  return toml_text((below ? relative : target).string());
}

std::string camera_text(const DraftCamera& camera) {
  std::string text = "\n";
  for (const std::string& line : camera.remarks) text += remark(line);
  text += fmt::format("[[camera]]\nname = {}\nsource = {}\n", toml_text(camera.name),
                      toml_text(camera.source));
  if (!camera.recorded_as.empty()) {
    text += fmt::format("recorded_as = {}\n", toml_text(camera.recorded_as));
  }
  text += fmt::format("width = {}\nheight = {}\n", camera.width, camera.height);
  if (camera.rate_hz > 0) text += fmt::format("rate = {}\n", camera.rate_hz);
  if (!camera.format.empty()) text += fmt::format("format = {}\n", toml_text(camera.format));
  if (!camera.calibration) {
    text +=
        "role = \"stream\"          # not calibrated: it is shown, and nothing is measured with "
        "it. Delete this\n                         # line when its calibration is in force\n";
  }
  return text;
}

std::string head(const RigDraft& draft, const fs::path& file, const fs::path& calibration) {
  const bool guessed = std::any_of(draft.cameras.begin(), draft.cameras.end(),
                                   [](const DraftCamera& c) { return !c.calibration; });
  std::string text = fmt::format(
      "# Installation file for sightlined, written by `sightline init`. Check it after each "
      "change:\n#     sightline check {0}\n# and start it:\n#     sightlined --config {0}\n"
      "# Every key that exists is in sightline.example.toml and described in "
      "docs/configuration.md.\n# Relative paths start at the folder of this file.\n\n",
      file.filename().string());
  text += fmt::format("name = {}\n", toml_text(file.stem().string()));
  if (guessed) {
    text += fmt::format(
        "\n# Lenses and places of the cameras. This file holds guesses, good enough to see the "
        "cameras and no more:\n# a camera that measures must be calibrated (docs/calibration.md):\n"
        "#     sightline calibrate target --out target.pdf           # print it\n"
        "#     sightline calibrate capture --config {} --out calibration\n"
        "# then put calibration/calibration.toml here.\n",
        file.filename().string());
  } else {
    text += "\n# Lenses and places of the cameras.\n";
  }
  return text + fmt::format("calibration = {}\n", path_text(calibration, file));
}

std::string objects_text(const RigDraft& draft, const fs::path& file) {
  std::string text = "\n# Objects that are looked for.\n";
  for (const std::string& line : draft.object_remarks) text += remark(line);
  for (const fs::path& object : draft.objects) {
    text += fmt::format("\n[[object]]\nfile = {}\n", path_text(object, file));
  }
  if (draft.objects.empty()) {
    text +=
        "# There is none yet: `sightline init --mesh FILE --unit mm` writes an object file, "
        "or by hand:\n#\n#     [[object]]\n#     file = \"objects/part.toml\"\n";
  }
  text += "\n# Static things that hide objects: meshes in world coordinates.\n";
  if (draft.scene.empty()) return text + "#\n#     [scene]\n#     meshes = [\"scene.obj\"]\n";
  text += "[scene]\nmeshes = [";
  for (size_t i = 0; i < draft.scene.size(); ++i) {
    text += (i > 0 ? ", " : "") + path_text(draft.scene[i], file);
  }
  return text + "]\n";
}

constexpr const char* kServers = R"(
# What is drawn into the streams.
[overlay]
styles = ["circle", "outline", "label", "offscreen"]

# Streams: rtsp://127.0.0.1:8554/CAMERA. Other hosts are let in by another address, with tokens and
# a certificate under [access], or open = true.
[rtsp]
# address = "0.0.0.0"
# port = 8554

# The page, the API and metrics: http://127.0.0.1:8080/. The same holds for its address.
[http]
# address = "0.0.0.0"
# port = 8080

[record]
# enabled = true                       # begins by itself; else by order, on the page
# directory = "/var/lib/sightline"     # must exist
)";

}  // namespace

std::string toml_text(const std::string& text) {
  using Json = nlohmann::json;
  // JSON's escapes are TOML's, but for DEL, which needs none there.
  std::string out;
  for (const char c : Json(text).dump(-1, ' ', false, Json::error_handler_t::replace)) {
    out += c == 0x7f ? std::string("\\u007f") : std::string(1, c);
  }
  return out;
}

std::string installation_text(const RigDraft& draft, const fs::path& file,
                              const fs::path& calibration) {
  std::string text = head(draft, file, calibration);
  text +=
      "\n# Cameras. Names are yours to choose; the stream of a camera is "
      "rtsp://HOST:8554/NAME.\n";
  const auto usb = std::ranges::count_if(
      draft.cameras, [](const DraftCamera& c) { return c.source.starts_with("v4l2:"); });
  if (usb > 1) {
    text +=
        "# Uncompressed USB cameras that share a USB 2 controller do not fit beside "
        "other: format = \"MJPEG\".\n";
  }
  for (const DraftCamera& camera : draft.cameras) text += camera_text(camera);
  if (!draft.left_out.empty()) text += "\n# Found and left out:\n";
  for (const std::string& line : draft.left_out) text += remark("    " + line);
  return text + objects_text(draft, file) + kServers;
}

std::string object_text(const std::string& name, const std::string& mesh, const std::string& unit,
                        const std::string& size) {
  return fmt::format(
      "# Object file, written by `sightline init` (docs/configuration.md, \"Object file\").\n"
      "name = {}                      # in logs, labels and poses\nmesh = {}\n"
      "unit = {}                      # of the mesh; then it is {} large\n\n"
      "# Does it look the same from several sides? Then say so, or its turn is ambiguous:\n"
      "# symmetry = \"axis\"               # turned about symmetry_axis by any angle\n"
      "# symmetry_axis = [0, 0, 1]\n# symmetry = \"discrete\"           # after 1/symmetry_order "
      "of a turn\n# symmetry_order = 2\n\n"
      "# A marker on it is the surest way to find it:\n#\n#     [[fiducial]]\n"
      "#     family = \"tag36h11\"\n#     id = 0\n"
      "#     size = 0.05                  # m, outer edge of the black border\n"
      "#     object_from_fiducial = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n",
      toml_text(name), toml_text(mesh), toml_text(unit), size);
}

}  // namespace sightline::cli
