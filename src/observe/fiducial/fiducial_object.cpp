// SPDX-License-Identifier: Apache-2.0
#include "observe/fiducial/fiducial_object.hpp"

#include <cmath>
#include <string>
#include <utility>

#include "observe/fiducial/board_layout.hpp"

namespace sightline::observe {
namespace {

Status check_board(const CharucoBoard& board, const std::string& where) {
  if (board.columns < 2 || board.rows < 2 || board.columns > 100 || board.rows > 100) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "board of {} x {} squares: 2 x 2 to 100 x 100 are possible", board.columns,
                      board.rows);
  }
  if (!(board.marker > 0) || !(board.square > board.marker) || !std::isfinite(board.square)) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "board with square {} m and marker {} m: the marker must be positive and "
                      "smaller than the square",
                      board.square, board.marker);
  }
  return {};
}

}  // namespace

std::array<Eigen::Vector2d, 4> square_corners(double size) {
  const double h = size / 2;
  return {Eigen::Vector2d(-h, h), Eigen::Vector2d(h, h), Eigen::Vector2d(h, -h),
          Eigen::Vector2d(-h, -h)};
}

Result<FiducialObject> make_fiducial_object(ObservedObject object,
                                            const std::shared_ptr<const CalibratedCamera>& camera) {
  FiducialObject out;
  out.id = object.id;
  out.description = std::move(object.description);
  const ObjectDescription& d = out.description;
  const std::string where = d.file.empty() ? d.name : d.file.string();
  for (const Fiducial& f : d.fiducials) {
    if (!(f.size > 0) || !std::isfinite(f.size)) {
      return make_error(ErrorCode::kInvalidInput, where,
                        "fiducial {} {}: size must be positive [m], not {}", f.family, f.id,
                        f.size);
    }
    SquareInObject square;
    const auto corners = square_corners(f.size);
    for (size_t k = 0; k < 4; ++k) {
      square[k] = f.object_from_fiducial * Eigen::Vector3d(corners[k].x(), corners[k].y(), 0);
    }
    out.squares.push_back(square);
  }
  if (!d.board) return out;
  SL_RETURN_IF_ERROR(check_board(*d.board, where));
  out.board = std::make_unique<BoardFinder>(*d.board, camera);
  // Its squares, for the region and the size of its markers.
  const BoardLayout layout(*d.board, false);
  for (int id = 0; id < layout.markers(); ++id) {
    SquareInObject square;
    for (size_t k = 0; k < 4; ++k) square[k] << layout.marker(id)[k], 0;
    out.squares.push_back(square);
  }
  return out;
}

}  // namespace sightline::observe
