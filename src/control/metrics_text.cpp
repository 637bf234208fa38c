// SPDX-License-Identifier: Apache-2.0
#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>

#include "sightline/control/http_server.hpp"

namespace sightline {
namespace {

prometheus::ClientMetric client_metric(const Registry::Sample& sample) {
  prometheus::ClientMetric metric;
  for (const auto& [name, value] : sample.labels) metric.label.push_back({name, value});
  if (sample.kind == Registry::Kind::kCounter) {
    metric.counter.value = sample.value;
  } else {
    metric.gauge.value = sample.value;
  }
  return metric;
}

}  // namespace

std::string metrics_text(const Registry& registry) {
  std::vector<prometheus::MetricFamily> families;
  for (const Registry::Sample& sample : registry.samples()) {
    if (families.empty() || families.back().name != sample.name) {
      const auto type = sample.kind == Registry::Kind::kCounter ? prometheus::MetricType::Counter
                                                                : prometheus::MetricType::Gauge;
      families.push_back({sample.name, sample.help, type, {}});
    }
    families.back().metric.push_back(client_metric(sample));
  }
  return prometheus::TextSerializer().Serialize(families);
}

}  // namespace sightline
