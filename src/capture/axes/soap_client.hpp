// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/capture/axes/axis_source.hpp"

namespace sightline::capture {

/// One connection to a camera's services: SOAP over HTTP, with digest authentication where a user
/// is given. No proxy, no redirects, answers of at most 256 KiB. One thread at a time.
class SoapClient {
 public:
  static Result<SoapClient> create(const AxisSourceOptions& options, const std::string& name);
  SoapClient(SoapClient&& other) noexcept;
  SoapClient& operator=(SoapClient&& other) = delete;
  ~SoapClient();

  /// The answer to `body`, sent to `path`. Errors: kTimeout (none within the patience),
  /// kUnavailable (a fault), kInvalidInput (it wants another user or password).
  Result<std::string> ask(const std::string& path, const std::string& body, long patience_ms);

 private:
  struct Connection;
  explicit SoapClient(std::unique_ptr<Connection> connection);
  std::unique_ptr<Connection> connection_;
};

}  // namespace sightline::capture
