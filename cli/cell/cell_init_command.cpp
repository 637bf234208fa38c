// SPDX-License-Identifier: Apache-2.0
// `sightline cell init`: everything that the hosts of a cell need of each other, from one
// installation file.
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <memory>
#include <optional>

#include "cell/cell_certificates.hpp"
#include "cell/cell_commands.hpp"
#include "cell/cell_files.hpp"
#include "report.hpp"
#include "sightline/base/files.hpp"
#include "sightline/base/unique_fd.hpp"
#include "sightline/config/cell_draft.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/record/copy_files.hpp"
#include "split.hpp"

namespace sightline::cli {
namespace {

namespace fs = std::filesystem;

constexpr size_t kLargestInstallation = size_t{1} << 20;
constexpr size_t kLongestName = 64;

struct InitOptions {
  fs::path config, out;
  std::vector<std::string> hosts;      // NAME or NAME=CAMERA,CAMERA
  std::vector<std::string> neighbors;  // CELL=BROKER or CELL=BROKER:PORT
  CellSetup setup;
  int days = 3650;
  bool update = false;  // of a folder that is there
};

Error wrong(const char* option, std::string text) {
  return make_error(ErrorCode::kInvalidInput, option, "{}", text);
}

bool is_plain(const std::string& text, std::string_view further) {
  return !text.empty() && std::isalnum(static_cast<unsigned char>(text[0])) != 0 &&
         std::ranges::all_of(text, [further](unsigned char c) {
           return std::isalnum(c) != 0 || further.find(static_cast<char>(c)) != further.npos;
         });
}

bool is_host_name(const std::string& name) {
  return name.size() <= kLongestName && is_plain(name, "-_.");
}

// It becomes a line of other programs' files.
bool is_topic(const std::string& name) {
  return !name.empty() && name[0] != '/' && std::ranges::none_of(name, [](unsigned char c) {
    return c < ' ' || c == '+' || c == '#';
  });
}

CellSetup::Host& host_of(CellSetup& setup, const std::string& name) {
  const auto known = std::ranges::find(setup.hosts, name, &CellSetup::Host::name);
  if (known != setup.hosts.end()) return *known;
  return setup.hosts.emplace_back(CellSetup::Host{name, {}});
}

// Which host has which camera, as the command line says it.
Status read_hosts(const InitOptions& options, CellSetup& setup,
                  std::map<std::string, std::string>& owners) {
  for (const std::string& text : options.hosts) {
    const size_t at = text.find('=');
    CellSetup::Host& host = host_of(setup, text.substr(0, at));
    if (!is_host_name(host.name)) {
      return wrong("--host",
                   fmt::format("\"{}\" is no host; write NAME or NAME=CAMERA,CAMERA", text));
    }
    if (at == std::string::npos) continue;
    for (const std::string& camera : split(text.substr(at + 1), ',')) {
      if (!is_host_name(camera)) {
        return wrong("--host", fmt::format("\"{}\" in \"{}\" is no camera's name", camera, text));
      }
      const auto [owner, fresh] = owners.emplace(camera, host.name);
      if (!fresh) {
        return wrong("--host", fmt::format("camera {} has two hosts, {} and {}", camera,
                                           owner->second, host.name));
      }
      if (options.config.empty()) host.cameras.push_back(camera);
    }
  }
  return {};
}

// Of the cells next to this one the file says which they are, and the command line where.
Status read_neighbors(const InitOptions& options, const CellDraft& draft, CellSetup& setup) {
  for (const std::string& text : options.neighbors) {
    const size_t at = text.find('=');
    const std::vector<std::string> place =
        split(at == std::string::npos ? "" : text.substr(at + 1), ':');
    CellSetup::Neighbor neighbor{text.substr(0, at), place.front(), 8883, {}};
    unsigned port = neighbor.port;
    const bool numbered =
        place.size() == 1 ||
        (place.size() == 2 && !place[1].empty() && place[1].size() <= 5 &&
         std::ranges::all_of(place[1], [](unsigned char c) { return std::isdigit(c) != 0; }) &&
         (port = static_cast<unsigned>(std::stoul(place[1]))) > 0 && port <= UINT16_MAX);
    if (!is_topic(neighbor.name) || !is_plain(neighbor.broker, "-.") || !numbered) {
      return wrong("--neighbor", fmt::format("\"{}\": write CELL=BROKER or CELL=BROKER:PORT, as in "
                                             "site/b=192.168.1.20",
                                             text));
    }
    neighbor.port = static_cast<uint16_t>(port);
    setup.neighbors.push_back(std::move(neighbor));
  }
  for (const std::string& name : draft.neighbors) {
    if (std::ranges::find(setup.neighbors, name, &CellSetup::Neighbor::name) !=
        setup.neighbors.end()) {
      continue;
    }
    return wrong("--neighbor", fmt::format("where is the broker of {}, which {} names? Say "
                                           "--neighbor {}=ADDRESS",
                                           name, options.config.string(), name));
  }
  return {};
}

// A camera at the border, of a host of another cell.
Status take_border_camera(const InitOptions& options, const CellDraft::Camera& camera,
                          CellSetup& setup) {
  const auto neighbor = std::ranges::find(setup.neighbors, camera.cell, &CellSetup::Neighbor::name);
  if (neighbor != setup.neighbors.end()) {
    neighbor->cameras.push_back(camera.name);
    return {};
  }
  return make_error(ErrorCode::kInvalidInput,
                    fmt::format("{}:{}", options.config.string(), camera.line),
                    "camera {} has cell = \"{}\" there: say where that is, --neighbor {}=ADDRESS",
                    camera.name, camera.cell, camera.cell);
}

Status take_cameras(const InitOptions& options, const CellDraft& draft, CellSetup& setup,
                    const std::map<std::string, std::string>& owners) {
  for (const CellDraft::Camera& camera : draft.cameras) {
    if (!camera.cell.empty() && camera.cell != setup.name) {
      SL_RETURN_IF_ERROR(take_border_camera(options, camera, setup));
      continue;
    }
    const auto owner = owners.find(camera.name);
    const std::string host = owner == owners.end() ? camera.host : owner->second;
    const auto where = [&] { return fmt::format("{}:{}", options.config.string(), camera.line); };
    if (host.empty()) {
      return make_error(ErrorCode::kInvalidInput, where(),
                        "camera {}: whose is it? Give it host = \"NAME\" there, or say --host "
                        "NAME={}",
                        camera.name, camera.name);
    }
    if (!camera.host.empty() && host != camera.host) {
      return make_error(ErrorCode::kInvalidInput, where(),
                        "camera {} has host = \"{}\" there, but --host says {}", camera.name,
                        camera.host, host);
    }
    host_of(setup, host).cameras.push_back(camera.name);
  }
  for (const auto& [camera, host] : owners) {
    if (std::ranges::find(draft.cameras, camera, &CellDraft::Camera::name) == draft.cameras.end()) {
      return wrong("--host", fmt::format("{} has no camera {}", options.config.string(), camera));
    }
  }
  return {};
}

// What the command line leaves open is taken from the file.
Status complete(const InitOptions& options, const CellDraft& draft, CellSetup& setup) {
  if (setup.name.empty()) setup.name = "sightline/cell";
  if (setup.broker.empty()) setup.broker = draft.broker;
  if (setup.fusion.empty() && draft.fuses) setup.fusion = draft.host;
  if (!is_topic(setup.name)) return wrong("--name", "a topic without +, # and a / in front");
  if (setup.broker.empty() || !is_plain(setup.broker, "-.:")) {
    return wrong("--broker", "the name or address of the fusion host, as its others reach it");
  }
  if (setup.fusion.empty()) {
    return wrong("--fusion", "which host keeps the estimates? Name it; the broker runs there");
  }
  if (!is_host_name(setup.fusion)) return wrong("--fusion", "the name of a host, as in \"hall-1\"");
  host_of(setup, setup.fusion);
  for (const CellSetup::Host& host : setup.hosts) {
    if (!is_host_name(host.name)) {
      return make_error(ErrorCode::kInvalidInput, options.config.string(),
                        "\"{}\" is no name of a host", host.name);
    }
  }
  if (setup.hosts.size() > 1) return {};
  return wrong("--host",
               fmt::format("{} is the only host: a rig on one host needs no cell", setup.fusion));
}

// One host's file, held to the parser that its daemon uses before anything is written.
Status check_installation(const fs::path& config, const std::string& host,
                          const std::string& text) {
  InstallationFiles world = InstallationFiles::on_disk();
  const fs::path fresh = fs::absolute(config).parent_path() / "cell";
  world.is_file = [fresh, on_disk = world.is_file](const fs::path& path) {
    return fs::absolute(path).lexically_normal().parent_path() == fresh || on_disk(path);
  };
  const auto read = parse_installation(text, config, world);
  if (read) return {};
  return make_error(read.error().code, read.error().where, "as the file of host {}: {}", host,
                    read.error().text);
}

// Keys are never written over what is there.
Status write_new(const fs::path& path, const NewFile& file, bool update) {
  std::error_code fault;
  fs::create_directories(path.parent_path(), fault);
  if (update && !file.secret) return write_file_atomically(path, file.content);
  const UniqueFd fd(
      ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC,
             file.secret ? S_IRUSR | S_IWUSR : S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH));
  const auto failed = [&] {
    return make_error(ErrorCode::kIo, path.string(), "cannot write: {}", std::strerror(errno));
  };
  if (!fd.is_open()) return failed();
  const ssize_t written = ::write(fd.get(), file.content.data(), file.content.size());
  if (written != static_cast<ssize_t>(file.content.size()) || ::fsync(fd.get()) != 0)
    return failed();
  return {};
}

Status make_folder(const fs::path& folder) {
  if (::mkdir(folder.c_str(), S_IRWXU) == 0) return {};
  if (errno == EEXIST) {
    return make_error(ErrorCode::kInvalidInput, folder.string(),
                      "it is there already; what hosts trust is never overwritten, give another "
                      "folder, or --update if it is this cell's");
  }
  return make_error(ErrorCode::kIo, folder.string(), "cannot make this folder: {}",
                    std::strerror(errno));
}

// Else a new authority would be made, which none of the hosts trusts.
Status check_folder(const fs::path& folder) {
  std::error_code ignored;
  if (fs::exists(folder / "authority" / "ca.key", ignored)) return {};
  return make_error(ErrorCode::kInvalidInput, folder.string(),
                    "is no folder of `sightline cell init`, or authority/ca.key is kept elsewhere: "
                    "bring it back for the moment, or make the cell anew without --update");
}

// What the installation names goes with it. What not everybody may read stays so.
Status copy_named_files(const fs::path& config, const CellDraft& draft, const fs::path& folder,
                        std::vector<std::string>& left_out) {
  for (const fs::path& file : draft.files) {
    const fs::path from = config.parent_path() / file, to = folder / file;
    SL_RETURN_IF_ERROR(copy_file_and_parts(from, to.parent_path(), left_out));
    std::error_code fault;
    const auto narrow = fs::status(from, fault).permissions() & fs::perms::others_read;
    if (!fault && narrow == fs::perms::none) {
      fs::permissions(to, fs::perms::owner_read | fs::perms::owner_write, fault);
    }
    if (fault) {
      return make_error(ErrorCode::kIo, to.string(), "cannot set who may read it: {}",
                        fault.message());
    }
  }
  return {};
}

struct Source {
  std::string text;
  CellDraft draft;
};

Result<Source> read_source(const fs::path& config) {
  Source source;
  if (config.empty()) return source;
  SL_ASSIGN(source.text, read_file(config, kLargestInstallation));
  if (!source.text.ends_with('\n')) source.text += '\n';
  SL_ASSIGN(source.draft, read_cell_draft(source.text, config));
  return source;
}

Result<std::vector<NewFile>> draft_files(const InitOptions& options, const CellSetup& setup,
                                         const Source& source,
                                         const std::map<std::string, std::string>& owners,
                                         const std::vector<std::string>& left) {
  std::vector<NewFile> files;
  for (const CellSetup::Host& host : setup.hosts) {
    const fs::path folder = fs::path("hosts") / host.name;
    std::string text = cell_section(setup, host, source.draft.kept);
    if (!options.config.empty()) {
      text = with_cell(source.text, source.draft, owners, text);
      SL_RETURN_IF_ERROR(check_installation(options.config, host.name, text));
    }
    files.push_back({folder / (options.config.empty() ? "cell.toml" : "sightline.toml"), text});
    files.push_back({folder / "chrony.conf", chrony_hints(setup, host)});
    files.push_back({folder / "sightlined.conf", service_drop_in()});
  }
  files.push_back({"broker/access", access_list(setup)});
  files.push_back({"broker/mosquitto.conf", broker_configuration(setup)});
  for (const CellSetup::Neighbor& neighbor : setup.neighbors) {
    files.push_back({fmt::format("broker/neighbor_{}.conf", neighbor_file(neighbor.name)),
                     bridge_configuration(setup, neighbor)});
  }
  files.push_back({"README", setup_notes(setup, !options.config.empty())});
  SL_RETURN_IF_ERROR(add_certificates(options.out, options.days, setup, left, files));
  return files;
}

Status init(const InitOptions& options) {
  CellSetup setup = options.setup;
  SL_ASSIGN(const Source source, read_source(options.config));
  std::map<std::string, std::string> owners;
  if (setup.name.empty()) setup.name = source.draft.name;
  SL_RETURN_IF_ERROR(read_hosts(options, setup, owners));
  SL_RETURN_IF_ERROR(read_neighbors(options, source.draft, setup));
  if (!options.config.empty()) {
    SL_RETURN_IF_ERROR(take_cameras(options, source.draft, setup, owners));
  }
  SL_RETURN_IF_ERROR(complete(options, source.draft, setup));
  std::vector<std::string> left;
  if (options.update) {
    SL_RETURN_IF_ERROR(check_folder(options.out));
    SL_ASSIGN(left, hosts_that_left(options.out, setup));
  }
  SL_ASSIGN(const auto files, draft_files(options, setup, source, owners, left));
  if (!options.update) SL_RETURN_IF_ERROR(make_folder(options.out));
  for (const std::string& host : left) SL_RETURN_IF_ERROR(set_aside(options.out, host));
  std::vector<std::string> left_out;
  for (const CellSetup::Host& host : setup.hosts) {
    SL_RETURN_IF_ERROR(copy_named_files(options.config, source.draft,
                                        options.out / "hosts" / host.name, left_out));
  }
  for (const NewFile& file : files) {
    SL_RETURN_IF_ERROR(write_new(options.out / file.path, file, options.update));
    fmt::print("{}\n", (options.out / file.path).string());
  }
  std::ranges::sort(left_out);
  left_out.erase(std::unique(left_out.begin(), left_out.end()), left_out.end());
  for (const std::string& sentence : left_out) fmt::print(stderr, "{}\n", sentence);
  for (const fs::path& file : source.draft.elsewhere) {
    fmt::print(stderr, "{} is not below the installation file: each host needs it there\n",
               file.string());
  }
  for (const std::string& host : left) {
    fmt::print(stderr,
               "host {} is in the cell no more: broker/revoked.pem takes its certificate back once "
               "the broker has it and was restarted\n",
               host);
  }
  fmt::print(stderr, "{} hosts; {} says what goes where\n", setup.hosts.size(),
             (options.out / "README").string());
  return {};
}

}  // namespace

