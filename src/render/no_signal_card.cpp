// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/no_signal_card.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <ctime>
#include <optional>

#include "sightline/base/check.hpp"
#include "sightline/base/log.hpp"
#include "text_tile.hpp"

namespace sightline {
namespace {

constexpr int kMostCharacters = 128;
constexpr int kMostLines = 2;
constexpr uint8_t kBlack = 16, kNoColor = 128, kPlainGrey = 72;
constexpr Yuv kTextColor{235, 128, 128};

// Half as bright: what is there can still be told, and nobody takes it for live.
void dim(const PlaneView& from, const MutablePlaneView& to) {
  for (int y = 0; y < to.height; ++y) {
    const uint8_t* in = from.row(y);
    uint8_t* out = to.row(y);
    for (int x = 0; x < to.width; ++x) {
      out[x] = static_cast<uint8_t>(kBlack + (std::max<int>(in[x], kBlack) - kBlack) / 2);
    }
  }
}

void fill(const MutablePlaneView& plane, uint8_t value) {
  for (int y = 0; y < plane.height; ++y) {
    std::memset(plane.row(y), value, static_cast<size_t>(plane.width));
  }
}

}  // namespace

std::string no_signal_text(std::string_view name, int64_t since_utc_ns) {
  const auto seconds = static_cast<time_t>(since_utc_ns / 1'000'000'000);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  return fmt::format("{}: no signal since {:02}:{:02}:{:02} UTC", name, parts.tm_hour, parts.tm_min,
                     parts.tm_sec);
}

struct NoSignalCard::Impl {
  int width, height;
  std::optional<TextTile> text;
};

NoSignalCard::NoSignalCard(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
NoSignalCard::~NoSignalCard() = default;

std::unique_ptr<NoSignalCard> NoSignalCard::create(int width, int height,
                                                   const std::filesystem::path& font_file) {
  auto impl = std::make_unique<Impl>();
  impl->width = width;
  impl->height = height;
  auto atlas = GlyphAtlas::create(font_file, std::clamp(height / 20, 12, 48));
  if (atlas) {
    impl->text.emplace(*std::move(atlas), kMostCharacters, kMostLines);
  } else {
    log::warning("pictures without signal bear no text: {}", atlas.error().message());
  }
  return std::unique_ptr<NoSignalCard>(new NoSignalCard(std::move(impl)));
}

void NoSignalCard::draw(const MutableI420View& picture, const I420View* last,
                        std::string_view text) {
  SL_CHECK(picture.width() == impl_->width && picture.height() == impl_->height,
           "the card is for another size");
  if (last) {
    SL_CHECK(last->width() == impl_->width && last->height() == impl_->height,
             "the last picture has another size");
    dim(last->y, picture.y);
  } else {
    fill(picture.y, kPlainGrey);
  }
  fill(picture.u, kNoColor);
  fill(picture.v, kNoColor);
  if (!impl_->text) return;
  TextTile& tile = *impl_->text;
  tile.set(text, {&kTextColor, 1});
  const size_t split = text.find(": ");
  if (tile.width() > impl_->width && split != std::string_view::npos) {
    std::string broken(text);
    broken[split + 1] = '\n';
    tile.set(broken, {&kTextColor, 1});
  }
  const int x = std::max(0, (impl_->width - tile.width()) / 2);
  const int y = std::max(0, (impl_->height - tile.height()) / 2);
  blend_tile(tile.at(x, y), picture);
}

}  // namespace sightline
