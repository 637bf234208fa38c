// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

namespace sightline {

/// A rectangle of frame pixels with even corner and size. It may reach one pixel past a frame of
/// odd size.
struct TileRect {
  int x = 0, y = 0, width = 0, height = 0;
  bool empty() const { return width <= 0 || height <= 0; }
  bool contains(int px, int py) const {
    return px >= x && px < x + width && py >= y && py < y + height;
  }
  bool operator==(const TileRect&) const = default;
};

/// What a rasterizer makes: per pixel the inverse depth of the nearest surface and its shade, or
/// the face that is seen there, to be shaded later (surface_shader.hpp).
/// Rows are 32-byte aligned; memory is kept between frames and only ever grows.
class RasterTile {
 public:
  /// Takes the place and size, and empties every pixel. With `faces`, rasterizers number the face
  /// of each pixel that they draw and leave shade() alone.
  void reset(const TileRect& rect, bool faces = false);

  const TileRect& rect() const { return rect_; }
  int width() const { return rect_.width; }
  int height() const { return rect_.height; }
  /// Elements from row to row of all planes: a multiple of 8, at least width().
  size_t stride() const { return stride_; }
  /// So many elements past the last row may be read; they have no meaning.
  static constexpr size_t kSlack = 64;

  /// Row `y` of the tile (0 .. height() - 1): 1/z [1/m], 0 where empty. Values between width() and
  /// stride() have no meaning.
  float* inverse_depth(int y) { return depth_.get() + static_cast<size_t>(y) * stride_; }
  const float* inverse_depth(int y) const {
    return depth_.get() + static_cast<size_t>(y) * stride_;
  }
  /// Lambert shade 0..255 under the light of backend.hpp.
  uint8_t* shade(int y) { return shade_.get() + static_cast<size_t>(y) * stride_; }
  const uint8_t* shade(int y) const { return shade_.get() + static_cast<size_t>(y) * stride_; }

  bool has_faces() const { return has_faces_; }
  static constexpr uint32_t kNoFace = 0xffffffff;
  /// Into RenderMesh::faces of the one mesh drawn since reset(); kNoFace beside it. Only with
  /// faces.
  uint32_t* face(int y) { return face_.get() + static_cast<size_t>(y) * stride_; }
  const uint32_t* face(int y) const { return face_.get() + static_cast<size_t>(y) * stride_; }

 private:
  struct Free {
    void operator()(void* p) const;
  };
  TileRect rect_;
  size_t stride_ = 0;
  size_t capacity_ = 0, face_capacity_ = 0;
  bool has_faces_ = false;
  std::unique_ptr<float[], Free> depth_;
  std::unique_ptr<uint8_t[], Free> shade_;
  std::unique_ptr<uint32_t[], Free> face_;
};

}  // namespace sightline
