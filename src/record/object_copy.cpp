// SPDX-License-Identifier: Apache-2.0
#include "record/object_copy.hpp"

#include <algorithm>
#include <set>

#include "record/object_parts.hpp"
#include "sightline/base/files.hpp"
#include "sightline/record/copy_files.hpp"

namespace sightline::record {
namespace {

namespace fs = std::filesystem;

constexpr size_t kLargestPart = size_t{1} << 30;  // as large as a mesh may be
constexpr size_t kLongestName = 4096;
constexpr int kMostSteps = 3;  // object file, mesh, materials, textures
constexpr size_t kMostSaid = 64;

fs::path folder_of(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

bool begins_with(const fs::path& path, const fs::path& start) {
  return std::mismatch(start.begin(), start.end(), path.begin(), path.end()).first == start.end();
}

enum class Place { kMissing, kInside, kOutside };

/// Where a name leads.
struct Found {
  Place place = Place::kMissing;
  fs::path file;    ///< with all links followed
  fs::path target;  ///< relative name in the copy
};

Found find_part(const fs::path& folder, const std::string& name) {
  if (name.empty() || name.size() > kLongestName || name.find('\0') != std::string::npos) return {};
  const fs::path as_named(name);
  const fs::path relative = as_named.lexically_normal();
  const bool leads_up = relative.begin() != relative.end() && *relative.begin() == "..";
  if (leads_up) return {Place::kOutside, {}, {}};
  std::error_code fault;
  const fs::path root = fs::canonical(folder, fault);
  if (fault) return {};
  const fs::path file = fs::canonical(folder / as_named, fault);
  if (fault) return {as_named.is_absolute() ? Place::kOutside : Place::kMissing, {}, {}};
  if (!begins_with(file, root)) return {Place::kOutside, {}, {}};
  if (!fs::is_regular_file(file, fault)) return {};
  return {Place::kInside, file, as_named.is_absolute() ? file.lexically_relative(root) : as_named};
}

class Copier {
 public:
  explicit Copier(std::vector<std::string>& left_out) : left_out_(left_out) {}

  /// `read_from` is `file` with links followed; names in it are relative to the folder of `file`.
  Status copy(const fs::path& file, const fs::path& read_from, const fs::path& to, int steps) {
    if (!done_.insert(to.lexically_normal()).second) return {};
    SL_ASSIGN(std::string content, read_file(read_from, kLargestPart));
    if (steps < kMostSteps) SL_RETURN_IF_ERROR(copy_parts(file, to, steps, content));
    std::error_code fault;
    fs::create_directories(to.parent_path(), fault);
    return write_file_atomically(to, content);
  }

 private:
  Status copy_parts(const fs::path& file, const fs::path& to, int steps, std::string& content) {
    for (const PartReference& part : parts_named_by(file, content)) {
      SL_RETURN_IF_ERROR(copy_part(part, file, to, steps, content));
    }
    return {};
  }

  Status copy_part(const PartReference& part, const fs::path& file, const fs::path& to, int steps,
                   std::string& content) {
    const std::string* outside = nullptr;
    for (const std::string& name : part) {
      const Found found = find_part(folder_of(file), name);
      if (found.place == Place::kOutside && outside == nullptr) outside = &name;
      if (found.place != Place::kInside) continue;
      if (found.target != name) rename_in(content, name, found.target.string());
      // The way to it must exist in the copy too, where it has steps back ("a/../b").
      std::error_code fault;
      const fs::path target = to.parent_path() / found.target;
      fs::create_directories(target.parent_path(), fault);
      return copy(folder_of(file) / name, found.file, target, steps + 1);
    }
    if (outside != nullptr) say_left_out(file, *outside);
    return {};
  }

  void say_left_out(const fs::path& file, const std::string& name) {
    std::string sentence = fmt::format("{} names {}, which is not in its folder: not copied",
                                       file.filename().string(), name.substr(0, 200));
    // It goes into a TOML file, which has to be UTF-8 whatever a stranger wrote.
    for (char& c : sentence) c = c >= ' ' && c <= '~' ? c : '?';
    const bool known = std::find(left_out_.begin(), left_out_.end(), sentence) != left_out_.end();
    if (!known && left_out_.size() < kMostSaid) left_out_.push_back(std::move(sentence));
  }

  static void rename_in(std::string& content, const std::string& from, const std::string& to) {
    for (size_t at = content.find(from); at != std::string::npos;
         at = content.find(from, at + to.size())) {
      content.replace(at, from.size(), to);
    }
  }

  std::set<fs::path> done_;
  std::vector<std::string>& left_out_;
};

/// True if all can lie in one folder without one's mesh replacing another's.
bool fit_one_folder(const std::vector<fs::path>& objects) {
  std::set<fs::path> names, folders;
  for (const auto& object : objects) {
    names.insert(object.filename());
    folders.insert(folder_of(object).lexically_normal());
  }
  return names.size() == objects.size() && folders.size() <= 1;
}

}  // namespace

Status copy_with_parts(const fs::path& file, const fs::path& folder,
                       std::vector<std::string>& left_out) {
  return Copier(left_out).copy(file, file, folder / file.filename(), 0);
}

Result<std::vector<std::string>> copy_objects(const std::vector<fs::path>& objects,
                                              const fs::path& recording,
                                              std::vector<std::string>& left_out) {
  const bool one_folder = fit_one_folder(objects);
  std::vector<std::string> copied;
  for (size_t i = 0; i < objects.size(); ++i) {
    const fs::path folder =
        one_folder ? fs::path("objects") : fs::path("objects") / std::to_string(i);
    SL_RETURN_IF_ERROR(copy_with_parts(objects[i], recording / folder, left_out));
    copied.push_back((folder / objects[i].filename()).string());
  }
  return copied;
}

}  // namespace sightline::record

namespace sightline {

Status copy_file_and_parts(const std::filesystem::path& file, const std::filesystem::path& folder,
                           std::vector<std::string>& left_out) {
  return record::copy_with_parts(file, folder, left_out);
}

}  // namespace sightline
