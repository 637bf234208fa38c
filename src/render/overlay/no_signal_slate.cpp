// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/overlay/no_signal_slate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <optional>

#include "render/overlay/text/text_tile.hpp"
#include "sightline/base/check.hpp"
#include "sightline/base/log.hpp"
#include "sightline/image/convert.hpp"

namespace sightline {
namespace {

constexpr int kMaxCharacters = 128;
constexpr int kMaxLines = 2;
constexpr uint8_t kBlack = 16, kNoColor = 128, kPlainGray = 72;
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

}  // namespace

std::string no_signal_text(std::string_view name, int64_t since_utc_ns) {
  const auto seconds = static_cast<time_t>(since_utc_ns / 1'000'000'000);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  return fmt::format("{}: no signal since {:02}:{:02}:{:02} UTC", name, parts.tm_hour, parts.tm_min,
                     parts.tm_sec);
}

struct NoSignalSlate::Impl {
  int width, height;
  std::optional<TextTile> text;
};

NoSignalSlate::NoSignalSlate(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
NoSignalSlate::~NoSignalSlate() = default;

std::unique_ptr<NoSignalSlate> NoSignalSlate::create(int width, int height,
                                                     const std::filesystem::path& font_file) {
  auto impl = std::make_unique<Impl>();
  impl->width = width;
  impl->height = height;
  auto atlas = GlyphAtlas::create(font_file, std::clamp(height / 20, 12, 48));
  if (atlas) {
    impl->text.emplace(*std::move(atlas), kMaxCharacters, kMaxLines);
  } else {
    log::warning("images without signal bear no text: {}", atlas.error().message());
  }
  return std::unique_ptr<NoSignalSlate>(new NoSignalSlate(std::move(impl)));
}

void NoSignalSlate::draw(const MutableI420View& image, const I420View* last,
                         std::string_view text) {
  SL_CHECK(image.width() == impl_->width && image.height() == impl_->height,
           "the slate is for another size");
  if (last) {
    SL_CHECK(last->width() == impl_->width && last->height() == impl_->height,
             "the last image has another size");
    dim(last->y, image.y);
  } else {
    fill_plane(image.y, kPlainGray);
  }
  fill_plane(image.u, kNoColor);
  fill_plane(image.v, kNoColor);
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
  blend_tile(tile.at(x, y), image);
}

}  // namespace sightline
