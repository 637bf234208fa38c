// SPDX-License-Identifier: Apache-2.0
#include "observe/fiducial/code_search.hpp"

#include <algorithm>
#include <map>
#include <utility>

#include "observe/fiducial/apriltag_detector.hpp"
#include "observe/fiducial/aruco_detector.hpp"

namespace sightline::observe {
namespace {

using Owners = std::map<std::pair<std::string, int>, CodeOwner>;  // by family and id

/// Codes by the detector that reads them.
struct Codes {
  Owners apriltags;
  std::map<std::pair<std::string, bool>, Owners> arucos;  // by dictionary and inverted
};

std::string place_of(const ObjectDescription& object) {
  return object.file.empty() ? object.name : object.file.string();
}

Status own(std::span<const FiducialObject> objects, Owners& owners, const std::string& family,
           int id, CodeOwner owner) {
  const auto [at, fresh] = owners.emplace(std::pair(family, id), owner);
  if (fresh) return {};
  return make_error(ErrorCode::kInvalidInput, objects[owner.object].description.name,
                    "{} id {} is also on object '{}': every marker may stand once in an "
                    "installation; print another id",
                    family, id, objects[at->second.object].description.name);
}

Status collect_fiducials(std::span<const FiducialObject> objects, size_t index, Codes& codes) {
  const ObjectDescription& d = objects[index].description;
  for (size_t f = 0; f < d.fiducials.size(); ++f) {
    const Fiducial& fiducial = d.fiducials[f];
    const CodeOwner owner{index, static_cast<int>(f), -1};
    const std::string dictionary = aruco_dictionary_of_family(fiducial.family);
    if (!is_apriltag_family(fiducial.family) && dictionary.empty()) {
      return make_error(ErrorCode::kInvalidInput, place_of(d),
                        "fiducial family '{}' is not known; known are {}", fiducial.family,
                        fmt::join(known_fiducial_families(), ", "));
    }
    Owners& owners =
        is_apriltag_family(fiducial.family) ? codes.apriltags : codes.arucos[{dictionary, false}];
    SL_RETURN_IF_ERROR(own(objects, owners, fiducial.family, fiducial.id, owner));
  }
  return {};
}

Status collect_board(std::span<const FiducialObject> objects, size_t index, Codes& codes) {
  const ObjectDescription& d = objects[index].description;
  if (!d.board) return {};
  if (!is_aruco_dictionary(d.board->dictionary)) {
    return make_error(ErrorCode::kInvalidInput, place_of(d),
                      "board dictionary '{}' is not known; known are {}", d.board->dictionary,
                      fmt::join(known_board_dictionaries(), ", "));
  }
  Owners& owners = codes.arucos[{d.board->dictionary, d.board->inverted}];
  const int markers = (d.board->columns * d.board->rows + 1) / 2;
  const std::string family = aruco_family_of_dictionary(d.board->dictionary);
  for (int id = 0; id < markers; ++id) {
    SL_RETURN_IF_ERROR(own(objects, owners, family, id, {index, -1, id}));
  }
  return {};
}

/// `make` builds the detector of these codes.
template <typename Make>
Result<CodeSearch> make_search(const Owners& owners, const Make& make) {
  std::vector<SquareCode> codes;
  CodeSearch search;
  for (const auto& [code, owner] : owners) {
    codes.push_back({code.first, code.second});
    search.owners.push_back(owner);
    search.objects.push_back(owner.object);
  }
  std::sort(search.objects.begin(), search.objects.end());
  search.objects.erase(std::unique(search.objects.begin(), search.objects.end()),
                       search.objects.end());
  SL_ASSIGN(search.detector, make(codes));
  return search;
}

}  // namespace

Result<std::vector<CodeSearch>> make_code_searches(std::span<const FiducialObject> objects,
                                                   const FiducialOptions& options,
                                                   const std::string& camera) {
  Codes codes;
  for (size_t i = 0; i < objects.size(); ++i) {
    SL_RETURN_IF_ERROR(collect_fiducials(objects, i, codes));
    SL_RETURN_IF_ERROR(collect_board(objects, i, codes));
  }
  std::vector<CodeSearch> searches;
  if (!codes.apriltags.empty()) {
    const auto make = [&](const std::vector<SquareCode>& used) {
      return make_apriltag_detector(
          used, {options.threads, options.max_hamming, options.min_decision_margin}, camera);
    };
    SL_ASSIGN(searches.emplace_back(), make_search(codes.apriltags, make));
  }
  for (const auto& entry : codes.arucos) {
    const auto& key = entry.first;  // clang 14 captures no structured bindings
    const auto make = [&](const std::vector<SquareCode>& used) {
      return make_aruco_detector(used, key.first, key.second, camera);
    };
    SL_ASSIGN(searches.emplace_back(), make_search(entry.second, make));
  }
  return searches;
}

}  // namespace sightline::observe
