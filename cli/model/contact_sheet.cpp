// SPDX-License-Identifier: Apache-2.0
#include "model/contact_sheet.hpp"

#include <algorithm>
#include <cmath>

#include "model/sheet.hpp"

namespace sightline::cli {
namespace {

constexpr int kColumns = 8, kRows = 5, kCell = 240;  // [px]

constexpr SheetColor kYellow{210, 16, 146}, kGreen{145, 54, 34}, kBlue{120, 200, 90};

Result<CameraModel> sheet_camera(const ViewpointModel& model) {
  CameraModel::Parameters parameters;
  parameters.width = parameters.height = kCell;
  parameters.fx = parameters.fy =
      0.46 * kCell / std::tan(std::asin(1 / model.options().distance_radii));
  parameters.cx = parameters.cy = 0.5 * (kCell - 1);
  return CameraModel::create(parameters, "contact sheet");
}

class CellPainter {
 public:
  CellPainter(Sheet& sheet, const CameraModel& camera, const View& view, int left, int top)
      : sheet_(sheet), camera_(camera), view_(view), left_(left), top_(top) {}

  void depth(const DepthTile& tile, const ViewpointModel& model) {
    const double middle = model.options().distance_radii * model.radius();
    for (int y = 0; y < tile.height; ++y) {
      for (int x = 0; x < tile.width; ++x) {
        const float inverse = tile.row(y)[x];
        if (!(inverse > 0)) continue;
        const double nearness = (middle - 1 / double{inverse}) / model.radius();
        const double level = std::clamp(90 + 55 * nearness, 30.0, 150.0);
        sheet_.dot(left_ + tile.x + x, top_ + tile.y + y, {static_cast<uint8_t>(level), 128, 128});
      }
    }
  }
  void point(const Eigen::Vector3f& point_in_object, const SheetColor& color) {
    const auto pixel = camera_.project(view_.camera_from_object * point_in_object.cast<double>());
    if (!pixel) return;
    sheet_.dot(left_ + static_cast<int>(std::lround(pixel->x())),
               top_ + static_cast<int>(std::lround(pixel->y())), color);
  }
  void stroke(const Eigen::Vector3f& start, const Eigen::Vector3f& along, float length,
              const SheetColor& color) {
    for (int i = 0; i <= 6; ++i) point(start + static_cast<float>(i) / 6 * length * along, color);
  }

 private:
  Sheet& sheet_;
  const CameraModel& camera_;
  const View& view_;
  int left_, top_;
};

}  // namespace

Result<std::shared_ptr<const Image>> draw_contact_sheet(const ViewpointModel& model,
                                                        const DepthRendererFactory& factory) {
  SL_ASSIGN(const CameraModel camera, sheet_camera(model));
  const std::unique_ptr<DepthRenderer> renderer = factory(camera);
  const auto pixel = static_cast<float>(2 * model.radius() / (0.92 * kCell));
  Sheet sheet(kColumns * kCell, kRows * kCell);
  for (int i = 0; i < kColumns * kRows; ++i) {
    const size_t index = model.size() * static_cast<size_t>(i) / (kColumns * kRows);
    const View view = model.view(index);
    CellPainter painter(sheet, camera, view, i % kColumns * kCell, i / kColumns * kCell);
    painter.depth(renderer->render(view.camera_from_object), model);
    for (const InnerEdgeSample& edge : view.edges) {
      const SheetColor& color = edge.crease != 0 ? kGreen : kBlue;
      painter.stroke(edge.point, edge.tangent, 2 * pixel, color);
    }
    for (const ContourSample& sample : view.contour) {
      painter.stroke(sample.point, sample.normal, 4 * pixel, kYellow);
    }
  }
  return std::shared_ptr<const Image>(sheet.image());
}

}  // namespace sightline::cli
