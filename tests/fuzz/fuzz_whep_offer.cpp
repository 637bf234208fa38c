// SPDX-License-Identifier: Apache-2.0
// SDP offers as browsers, and others, send them.
#include <cstddef>
#include <cstdint>
#include <string>

#include "sightline/base/check.hpp"
#include "stream/whep/offer.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using sightline::stream::read_offer;
  const std::string sdp(reinterpret_cast<const char*>(data), size);
  const auto offer = read_offer(sdp);
  if (!offer) {
    SL_CHECK(!offer.error().text.empty(), "every refusal says why");
    return 0;
  }
  SL_CHECK(offer->payload_type >= 1 && offer->payload_type <= 127, "a payload type");
  SL_CHECK(offer->media_line < 8, "one of its media");
  const std::string media = offer->sdp.substr(offer->sdp.find("\nm="));
  for (const char* const gone : {"\na=candidate:", "\na=remote-candidates:"}) {
    SL_CHECK(media.find(gone) == std::string::npos, "no medium names candidates");
  }
  // Whoever reads what is handed on sees the same video, if anything.
  const auto again = read_offer(offer->sdp);
  SL_CHECK(!again || (again->payload_type == offer->payload_type &&
                      again->media_line == offer->media_line),
           "it reads the same");
  return 0;
}
