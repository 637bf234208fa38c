// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>

#include "sightline/image/convert.hpp"
#include "sightline/image/image.hpp"

namespace sightline::cli {

/// Y, U, V of a dot.
struct SheetColor {
  uint8_t y, u, v;
};

/// A dark picture that dots are put on; those beside it are left out.
class Sheet {
 public:
  Sheet(int width, int height) : image_(std::make_shared<Image>(width, height)) {
    fill_plane(image_->mutable_view().y, 16);
    fill_plane(image_->mutable_view().u, 128);
    fill_plane(image_->mutable_view().v, 128);
  }

  void dot(int x, int y, const SheetColor& color) {
    const MutableI420View view = image_->mutable_view();
    if (x < 0 || y < 0 || x >= view.width() || y >= view.height()) return;
    view.y.row(y)[x] = color.y;
    view.u.row(y / 2)[x / 2] = color.u;
    view.v.row(y / 2)[x / 2] = color.v;
  }
  const std::shared_ptr<Image>& image() const { return image_; }

 private:
  std::shared_ptr<Image> image_;
};

}  // namespace sightline::cli
