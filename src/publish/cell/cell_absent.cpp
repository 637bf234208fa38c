// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/cell_bid.hpp"
#include "sightline/publish/cell/cell_messages.hpp"
#include "sightline/publish/cell/cell_order.hpp"

namespace sightline {
namespace {

Error absent() {
  return make_error(ErrorCode::kUnavailable, "[cell]",
                    "this program was built without protobuf or libmosquitto");
}

}  // namespace

bool cell_available() { return false; }
std::string encode(const CellObservation&) { return {}; }
std::string encode(const CellTrack&) { return {}; }
std::string encode(const CellHostState&) { return {}; }
std::string encode(const CellOrder&) { return {}; }
std::string encode(const CellBid&) { return {}; }
Result<CellBid> decode_bid(std::string_view) { return absent(); }
Result<CellOrder> decode_order(std::string_view) { return absent(); }
Result<CellObservation> decode_observation(std::string_view) { return absent(); }
Result<CellTrack> decode_track(std::string_view) { return absent(); }
Result<CellHostState> decode_host_state(std::string_view) { return absent(); }

}  // namespace sightline
