// SPDX-License-Identifier: Apache-2.0
#include "detect/search_sheet.hpp"

#include <algorithm>

#include "sightline/image/convert.hpp"
#include "superimpose.hpp"

namespace sightline::cli {
namespace {

constexpr int kMaxCell = 640;  // [px] wide
constexpr Rgb kTruth{70, 225, 120}, kFound{255, 220, 0}, kWrong{255, 60, 40}, kBest{80, 150, 255};

OverlayStyle outline_in(const Rgb& color) {
  OverlayStyle style;
  style.circle = style.fill = style.label = style.offscreen = style.status = false;
  style.wireframe = true;
  style.color = color;
  return style;
}

// An odd last row or column takes no part.
void halve(const PlaneView& from, const MutablePlaneView& to) {
  halve_plane({from.data, 2 * to.width, 2 * to.height, from.stride}, to);
}

// Halved until it fits into a cell.
std::shared_ptr<const Image> shrunk(std::shared_ptr<const Image> image) {
  while (image->width() > kMaxCell) {
    auto half = std::make_shared<Image>(image->width() / 4 * 2, image->height() / 4 * 2);
    halve(image->view().y, half->mutable_view().y);
    halve(image->view().u, half->mutable_view().u);
    halve(image->view().v, half->mutable_view().v);
    image = std::move(half);
  }
  return image;
}

MutablePlaneView part(const MutablePlaneView& plane, int left, int top, const PlaneView& size) {
  return {plane.row(top) + left, size.width, size.height, plane.stride};
}

struct Outline {
  Rigid3 pose;
  Rgb color;
};

std::vector<Outline> outlines(const SetResult& result) {
  std::vector<Outline> out;
  if (result.truth) out.push_back({*result.truth, kTruth});
  const Rgb found = result.verdict == Verdict::kWrong ? kWrong : kFound;
  for (const PoseHypothesis& pose : result.found) out.push_back({pose.world_from_object, found});
  const bool not_believed = result.found.empty() && result.explanation && result.explanation->best;
  if (not_believed) out.push_back({*result.explanation->best, kBest});
  return out;
}

}  // namespace

Status SearchSheet::add(const SearchedObject& object, const SetResult& result,
                        const std::vector<FramePtr>& frames) {
  if (rows_.size() >= kMaxRows) return {};
  std::vector<std::shared_ptr<const Image>> row;
  for (size_t i = 0; i < frames.size(); ++i) {
    const CalibratedCamera& camera = object.installation->cameras[i].calibration;
    const auto& lens = camera.model.parameters();
    auto image = std::make_shared<Image>(lens.width, lens.height);
    frames[i]->copy_i420_to(image->mutable_view());
    for (const Outline& outline : outlines(result)) {
      SL_RETURN_IF_ERROR(draw_placed_mesh({object.rig->objects.front().mesh, outline.pose}, {},
                                          camera, object.rig->cameras[i]->rays(camera.model),
                                          outline_in(outline.color), *image));
    }
    row.push_back(shrunk(image));
  }
  rows_.push_back(std::move(row));
  return {};
}

std::shared_ptr<const Image> SearchSheet::draw() const {
  if (rows_.empty()) return nullptr;
  int cell_width = 0, cell_height = 0;
  size_t columns = 0;
  for (const auto& row : rows_) {
    columns = std::max(columns, row.size());
    for (const auto& image : row) {
      cell_width = std::max(cell_width, image->width());
      cell_height = std::max(cell_height, image->height());
    }
  }
  auto sheet = std::make_shared<Image>(static_cast<int>(columns) * cell_width,
                                       static_cast<int>(rows_.size()) * cell_height);
  const MutableI420View view = sheet->mutable_view();
  fill_plane(view.y, 16);
  fill_plane(view.u, 128);
  fill_plane(view.v, 128);
  for (size_t r = 0; r < rows_.size(); ++r) {
    for (size_t c = 0; c < rows_[r].size(); ++c) {
      const int left = static_cast<int>(c) * cell_width, top = static_cast<int>(r) * cell_height;
      const I420View cell = rows_[r][c]->view();
      copy_i420(cell, {part(view.y, left, top, cell.y), part(view.u, left / 2, top / 2, cell.u),
                       part(view.v, left / 2, top / 2, cell.v)});
    }
  }
  return sheet;
}

}  // namespace sightline::cli
