// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/metered_source.hpp"

namespace sightline {

using namespace std::chrono_literals;

MeteredSource::MeteredSource(std::unique_ptr<FrameSource> source, std::string camera,
                             Registry& registry, Read read)
    : source_(std::move(source)),
      camera_(std::move(camera)),
      registry_(registry),
      read_(std::move(read)) {}

MeteredSource::~MeteredSource() { publish(); }

Result<SourceStep> MeteredSource::next(std::stop_token stop, Duration timeout) {
  const Time now = MonotonicClock::now();
  if (now >= next_publish_) {
    next_publish_ = now + 1s;
    publish();
  }
  return source_->next(std::move(stop), timeout);
}

void MeteredSource::publish() {
  Causes now = read_();
  for (size_t i = 0; i < now.size(); ++i) {
    const uint64_t before = i < published_.size() ? published_[i].second : 0;
    registry_.counter(kEvents, kEventsHelp, {{"camera", camera_}, {"cause", now[i].first}})
        .add(now[i].second - before);
  }
  published_ = std::move(now);
}

}  // namespace sightline
