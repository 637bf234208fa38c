// SPDX-License-Identifier: Apache-2.0
#include "control/gatekeeper.hpp"

#include <strings.h>

#include <algorithm>
#include <array>

namespace sightline::control {
namespace {

constexpr size_t kLongestHeader = 1024;

// RFC 4648; nullopt for anything that is not exactly that.
std::optional<std::string> from_base64(std::string_view text) {
  static constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const size_t padding = text.ends_with("==") ? 2 : text.ends_with("=") ? 1 : 0;
  if (text.empty() || text.size() % 4 != 0) return std::nullopt;
  text.remove_suffix(padding);
  std::string out;
  uint32_t bits = 0;
  int count = 0;
  for (const char c : text) {
    const size_t digit = kDigits.find(c);
    if (digit == std::string_view::npos) return std::nullopt;
    bits = bits << 6 | static_cast<uint32_t>(digit);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    out.push_back(static_cast<char>(bits >> count & 0xFF));
  }
  return out;
}

std::optional<std::string_view> after(std::string_view text, std::string_view scheme) {
  if (text.size() <= scheme.size() ||
      ::strncasecmp(text.data(), scheme.data(), scheme.size()) != 0) {
    return std::nullopt;
  }
  text.remove_prefix(scheme.size());
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  return text;
}

// Takes as long for a guess that is nearly right as for any other of its length.
bool same_secret(std::string_view a, std::string_view b) {
  unsigned differs = a.size() == b.size() ? 0 : 1;
  for (size_t i = 0; i < a.size(); ++i) {
    differs |= static_cast<unsigned char>(a[i]) ^
               static_cast<unsigned char>(b.empty() ? '\0' : b[i % b.size()]);
  }
  return differs == 0;
}

}  // namespace

std::optional<std::string> secret_of(std::string_view authorization) {
  if (authorization.size() > kLongestHeader) return std::nullopt;
  if (const auto bearer = after(authorization, "Bearer ")) return std::string(*bearer);
  const auto basic = after(authorization, "Basic ");
  const auto pair = basic ? from_base64(*basic) : std::nullopt;
  if (!pair) return std::nullopt;
  const size_t colon = pair->find(':');
  if (colon == std::string::npos) return std::nullopt;
  return pair->substr(colon + 1);
}

Gatekeeper::Gatekeeper(std::vector<AccessToken> tokens, Role anonymous)
    : tokens_(std::move(tokens)), anonymous_(tokens_.empty() ? Role::kOperator : anonymous) {}

Gatekeeper::Answer Gatekeeper::ask(std::string_view authorization, const PeerKey& peer, Time now) {
  if (authorization.empty() || tokens_.empty()) return {Verdict::kKnown, anonymous_};
  if (guesses_.exhausted(peer, now)) return {Verdict::kTooOften, Role::kNone};
  const auto secret = secret_of(authorization);
  const AccessToken* found = nullptr;
  for (const AccessToken& token : tokens_) {
    if (secret && same_secret(*secret, token.secret)) found = &token;
  }
  if (found != nullptr) return {Verdict::kKnown, found->role, found->name};
  guesses_.count(peer, now);
  return {Verdict::kWrong, Role::kNone};
}

}  // namespace sightline::control
