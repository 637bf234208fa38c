// SPDX-License-Identifier: Apache-2.0
#include "detect/search_sheet.hpp"

#include <algorithm>

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

// Every `step`-th pixel of every `step`-th row, averaged.
void shrink(const PlaneView& from, int step, const MutablePlaneView& to) {
  for (int y = 0; y < to.height; ++y) {
    for (int x = 0; x < to.width; ++x) {
      int sum = 0;
      for (int dy = 0; dy < step; ++dy) {
        for (int dx = 0; dx < step; ++dx) sum += from.row(y * step + dy)[x * step + dx];
      }
      to.row(y)[x] = static_cast<uint8_t>(sum / (step * step));
    }
  }
}

std::shared_ptr<const Image> shrunk(const std::shared_ptr<const Image>& image) {
  const int step = (image->width() + kMaxCell - 1) / kMaxCell;
  if (step == 1) return image;
  auto out = std::make_shared<Image>(image->width() / step / 2 * 2, image->height() / step / 2 * 2);
  shrink(image->view().y, step, out->mutable_view().y);
  shrink(image->view().u, step, out->mutable_view().u);
  shrink(image->view().v, step, out->mutable_view().v);
  return out;
}

void copy(const PlaneView& from, const MutablePlaneView& to, int left, int top) {
  for (int y = 0; y < from.height; ++y) {
    std::copy_n(from.row(y), from.width, to.row(top + y) + left);
  }
}

void fill(const MutablePlaneView& plane, uint8_t value) {
  for (int y = 0; y < plane.height; ++y) std::fill_n(plane.row(y), plane.width, value);
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
  fill(view.y, 16);
  fill(view.u, 128);
  fill(view.v, 128);
  for (size_t r = 0; r < rows_.size(); ++r) {
    for (size_t c = 0; c < rows_[r].size(); ++c) {
      const int left = static_cast<int>(c) * cell_width, top = static_cast<int>(r) * cell_height;
      const I420View cell = rows_[r][c]->view();
      copy(cell.y, view.y, left, top);
      copy(cell.u, view.u, left / 2, top / 2);
      copy(cell.v, view.v, left / 2, top / 2);
    }
  }
  return sheet;
}

}  // namespace sightline::cli
