// SPDX-License-Identifier: Apache-2.0
// `sightline init`: a first installation file, from the cameras that are there.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "commands.hpp"
#include "init/installation_text.hpp"
#include "init/rig_draft.hpp"
#include "report.hpp"
#include "sightline/base/files.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/geometry/mesh.hpp"

namespace sightline::cli {
namespace {

namespace fs = std::filesystem;

struct InitOptions {
  fs::path out = "sightline.toml";
  CameraWishes wishes;
  std::vector<std::string> sizes;
  std::vector<fs::path> meshes;
  std::string unit;
  bool force = false;
};

struct NewFile {
  fs::path path;
  std::string content;
};

struct Unit {
  const char* name;
  double meters;
};
constexpr Unit kUnits[] = {{"m", 1}, {"cm", 0.01}, {"mm", 0.001}, {"in", 0.0254}};

Status read_sizes(const std::vector<std::string>& texts, std::map<std::string, ImageSize>& sizes) {
  for (const std::string& text : texts) {
    const size_t at = text.find('=');
    const std::string name = at == std::string::npos ? "" : text.substr(0, at);
    const std::string size = at == std::string::npos ? text : text.substr(at + 1);
    ImageSize parsed;
    int end = 0;
    if (std::sscanf(size.c_str(), "%5dx%5d%n", &parsed.width, &parsed.height, &end) != 2 ||
        static_cast<size_t>(end) != size.size() || parsed.width < 1 || parsed.height < 1) {
      return make_error(ErrorCode::kInvalidInput, "--size",
                        "\"{}\" is no size; write 1280x720, or CAMERA=1280x720", text);
    }
    sizes[name] = parsed;
  }
  return {};
}

std::string size_in_words(const TriangleMesh& mesh, double factor) {
  const Eigen::Vector3d sides = (mesh.max_corner - mesh.min_corner).cast<double>() * factor;
  return fmt::format("{:.3g} x {:.3g} x {:.3g} m", sides.x(), sides.y(), sides.z());
}

// A mesh does not say its unit, and no guess is safe: the answers, with what each would mean.
Error unit_question(const fs::path& path, const TriangleMesh& mesh) {
  std::string answers;
  for (const Unit& unit : kUnits) {
    answers +=
        fmt::format("\n  --unit {:<3} it is {}", unit.name, size_in_words(mesh, unit.meters));
  }
  return make_error(ErrorCode::kInvalidInput, path.string(), "in which unit are its coordinates?{}",
                    answers);
}

// Beside the mesh: what an object file names stays in its folder or below.
Status draft_object(const fs::path& path, const InitOptions& options, RigDraft& draft,
                    std::vector<NewFile>& files) {
  MeshOptions as_it_is;
  as_it_is.max_extent = 1e9;
  SL_ASSIGN(const TriangleMesh mesh, read_mesh(path, as_it_is));
  if (options.unit.empty()) return unit_question(path, mesh);
  const auto* const unit = std::find_if(std::begin(kUnits), std::end(kUnits),
                                        [&](const Unit& u) { return options.unit == u.name; });
  MeshOptions scaled;
  scaled.meters_per_unit = unit->meters;
  SL_RETURN_IF_ERROR([&]() -> Status {
    SL_ASSIGN(const TriangleMesh ignored, read_mesh(path, scaled));
    return {};
  }());
  const std::string name = path.stem().string(), size = size_in_words(mesh, unit->meters);
  const fs::path file = fs::path(path).replace_extension(".toml");
  files.push_back({file, object_text(name, path.filename().string(), options.unit, size)});
  draft.objects.push_back(file);
  draft.object_remarks.push_back(fmt::format("{} is {} large.", name, size));
  return {};
}

Status refuse_existing(const std::vector<NewFile>& files) {
  for (const NewFile& file : files) {
    std::error_code error;
    if (!fs::exists(fs::symlink_status(file.path, error))) continue;
    return make_error(ErrorCode::kInvalidInput, file.path.string(),
                      "it is there already; --force replaces it");
  }
  return {};
}

fs::path full_path(const NewFile& file) { return fs::absolute(file.path).lexically_normal(); }

Status refuse_same_path(const std::vector<NewFile>& files) {
  for (size_t i = 0; i < files.size(); ++i) {
    for (size_t k = 0; k < i; ++k) {
      if (full_path(files[i]) != full_path(files[k])) continue;
      return make_error(ErrorCode::kInvalidInput, files[i].path.string(),
                        "two files of that name would be written; choose another --out, or rename "
                        "a mesh");
    }
  }
  return {};
}

// Held to the parser that the daemon uses, before anything is written.
Status check(const fs::path& out, const std::vector<NewFile>& files) {
  InstallationFiles world = InstallationFiles::on_disk();
  const auto fresh = [&files](const fs::path& path) -> const NewFile* {
    const auto found = std::find_if(files.begin(), files.end(), [&](const NewFile& file) {
      return full_path(file) == fs::absolute(path).lexically_normal();
    });
    return found == files.end() ? nullptr : &*found;
  };
  world.is_file = [fresh, on_disk = world.is_file](const fs::path& path) {
    return fresh(path) != nullptr || on_disk(path);
  };
  world.calibration = [fresh, on_disk = world.calibration](
                          const fs::path& path) -> Result<std::vector<CalibratedCamera>> {
    const NewFile* const file = fresh(path);
    return file ? parse_calibration(file->content, path.string()) : on_disk(path);
  };
  world.object = [fresh, on_disk = world.object,
                  is_file = world.is_file](const fs::path& path) -> Result<ObjectDescription> {
    const NewFile* const file = fresh(path);
    return file ? parse_object_file(file->content, path, is_file) : on_disk(path);
  };
  SL_ASSIGN(const Installation ignored, parse_installation(files.back().content, out, world));
  return {};
}

// The installation file is the last: what it names is there before it.
Result<std::vector<NewFile>> draft_files(const InitOptions& options, RigDraft& draft) {
  std::vector<NewFile> files;
  for (const fs::path& mesh : options.meshes) {
    SL_RETURN_IF_ERROR(draft_object(mesh, options, draft, files));
  }
  fs::path calibration = draft.source.value_or("");
  if (!draft.source) {
    std::vector<CalibratedCamera> cameras;
    bool guessed = false;
    for (const DraftCamera& camera : draft.cameras) {
      guessed |= !camera.calibration;
      SL_ASSIGN(CalibratedCamera nominal, nominal_calibration(camera, cameras.size()));
      cameras.push_back(camera.calibration.value_or(nominal));
    }
    calibration = options.out.parent_path() /
                  (options.out.stem().string() + (guessed ? ".guess" : ".cameras") + ".toml");
    std::string content = "# Written by `sightline init`.\n";
    if (guessed) {
      content +=
          "# Cameras with role = \"stream\" have a lens and a place here that somebody "
          "guessed: 58 degrees wide, in a row.\n";
    }
    files.push_back({calibration, content + format_calibration(cameras)});
  }
  files.push_back({options.out, installation_text(draft, options.out, calibration)});
  return files;
}

Status init(InitOptions& options) {
  if (!options.force) SL_RETURN_IF_ERROR(refuse_existing({{options.out, ""}}));
  SL_RETURN_IF_ERROR(read_sizes(options.sizes, options.wishes.sizes));
  SL_ASSIGN(RigDraft draft, draft_rig(options.wishes));
  SL_ASSIGN(const auto files, draft_files(options, draft));
  if (!options.force) SL_RETURN_IF_ERROR(refuse_existing(files));
  SL_RETURN_IF_ERROR(refuse_same_path(files));
  SL_RETURN_IF_ERROR(check(options.out, files));
  for (const NewFile& file : files) {
    SL_RETURN_IF_ERROR(write_file_atomically(file.path, file.content));
    fmt::print("{}\n", file.path.string());
  }
  size_t measure = 0;
  for (const DraftCamera& camera : draft.cameras) measure += camera.calibration ? 1 : 0;
  fmt::print(stderr, "{} cameras, {} of them calibrated, {} objects\n", draft.cameras.size(),
             measure, draft.objects.size());
  for (const std::string& line : draft.left_out) fmt::print(stderr, "left out: {}\n", line);
  return {};
}

}  // namespace

void add_init(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<InitOptions>();
  CameraWishes& wishes = options->wishes;
  CLI::App* command = app.add_subcommand(
      "init", "write a first installation file, from the cameras that are there");
  command->add_option("--out", options->out, "file to write (default: sightline.toml)");
  auto* recording = command->add_option("--recording", wishes.recording,
                                        "cameras, objects and scene of this recording");
  auto* cameras = command->add_option("--camera", wishes.cameras,
                                      "NAME=SOURCE, again for each; instead of what is plugged in");
  command
      ->add_option("--listing", wishes.listing,
                   "what is plugged in at another host: its `sightline cameras --json`")
      ->excludes(recording);
  command->add_option("--size", options->sizes,
                      "[NAME=]WIDTHxHEIGHT: ask the camera for this size");
  command->add_option("--calibration", wishes.calibration, "calibration.toml, where there is one");
  auto* meshes = command->add_option("--mesh", options->meshes,
                                     "write an object file for this mesh, beside it");
  command->add_option("--unit", options->unit, "of the meshes: m, cm, mm, in")
      ->check(CLI::IsMember({"m", "cm", "mm", "in"}))
      ->needs(meshes);
  command->add_flag("--force", options->force, "replace files that are there");
  for (auto* many : {cameras, meshes}) many->take_all();
  command->callback([options, &chosen] {
    chosen = [options] {
      const Status done = init(*options);
      return done ? 0 : report(done.error());
    };
  });
}

}  // namespace sightline::cli
