// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/mqtt.hpp"

namespace sightline {

bool mqtt_available() { return false; }

Result<std::unique_ptr<MqttClient>> MqttClient::create(const MqttOptions& options) {
  return make_error(ErrorCode::kUnavailable, options.host,
                    "this program was built without MQTT (libmosquitto)");
}

Result<std::unique_ptr<MqttClient>> MqttClient::create(const MqttOptions& options, MqttSession) {
  return create(options);
}

}  // namespace sightline
