// SPDX-License-Identifier: Apache-2.0
#include "sightline/control/access.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>

namespace sightline {
namespace {

constexpr size_t kShortest = 16, kLongest = 256;
constexpr std::uintmax_t kMostBytes = 64 << 10;
constexpr std::string_view kCredential = "credential:";

bool is_name(std::string_view text) {
  return !text.empty() && text.size() <= 64 && std::ranges::all_of(text, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_' || c == '.';
  });
}

bool is_secret(std::string_view text) {
  return text.size() >= kShortest && text.size() <= kLongest &&
         std::ranges::all_of(text, [](char c) { return c > ' ' && c < 127; });
}

Role role_of(std::string_view word) {
  if (word == "viewer") return Role::kViewer;
  return word == "operator" ? Role::kOperator : Role::kNone;
}

Result<AccessToken> parse_line(const std::vector<std::string>& words, const std::string& place) {
  const auto wrong = [&](const char* what) {
    return make_error(ErrorCode::kInvalidInput, place, "{}", what);
  };
  if (words.size() != 3) {
    return wrong("expected NAME ROLE TOKEN, as in \"anna operator\" and a token behind it");
  }
  if (!is_name(words[0])) return wrong("a name has letters, digits, '-', '_' and '.', 64 at most");
  const Role role = role_of(words[1]);
  if (role == Role::kNone) return wrong("the role, second in the line, is viewer or operator");
  if (!is_secret(words[2])) {
    return wrong(
        "a token has 16 to 256 printable characters; `openssl rand -base64 24` makes a good one");
  }
  return AccessToken{words[0], role, words[2]};
}

}  // namespace

Result<std::filesystem::path> token_file_path(const std::filesystem::path& setting) {
  const std::string text = setting.string();
  if (!text.starts_with(kCredential)) return setting;
  const std::string name = text.substr(kCredential.size());
  if (!is_name(name) || name.starts_with('.')) {
    return make_error(ErrorCode::kInvalidInput, text, "is not the name of a credential");
  }
  const char* const folder = std::getenv("CREDENTIALS_DIRECTORY");
  if (folder == nullptr) {
    return make_error(ErrorCode::kNotFound, text,
                      "the service manager has handed over no credentials: add LoadCredential={}:"
                      "FILE to the unit, or name a file",
                      name);
  }
  return std::filesystem::path(folder) / name;
}

Result<std::vector<AccessToken>> parse_tokens(std::string_view text, const std::string& where) {
  std::vector<AccessToken> tokens;
  std::istringstream lines{std::string(text)};
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::istringstream rest(line.substr(0, line.find('#')));
    std::vector<std::string> words;
    for (std::string word; rest >> word;) words.push_back(word);
    if (words.empty()) continue;
    const std::string place = fmt::format("{}:{}", where, number);
    SL_ASSIGN(AccessToken token, parse_line(words, place));
    for (const AccessToken& other : tokens) {
      if (other.name != token.name && other.secret != token.secret) continue;
      return make_error(ErrorCode::kInvalidInput, place, "has the {} of an earlier line",
                        other.name == token.name ? "name" : "token");
    }
    tokens.push_back(std::move(token));
  }
  if (tokens.empty()) {
    return make_error(
        ErrorCode::kInvalidInput, where,
        "holds no token: add a line NAME ROLE TOKEN, with viewer or operator as ROLE");
  }
  return tokens;
}

namespace {

enum class Secrecy { kSecret, kPublic };

Result<std::string> read_text(const std::filesystem::path& setting, Secrecy secrecy,
                              const char* kind) {
  SL_ASSIGN(const std::filesystem::path path, token_file_path(setting));
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) {
    return make_error(ErrorCode::kNotFound, path.string(), "there is no such {}", kind);
  }
  if (secrecy == Secrecy::kSecret && (info.st_mode & S_IRWXO) != 0) {
    return make_error(ErrorCode::kInvalidInput, path.string(),
                      "everybody on this machine can read it: chmod o= it, and make a new {}",
                      kind);
  }
  if (static_cast<std::uintmax_t>(info.st_size) > kMostBytes) {
    return make_error(ErrorCode::kInvalidInput, path.string(), "is too long for a {}", kind);
  }
  std::ifstream file(path, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(file), {});
  if (!file.good() && !file.eof()) {
    return make_error(ErrorCode::kIo, path.string(), "cannot be read");
  }
  if (!file.is_open()) {
    return make_error(ErrorCode::kIo, path.string(), "cannot be opened by this user");
  }
  return text;
}

Result<std::string> read_pem(const std::filesystem::path& setting, Secrecy secrecy,
                             const char* kind, const char* mark) {
  SL_ASSIGN(std::string text, read_text(setting, secrecy, kind));
  if (text.find(mark) != std::string::npos && text.find("-----BEGIN ") != std::string::npos) {
    return text;
  }
  return make_error(ErrorCode::kInvalidInput, setting.string(), "is no {} in PEM", kind);
}

}  // namespace

Result<std::vector<AccessToken>> read_tokens(const std::filesystem::path& setting) {
  SL_ASSIGN(const std::string text, read_text(setting, Secrecy::kSecret, "token file"));
  SL_ASSIGN(const std::filesystem::path path, token_file_path(setting));
  return parse_tokens(text, path.string());
}

Result<TlsTexts> read_tls(const TlsFiles& files) {
  TlsTexts texts;
  SL_ASSIGN(texts.certificate,
            read_pem(files.certificate, Secrecy::kPublic, "certificate", "CERTIFICATE-----"));
  SL_ASSIGN(texts.key, read_pem(files.key, Secrecy::kSecret, "private key", "PRIVATE KEY-----"));
  return texts;
}

}  // namespace sightline
