// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "sightline/base/counters.hpp"
#include "sightline/model/seams.hpp"

namespace sightline {

/// Brings a source's own numbers into the registry, once a second and when it is closed.
class MeteredSource final : public FrameSource {
 public:
  static constexpr const char* kEvents = "sightline_capture_events_total";
  static constexpr const char* kEventsHelp =
      "What the source of a camera met, by cause: frames lost, packets resent, ...";
  /// Value now, by cause; growing.
  using Causes = std::vector<std::pair<std::string, uint64_t>>;
  /// Asked on the thread that calls next().
  using Read = std::function<Causes()>;

  MeteredSource(std::unique_ptr<FrameSource> source, std::string camera, Registry& registry,
                Read read);
  ~MeteredSource() override;

  const SourceInfo& info() const override { return source_->info(); }
  Result<SourceStep> next(std::stop_token stop, Duration timeout) override;

 private:
  void publish();

  std::unique_ptr<FrameSource> source_;
  const std::string camera_;
  Registry& registry_;
  Read read_;
  Causes published_;
  Time next_publish_{};
};

}  // namespace sightline
