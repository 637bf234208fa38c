// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "publish/cell/cell_wire_parts.hpp"
#include "publish/cell/wire_names.hpp"
#include "sightline/publish/cell/cell_bid.hpp"

namespace sightline {
namespace {

using namespace publish;

constexpr size_t kLongestCell = 256;  // the name of one, a topic
constexpr double kFarthest = 1e6;     // [m]

bool is_cell(std::string_view name) {
  return name.size() <= kLongestCell && is_utf8(name) && std::ranges::none_of(name, [](char c) {
           return static_cast<uint8_t>(c) < 0x20 || c == '+' || c == '#';
         });
}

}  // namespace

std::string encode(const CellBid& bid) {
  cell::v1::Bid out;
  put_sender(bid, out);
  out.set_object(bid.object);
  out.set_state(static_cast<uint32_t>(bid.state));
  out.set_sigma(bid.sigma);
  out.set_holds(bid.holds);
  out.set_term(bid.term);
  out.set_from_utc_ns(bid.from_utc_ns);
  out.set_next(bid.next);
  out.set_until_utc_ns(bid.until_utc_ns);
  return out.SerializeAsString();
}

Result<CellBid> decode_bid(std::string_view bytes) {
  SL_ASSIGN(const cell::v1::Bid in, parse<cell::v1::Bid>(bytes));
  CellBid out;
  SL_RETURN_IF_ERROR(read_sender(in, out));
  out.object = in.object();
  if (!is_object_name(out.object)) return refuse("lacks a name");
  out.from_utc_ns = in.from_utc_ns();
  out.until_utc_ns = in.until_utc_ns();
  const auto is_said = [](int64_t ns) { return ns == 0 || is_utc(ns); };
  if (!is_said(out.from_utc_ns) || !is_said(out.until_utc_ns)) {
    return refuse("has a time that is none");
  }
  if (in.state() > static_cast<uint32_t>(TrackState::kLost)) return refuse("has no such state");
  out.state = static_cast<TrackState>(in.state());
  out.sigma = in.sigma();
  if (!(out.sigma >= 0 && out.sigma <= kFarthest)) return refuse("has a sigma that is none");
  out.holds = in.holds();
  out.term = in.term();
  // Terms are times; one that is far ahead would be in force for ever.
  if (!is_said(static_cast<int64_t>(out.term))) return refuse("has a term that is none");
  out.next = in.next();
  if (!is_cell(out.next)) return refuse("lacks a name");
  return out;
}

}  // namespace sightline
