// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_certificates.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <system_error>

#include "sightline/base/files.hpp"
#include "sightline/publish/cell/certificates.hpp"

namespace sightline::cli {
namespace {

namespace fs = std::filesystem;

constexpr size_t kLargestPem = size_t{64} << 10;
constexpr size_t kMostHosts = 4096;

class Maker {
 public:
  Maker(const fs::path& folder, int days, std::vector<NewFile>& files)
      : folder_(folder), days_(days), files_(files) {}

  Status authority() {
    SL_ASSIGN(authority_, pair("authority/ca", [this] {
                return make_authority({.name = "Sightline cell", .days = days_});
              }));
    return {};
  }
  /// The pair PATH.pem and PATH.key, with the authority's certificate beside it.
  Status add(const fs::path& path, const std::string& name,
             const std::vector<std::string>& addresses = {}) {
    SL_ASSIGN(const PemPair ignored, pair(path, [&] {
                return make_certificate({.name = name, .addresses = addresses, .days = days_},
                                        authority_);
              }));
    (void)ignored;
    files_.push_back({path.parent_path() / "ca.pem", authority_.certificate});
    return {};
  }
  Status add_list(const std::vector<std::string>& revoked) {
    SL_ASSIGN(std::string list, make_revocation_list(revoked, authority_, days_));
    files_.push_back({"broker/revoked.pem", std::move(list)});
    return {};
  }

 private:
  template <typename Make>
  Result<PemPair> pair(const fs::path& path, const Make& make) {
    const fs::path certificate = path.string() + ".pem", key = path.string() + ".key";
    std::error_code ignored;
    if (fs::exists(folder_ / certificate, ignored) || fs::exists(folder_ / key, ignored)) {
      PemPair there;
      SL_ASSIGN(there.certificate, read_file(folder_ / certificate, kLargestPem));
      SL_ASSIGN(there.key, read_file(folder_ / key, kLargestPem));
      return there;
    }
    SL_ASSIGN(PemPair made, make());
    files_.push_back({certificate, made.certificate});
    files_.push_back({key, made.key, true});
    return made;
  }

  const fs::path& folder_;
  int days_;
  std::vector<NewFile>& files_;
  PemPair authority_;
};

// Names of the folders in one; none where it is not there.
Result<std::vector<std::string>> folders_in(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code fault;
  fs::directory_iterator at(folder, fault);
  if (fault == std::errc::no_such_file_or_directory) return names;
  for (; !fault && at != fs::directory_iterator(); at.increment(fault)) {
    if (at->is_directory(fault) && names.size() < kMostHosts) {
      names.push_back(at->path().filename().string());
    }
  }
  if (fault) {
    return make_error(ErrorCode::kIo, folder.string(), "cannot list it: {}", fault.message());
  }
  std::ranges::sort(names);
  return names;
}

Result<std::vector<std::string>> taken_back(const fs::path& folder,
                                            const std::vector<std::string>& left) {
  std::vector<fs::path> hosts;
  SL_ASSIGN(const auto before, folders_in(folder / "revoked"));
  for (const std::string& name : before) hosts.push_back(folder / "revoked" / name);
  for (const std::string& name : left) hosts.push_back(folder / "hosts" / name);
  std::vector<std::string> certificates;
  for (const fs::path& host : hosts) {
    SL_ASSIGN(std::string certificate, read_file(host / "cell" / "host.pem", kLargestPem));
    certificates.push_back(std::move(certificate));
  }
  return certificates;
}

}  // namespace

Result<std::vector<std::string>> hosts_that_left(const fs::path& folder, const CellSetup& setup) {
  SL_ASSIGN(auto names, folders_in(folder / "hosts"));
  std::erase_if(names, [&](const std::string& name) {
    return std::ranges::find(setup.hosts, name, &CellSetup::Host::name) != setup.hosts.end();
  });
  return names;
}

Status add_certificates(const fs::path& folder, int days, const CellSetup& setup,
                        const std::vector<std::string>& left, std::vector<NewFile>& files) {
  Maker maker(folder, days, files);
  SL_RETURN_IF_ERROR(maker.authority());
  SL_RETURN_IF_ERROR(maker.add("broker/broker", "broker", {setup.broker}));
  for (const CellSetup::Host& host : setup.hosts) {
    SL_RETURN_IF_ERROR(maker.add(fs::path("hosts") / host.name / "cell" / "host", host.name));
  }
  for (const CellSetup::Neighbor& neighbor : setup.neighbors) {
    SL_RETURN_IF_ERROR(maker.add(fs::path("neighbors") / neighbor_file(neighbor.name) / "bridge",
                                 neighbor_user(neighbor.name)));
  }
  SL_ASSIGN(const auto revoked, taken_back(folder, left));
  return maker.add_list(revoked);
}

Status set_aside(const fs::path& folder, const std::string& host) {
  std::error_code fault;
  fs::create_directories(folder / "revoked", fault);
  fs::path to = folder / "revoked" / host;
  for (int i = 2; fs::exists(to, fault) && i < 1000; ++i) {
    to = folder / "revoked" / fmt::format("{}.{}", host, i);  // it was here before
  }
  fs::rename(folder / "hosts" / host, to, fault);
  if (!fault) return {};
  return make_error(ErrorCode::kIo, to.string(), "cannot set aside what host {} had: {}", host,
                    fault.message());
}

}  // namespace sightline::cli