void add_cell_init(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<InitOptions>();
  CellSetup& setup = options->setup;
  setup.broker_folder = "/etc/mosquitto/sightline";
  CLI::App* command = app.add_subcommand(
      "init", "write certificates, access list and configuration for each host of a cell");
  command->add_option("OUT", options->out, "folder to make")->required();
  command->add_option("--config", options->config,
                      "installation file, in which cameras say their host");
  command
      ->add_option("--host", options->hosts,
                   "NAME[=CAMERA,CAMERA], again for each: a host, and which cameras it has")
      ->take_all();
  command->add_option("--fusion", setup.fusion, "the host that keeps the estimates");
  command->add_option("--broker", setup.broker, "name or address of the fusion host");
  command->add_option("--port", setup.port, "of the broker (default: 8883)");
  command
      ->add_option(
          "--neighbor", options->neighbors,
          "CELL=BROKER[:PORT], again for each: a cell next to this one (default port: 8883)")
      ->take_all();
  command->add_option("--name", setup.name, "of the cell: its topics begin with it");
  command->add_option("--broker-folder", setup.broker_folder,
                      "where the broker's files will lie (default: /etc/mosquitto/sightline)");
  command->add_flag(
      "--update", options->update,
      "OUT is there: keep its keys, add hosts that are new, take those back that left");
  command->add_option("--days", options->days, "for which the certificates hold (default: 3650)")
      ->check(CLI::Range(1, 36500));
  command->callback([options, &chosen] {
    chosen = [options] {
      const Status done = init(*options);
      return done ? 0 : report(done.error());
    };
  });
}

}  // namespace sightline::cli
