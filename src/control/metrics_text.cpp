// SPDX-License-Identifier: Apache-2.0
#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>

#include <limits>

#include "sightline/control/http_server.hpp"

namespace sightline {
namespace {

prometheus::ClientMetric::Histogram histogram_of(const Registry::Sample& sample) {
  prometheus::ClientMetric::Histogram histogram;
  constexpr auto& kBounds = LatencyHistogram::kBounds;
  for (size_t step = 0; step < sample.cumulative.size(); ++step) {
    const double bound =
        step < kBounds.size() ? kBounds[step] : std::numeric_limits<double>::infinity();
    histogram.bucket.push_back({sample.cumulative[step], bound});
  }
  histogram.sample_count = sample.cumulative.back();
  histogram.sample_sum = sample.value;
  return histogram;
}

prometheus::MetricType type_of(Registry::Kind kind) {
  switch (kind) {
    case Registry::Kind::kCounter:
      return prometheus::MetricType::Counter;
    case Registry::Kind::kGauge:
      return prometheus::MetricType::Gauge;
    case Registry::Kind::kHistogram:
      return prometheus::MetricType::Histogram;
  }
  return prometheus::MetricType::Untyped;
}

prometheus::ClientMetric client_metric(const Registry::Sample& sample) {
  prometheus::ClientMetric metric;
  for (const auto& [name, value] : sample.labels) metric.label.push_back({name, value});
  if (sample.kind == Registry::Kind::kCounter) {
    metric.counter.value = sample.value;
  } else if (sample.kind == Registry::Kind::kHistogram) {
    metric.histogram = histogram_of(sample);
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
      families.push_back({sample.name, sample.help, type_of(sample.kind), {}});
    }
    families.back().metric.push_back(client_metric(sample));
  }
  return prometheus::TextSerializer().Serialize(families);
}

}  // namespace sightline
