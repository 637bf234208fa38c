// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "control/connection_table.hpp"
#include "sightline/base/guess_limit.hpp"
#include "sightline/base/time.hpp"
#include "sightline/control/access.hpp"

namespace sightline::control {

/// The secret that an Authorization header brings: of "Bearer SECRET", or the password of "Basic".
std::optional<std::string> secret_of(std::string_view authorization);

/// Decides who is who by their token, and how often an address may guess. Passive and without a
/// clock of its own; one thread.
class Gatekeeper {
 public:
  /// Without `tokens` everybody is an operator. With them: `anonymous` without a token.
  Gatekeeper(std::vector<AccessToken> tokens, Role anonymous);

  enum class Verdict { kKnown, kWrong, kTooOften };
  struct Answer {
    Verdict verdict = Verdict::kKnown;
    Role role = Role::kNone;
    std::string name{};  ///< of the token; empty: anonymous
  };
  Answer ask(std::string_view authorization, const PeerKey& peer, Time now);

 private:
  const std::vector<AccessToken> tokens_;
  const Role anonymous_;
  GuessLimit<PeerKey> guesses_;
};

}  // namespace sightline::control
