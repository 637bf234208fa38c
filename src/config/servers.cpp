// SPDX-License-Identifier: Apache-2.0
#include "config/servers.hpp"

#include "config/section_reader.hpp"

namespace sightline::config {
namespace {

/// An address that other hosts reach takes tokens and TLS, unless the file says that it is open.
void check_guarded(TomlTable& root, const char* section, const std::filesystem::path& tokens,
                   const std::filesystem::path& certificate) {
  if (tokens.empty()) {
    root.table(section)->problem(
        "address",
        "other hosts could reach it, and nobody would be asked for a token: name a file of tokens "
        "under [access], or say open = true if everybody is meant");
  } else if (certificate.empty()) {
    root.table(section)->problem(
        "address",
        "other hosts could reach it, and what travels could be read on the way: name certificate "
        "and key under [access], or say open = true if that is meant");
  }
}

void check_http(TomlTable& root, const HttpOptions& http) {
  if (!is_numeric_address(http.address)) {
    root.table("http")->problem("address", "a numeric address, as in \"127.0.0.1\" or \"::1\"");
  } else if (!is_loopback_address(http.address) && !http.open) {
    check_guarded(root, "http", http.tokens, http.tls.certificate);
  }
}

void check_rtsp(TomlTable& root, const RtspOptions& rtsp) {
  if (rtsp.address.empty()) {
    root.table("rtsp")->problem("address", "an address to listen at, as in \"0.0.0.0\"");
  } else if (rtsp.address != "localhost" && !is_loopback_address(rtsp.address) && !rtsp.open) {
    check_guarded(root, "rtsp", rtsp.tokens, rtsp.certificate);
  }
}

std::filesystem::path secret_file(const std::filesystem::path& path, const std::string& setting) {
  return setting.starts_with("credential:") ? std::filesystem::path(setting)
                                            : resolve(path, setting);
}

void read_tls_files(TomlTable& table, const std::filesystem::path& path,
                    const InstallationFiles& files, Installation& installation) {
  const auto certificate = table.text("certificate"), key = table.text("key");
  if (!certificate && !key) return;
  if (!certificate || !key) {
    table.problem(certificate ? "certificate" : "key", "certificate and key, or neither");
    return;
  }
  TlsFiles tls{secret_file(path, certificate->text), secret_file(path, key->text), 0};
  const auto content = files.tls(tls);
  if (!content) {
    table.problem("certificate",
                  fmt::format("cannot use certificate and key\n  {}", content.error().message()),
                  content.error().code);
    return;
  }
  tls.content = *content;
  installation.http.server.tls = tls;
  installation.rtsp.server.certificate = tls.certificate;
  installation.rtsp.server.key = tls.key;
  installation.rtsp.server.tls_content = tls.content;
}

// The tokens themselves stay in their file.
void read_access(TomlTable& root, const std::filesystem::path& path, const InstallationFiles& files,
                 Installation& installation) {
  auto table = root.table("access");
  if (!table) return;
  if (const auto text = table->text("tokens")) {
    const std::filesystem::path file = secret_file(path, text->text);
    const auto content = files.tokens(file);
    if (content) {
      installation.http.server.tokens = installation.rtsp.server.tokens = file;
      installation.http.server.tokens_content = *content;
      installation.rtsp.server.tokens_content = *content;
    } else {
      table->problem("tokens",
                     fmt::format("cannot use these tokens\n  {}", content.error().message()),
                     content.error().code);
    }
  }
  read_tls_files(*table, path, files, installation);
  table->finish();
}

}  // namespace

void read_servers(TomlTable& root, const std::filesystem::path& path,
                  const InstallationFiles& files, Installation& installation) {
  const auto section = [&](std::string_view key, auto& fields) {
    auto table = root.table(key);
    if (!table) return;
    SectionReader reader(*table, path, files);
    visit(reader, fields);
    table->finish();
  };
  section("rtsp", installation.rtsp);
  section("http", installation.http);
  read_access(root, path, files, installation);
  const HttpOptions& http = installation.http.server;
  if (installation.rtsp.enabled || installation.rtsp.server.address.empty()) {
    check_rtsp(root, installation.rtsp.server);
  }
  check_http(root, http);
  const bool same = http.port != 0 && installation.rtsp.server.port == http.port;
  if (installation.rtsp.enabled && installation.http.enabled && same) {
    const bool named = root.has("http");
    (named ? *root.table("http") : *root.table("rtsp"))
        .problem("port", fmt::format("{} is used by [rtsp] and by [http]", http.port));
  }
}

}  // namespace sightline::config
