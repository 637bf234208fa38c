// SPDX-License-Identifier: Apache-2.0
#include "sightline/config/object_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "config/names.hpp"
#include "config/toml_reader.hpp"
#include "sightline/base/files.hpp"
#include "sightline/observe/fiducial/fiducial_observer.hpp"

namespace sightline {
namespace {

using config::PlacedText;
using config::TomlTable;

constexpr double kSmallestMarker = 1e-3;  // [m]
constexpr double kLargestMarker = 10;     // [m]
constexpr std::string_view kMeters = "a length in meters";

std::optional<double> length(TomlTable& table, std::string_view key) {
  if (!table.require(key, "a length in meters, as in 0.05")) return std::nullopt;
  return table.number(key, kSmallestMarker, kLargestMarker, kMeters);
}

void check_known(TomlTable& table, std::string_view key, const std::string& word,
                 const std::vector<std::string>& known) {
  if (std::find(known.begin(), known.end(), word) != known.end()) return;
  table.problem(key, fmt::format("\"{}\" is not known{}", word, config::suggestion(word, known)));
}

void read_symmetry(TomlTable& root, ObjectDescription& object) {
  if (const auto kind = root.text("symmetry")) {
    if (kind->text == "none") {
      object.symmetry = Symmetry::kNone;
    } else if (kind->text == "axis") {
      object.symmetry = Symmetry::kAxis;
    } else if (kind->text == "discrete") {
      object.symmetry = Symmetry::kDiscrete;
    } else {
      root.problem("symmetry", "expected \"none\", \"axis\" or \"discrete\"");
    }
  }
  if (const auto axis = root.numbers("symmetry_axis", 3)) {
    const Eigen::Vector3d direction(axis->data());
    if (direction.norm() > 1e-6 && direction.norm() < 1e6) {
      object.symmetry_axis = direction.normalized();
    } else {
      root.problem("symmetry_axis", "expected a direction, as in [0, 0, 1]");
    }
  }
  if (object.symmetry == Symmetry::kDiscrete) {
    root.require("symmetry_order", "how often it looks the same in one turn, as in 4");
  }
  if (const auto order = root.integer("symmetry_order", 2, 360, "a whole number of turns")) {
    object.symmetry_order = static_cast<int>(*order);
    if (object.symmetry != Symmetry::kDiscrete) {
      root.problem("symmetry_order", "goes with symmetry = \"discrete\"");
    }
  }
}

bool* modality_flag(Modalities& modalities, std::string_view name) {
  if (name == "fiducial") return &modalities.fiducial;
  if (name == "region") return &modalities.region;
  if (name == "edge") return &modalities.edge;
  if (name == "texture") return &modalities.texture;
  return nullptr;
}

// Without the key: markers alone where there are any, else the object's look.
void read_modalities(TomlTable& root, ObjectDescription& object) {
  const bool marked = object.board.has_value() || !object.fiducials.empty();
  const auto names = root.texts("modalities");
  if (!names) {
    object.modalities = {marked, !marked, !marked, !marked};
    return;
  }
  object.modalities = {false, false, false, false};
  for (const PlacedText& name : *names) {
    bool* const flag = modality_flag(object.modalities, name.text);
    if (flag != nullptr) {
      *flag = true;
    } else {
      root.problem(
          "modalities",
          fmt::format("\"{}\" is not known; known: fiducial, region, edge, texture", name.text));
    }
  }
}

Fiducial read_fiducial(TomlTable table, const std::vector<std::string>& families) {
  Fiducial fiducial;
  if (table.require("family", "for example \"tag36h11\"")) {
    if (const auto family = table.text("family")) {
      fiducial.family = family->text;
      check_known(table, "family", family->text, families);
    }
  }
  if (table.require("id", "the number of the marker in its family")) {
    const auto id = table.integer("id", 0, 1'000'000, "a marker's number");
    fiducial.id = static_cast<int>(id.value_or(0));
  }
  fiducial.size = length(table, "size").value_or(kSmallestMarker);
  if (table.require("object_from_fiducial", "4 rows of 4 numbers, meters")) {
    if (const auto matrix = table.matrix("object_from_fiducial")) {
      auto pose = Rigid3::from_matrix(*matrix, "");
      if (pose) {
        fiducial.object_from_fiducial = *pose;
      } else {
        table.problem("object_from_fiducial", pose.error().text);
      }
    }
  }
  table.finish();
  return fiducial;
}

void read_fiducials(TomlTable& root, ObjectDescription& object) {
  const std::vector<std::string> families = known_fiducial_families();
  std::set<std::pair<std::string, int>> seen;
  for (TomlTable& table : root.tables("fiducial")) {
    object.fiducials.push_back(read_fiducial(table, families));
    const Fiducial& fiducial = object.fiducials.back();
    if (fiducial.family.empty()) continue;
    if (!seen.emplace(fiducial.family, fiducial.id).second) {
      table.problem("id", fmt::format("{} {} stands here twice: an object has each marker once",
                                      fiducial.family, fiducial.id));
    }
  }
}

void read_board(TomlTable& root, ObjectDescription& object) {
  auto table = root.table("board");
  if (!table) return;
  CharucoBoard board;
  if (table->require("type", "\"charuco\"")) {
    const auto type = table->text("type");
    if (type && type->text != "charuco") table->problem("type", "expected \"charuco\"");
  }
  for (const auto& [key, field] :
       {std::pair{"columns", &CharucoBoard::columns}, std::pair{"rows", &CharucoBoard::rows}}) {
    if (!table->require(key, "the number of squares")) continue;
    board.*field = static_cast<int>(table->integer(key, 2, 100, "a number of squares").value_or(2));
  }
  const auto square = length(*table, "square"), marker = length(*table, "marker");
  board.square = square.value_or(kLargestMarker);
  board.marker = marker.value_or(kSmallestMarker);
  if (square && marker && *marker >= *square) {
    table->problem("marker",
                   fmt::format("a marker ({} m) lies inside a square ({} m)", *marker, *square));
  }
  if (table->require("dictionary", "for example \"4X4_50\"")) {
    if (const auto dictionary = table->text("dictionary")) {
      board.dictionary = dictionary->text;
      check_known(*table, "dictionary", dictionary->text, known_board_dictionaries());
    }
  }
  board.inverted = table->flag("inverted").value_or(false);
  table->finish();
  object.board = board;
}

void read_mesh_entry(TomlTable& root, const std::filesystem::path& path,
                     const std::function<bool(const std::filesystem::path&)>& is_file,
                     ObjectDescription& object) {
  if (root.require("mesh", "the file of the object's shape, as in \"carton.obj\"")) {
    if (const auto mesh = root.text("mesh")) {
      object.mesh = config::resolve(path, mesh->text);
      if (!is_file(object.mesh)) {
        root.problem("mesh", fmt::format("there is no file {}", object.mesh.string()),
                     ErrorCode::kNotFound);
      }
    }
  }
  if (root.require("unit", "the unit of the mesh: \"m\", \"cm\", \"mm\" or \"in\"")) {
    if (const auto unit = root.text("unit")) {
      const auto meters = config::meters_per_unit(unit->text);
      if (meters) {
        object.meters_per_unit = *meters;
      } else {
        root.problem("unit", fmt::format("expected \"m\", \"cm\", \"mm\" or \"in\", found \"{}\"",
                                         unit->text));
      }
    }
  }
}

void read_features_entry(TomlTable& root, const std::filesystem::path& path,
                         const std::function<bool(const std::filesystem::path&)>& is_file,
                         ObjectDescription& object) {
  const auto features = root.text("features");
  if (!features) return;
  object.features = config::resolve(path, features->text);
  if (is_file(object.features)) return;
  root.problem(
      "features",
      fmt::format("there is no file {} (sightline train makes it)", object.features.string()),
      ErrorCode::kNotFound);
}

}  // namespace

Result<ObjectDescription> parse_object_file(
    std::string_view text, const std::filesystem::path& path,
    const std::function<bool(const std::filesystem::path&)>& is_file) {
  SL_ASSIGN(auto document, config::TomlDocument::parse(text, path.string()));
  TomlTable root = document.root();
  ObjectDescription object;
  object.file = path;
  if (root.require("name", "what to call the object")) {
    if (const auto name = root.text("name")) {
      object.name = name->text;
      const std::string_view fault = config::object_name_fault(name->text);
      if (!fault.empty()) root.problem("name", fault);
    }
  }
  read_mesh_entry(root, path, is_file, object);
  read_features_entry(root, path, is_file, object);
  read_symmetry(root, object);
  read_fiducials(root, object);
  read_board(root, object);
  read_modalities(root, object);
  root.finish();
  if (!document.problems().empty()) return document.problems().error();
  return object;
}

Result<Modalities> parse_modalities(const std::vector<std::string>& names,
                                    const std::string& where) {
  Modalities modalities{false, false, false, false};
  for (const std::string& name : names) {
    bool* const flag = modality_flag(modalities, name);
    if (flag == nullptr) {
      return make_error(ErrorCode::kInvalidInput, where,
                        "there is no modality \"{}\"; known: fiducial, region, edge, texture",
                        name);
    }
    *flag = true;
  }
  return modalities;
}

Result<ObjectDescription> read_object_file(const std::filesystem::path& path) {
  constexpr size_t kLargestFile = size_t{4} << 20;
  SL_ASSIGN(const std::string text, read_file(path, kLargestFile));
  return parse_object_file(text, path, [](const std::filesystem::path& file) {
    std::error_code code;
    return std::filesystem::is_regular_file(file, code);
  });
}

}  // namespace sightline
