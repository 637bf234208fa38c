// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "sightline/geometry/rigid3.hpp"

namespace sightline::bench {

/// Normalized estimation error squared over a sequence: of each axis (expectation 1), and of
/// rotation, position (3 each) and pose (6) together, each divided by its degrees of freedom.
/// Errors of neighboring estimates are alike, so a mean over n of them has the spread of fewer
/// independent ones: n (1 - r^2) / (1 + r^2), r the correlation of one with the next (first-order
/// Markov).
class Consistency {
 public:
  void add(const Vector6& off, const Matrix6& covariance) {
    Row row;
    for (int i = 0; i < 6; ++i) {
      row.axes[static_cast<size_t>(i)] = off[i] / std::sqrt(covariance(i, i));
    }
    const auto squared = [](const auto& error, const auto& block) {
      return error.dot(block.ldlt().solve(error));
    };
    const Eigen::Matrix3d rotation = covariance.topLeftCorner<3, 3>();
    const Eigen::Matrix3d position = covariance.bottomRightCorner<3, 3>();
    row.rotation = squared(Eigen::Vector3d(off.head<3>()), rotation) / 3;
    row.position = squared(Eigen::Vector3d(off.tail<3>()), position) / 3;
    row.pose = squared(off, covariance) / 6;
    rows_.push_back(row);
  }
  bool empty() const { return rows_.empty(); }

  /// Cells of a Markdown table: samples, independent ones, rx ry rz, tx ty tz, rotation, position,
  /// pose. A mean outside of its 95 % band is marked: < (covariance too wide), > (too narrow).
  std::string cells() const {
    double independent = 0;
    for (size_t i = 0; i < 6; ++i) independent += independent_samples(i) / 6;
    std::string out = fmt::format("{} | {:.0f}", rows_.size(), independent);
    for (size_t i = 0; i < 6; ++i) {
      double sum = 0;
      for (const Row& row : rows_) sum += row.axes[i] * row.axes[i];
      out += " | " + marked(sum / static_cast<double>(rows_.size()), independent_samples(i));
    }
    out += " | " + marked(mean(&Row::rotation), 3 * independent);
    out += " | " + marked(mean(&Row::position), 3 * independent);
    return out + " | " + marked(mean(&Row::pose), 6 * independent);
  }

 private:
  struct Row {
    std::array<double, 6> axes{};
    double rotation = 0, position = 0, pose = 0;
  };

  double mean(double Row::*value) const {
    double sum = 0;
    for (const Row& row : rows_) sum += row.*value;
    return sum / static_cast<double>(rows_.size());
  }
  double independent_samples(size_t axis) const {
    double squares = 0, products = 0;
    for (size_t i = 0; i < rows_.size(); ++i) {
      squares += rows_[i].axes[axis] * rows_[i].axes[axis];
      if (i > 0) products += rows_[i].axes[axis] * rows_[i - 1].axes[axis];
    }
    const auto n = static_cast<double>(rows_.size());
    const double r = std::clamp(squares > 0 ? products / squares : 0.0, 0.0, 0.999);
    return std::max(1.0, n * (1 - r * r) / (1 + r * r));  // of squares, which correlate by r^2
  }
  // Chi-square over its degrees of freedom (Wilson and Hilferty, 1931).
  static std::string marked(double value, double degrees) {
    const auto quantile = [degrees](double z) {
      return std::pow(1 - 2 / (9 * degrees) + z * std::sqrt(2 / (9 * degrees)), 3);
    };
    const char* mark = value < quantile(-1.96) ? " <" : value > quantile(1.96) ? " >" : "";
    return fmt::format("{:.2f}{}", value, mark);
  }

  std::vector<Row> rows_;
};

}  // namespace sightline::bench
