// SPDX-License-Identifier: Apache-2.0
#include "object_copy.hpp"

#include <algorithm>
#include <set>
#include <sstream>

#include "sightline/base/files.hpp"

namespace sightline {
namespace {

namespace fs = std::filesystem;

/// Everything in one line of a text file that could be a file name: words, quoted strings, and all
/// after the first word (names with spaces in OBJ and MTL).
std::vector<std::string> candidates(const std::string& line) {
  std::vector<std::string> found;
  std::istringstream words(line);
  for (std::string word; words >> word;) found.push_back(word);
  for (size_t open = line.find('"'); open != std::string::npos; open = line.find('"', open + 1)) {
    const size_t end = line.find('"', open + 1);
    if (end == std::string::npos) break;
    found.push_back(line.substr(open + 1, end - open - 1));
  }
  const size_t space = line.find(' ');
  if (space != std::string::npos) found.push_back(line.substr(space + 1));
  return found;
}

/// Lines of `file` that can name other files; of an OBJ only those that name materials, because the
/// rest is numbers.
bool can_name_files(const fs::path& file, const std::string& line) {
  return file.extension() != ".obj" || line.starts_with("mtllib");
}

bool may_hold_names(const fs::path& file) {
  static const std::set<std::string> kKinds = {".toml", ".obj", ".mtl", ".gltf"};
  return kKinds.contains(file.extension().string());
}

bool leads_out(const fs::path& name) {
  return name.is_absolute() ||
         std::any_of(name.begin(), name.end(), [](const auto& part) { return part == ".."; });
}

class Copier {
 public:
  Status copy(const fs::path& from, const fs::path& to) {
    if (!done_.insert(to.lexically_normal()).second) return {};
    SL_ASSIGN(std::string content, read_file(from));
    if (may_hold_names(from)) SL_RETURN_IF_ERROR(copy_parts(from, to, content));
    std::error_code fault;
    fs::create_directories(to.parent_path(), fault);
    return write_file_atomically(to, content);
  }

 private:
  Status copy_parts(const fs::path& from, const fs::path& to, std::string& content) {
    std::istringstream lines(content);
    std::set<std::string> names;
    for (std::string line; std::getline(lines, line);) {
      if (line.ends_with('\r')) line.pop_back();
      if (!can_name_files(from, line)) continue;
      for (auto& name : candidates(line)) names.insert(std::move(name));
    }
    for (const auto& name : names) {
      std::error_code fault;
      const fs::path part = from.parent_path() / name;
      if (name.size() > 255 || !fs::is_regular_file(part, fault)) continue;
      if (fs::equivalent(part, from, fault)) continue;
      fs::path target = name;
      if (leads_out(target)) {
        target = target.filename();
        rename_in(content, name, target.string());
      }
      SL_RETURN_IF_ERROR(copy(part, to.parent_path() / target));
    }
    return {};
  }

  static void rename_in(std::string& content, const std::string& from, const std::string& to) {
    for (size_t at = content.find(from); at != std::string::npos;
         at = content.find(from, at + to.size())) {
      content.replace(at, from.size(), to);
    }
  }

  std::set<fs::path> done_;
};

}  // namespace

Status copy_with_parts(const fs::path& file, const fs::path& folder) {
  return Copier().copy(file, folder / file.filename());
}

Result<std::vector<std::string>> copy_objects(const std::vector<fs::path>& objects,
                                              const fs::path& recording) {
  std::set<fs::path> names;
  for (const auto& object : objects) names.insert(object.filename());
  const bool all_differ = names.size() == objects.size();
  std::vector<std::string> copied;
  for (size_t i = 0; i < objects.size(); ++i) {
    const fs::path folder =
        all_differ ? fs::path("objects") : fs::path("objects") / std::to_string(i);
    SL_RETURN_IF_ERROR(copy_with_parts(objects[i], recording / folder));
    copied.push_back((folder / objects[i].filename()).string());
  }
  return copied;
}

}  // namespace sightline
