// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "calibrate/axes/head_adjust.hpp"
#include "calibrate/solve/covariance.hpp"

namespace sightline::calibrate {
namespace {

/// Derivatives of one setting's corners by all of the layout, and by the errors of its readings.
struct SettingBlock {
  Eigen::MatrixXd by_layout, by_error;
  Eigen::VectorXd error;
};

void add_columns(const Eigen::MatrixXd& from, const int* columns, Eigen::Index top,
                 Eigen::MatrixXd& to) {
  for (Eigen::Index i = 0; i < from.cols(); ++i) {
    if (columns[i] >= 0) to.col(columns[i]).segment(top, from.rows()) += from.col(i);
  }
}

void add_body(const SightLinearization& at, int body, double scale, Eigen::Index top,
              Eigen::MatrixXd& to) {
  if (body >= 0) to.block(top, body, at.body.rows(), 6) += scale * at.body;
}

bool block_of(const HeadProblem& problem, const HeadView& view, const HeadLayout& layout,
              SettingBlock& out) {
  const HeadModel& model = problem.model;
  Eigen::Vector2d angles;
  Eigen::Matrix<double, 2, 5> by_encoder;
  if (!angles_of(view, model.encoder, angles, &by_encoder)) return false;
  const HeadChain chain =
      chain_of(model.world_from_base, model.link, model.tilt_from_camera, angles + view.error);
  std::vector<SightLinearization> all(view.weights.size());
  Eigen::Index rows = 0;
  for (size_t s = 0; s < all.size(); ++s) {
    const BodySight& sight = view.setting->sights[s];
    if (!linearize(problem.sights->bodies[sight.body], sight, view.weights[s], model.lens,
                   model.lenses[view.lens].data(), chain.world_from_camera,
                   model.world_from_body[sight.body], true, all[s])) {
      return false;
    }
    rows += all[s].error.size();
  }
  const double scale = 1 / corner_sigma(problem, view);
  out.by_layout = Eigen::MatrixXd::Zero(rows, layout.size);
  out.by_error.resize(rows, 2);
  out.error.resize(rows);
  Eigen::Index top = 0;
  for (size_t s = 0; s < all.size(); ++s) {
    const Eigen::MatrixXd place = scale * all[s].place;
    const Eigen::MatrixXd by_angles = place * chain.by_angles;
    add_columns(place * chain.by_base, &layout.axes[kBase], top, out.by_layout);
    add_columns(place * chain.by_link, &layout.axes[kTwist], top, out.by_layout);
    add_columns(place, &layout.axes[kMount], top, out.by_layout);
    add_columns(by_angles * by_encoder, &layout.axes[kPanScale], top, out.by_layout);
    add_columns(scale * all[s].lens, layout.lens[view.lens].data(), top, out.by_layout);
    add_body(all[s], layout.body[view.setting->sights[s].body], scale, top, out.by_layout);
    out.by_error.middleRows(top, place.rows()) = by_angles;
    out.error.segment(top, place.rows()) = scale * all[s].error;
    top += place.rows();
  }
  return true;
}

/// A setting with the errors of its readings eliminated.
struct Eliminated {
  const HeadView* view;
  Eigen::Matrix2d inverse;    ///< of their own information
  Eigen::MatrixXd coupling;   ///< 2 x layout
  Eigen::MatrixXd layout;     ///< information of its corners on the layout, nothing eliminated
  double chi2 = 0, rows = 0;  ///< of its corners
};

/// What a camera that stands still says of a body.
struct FixedBlock {
  int column = -1;
  Matrix6 information;
};

std::vector<FixedBlock> add_fixed(const HeadProblem& problem, const HeadLayout& layout,
                                  Eigen::MatrixXd& information, HeadCovariance& out) {
  std::vector<FixedBlock> blocks;
  for (const FixedView& view : problem.fixed) {
    const size_t body = view.sight.sight.body;
    SightLinearization at;
    if (!linearize(problem.sights->bodies[body], view.sight.sight, view.weights, view.lens,
                   view.values.data(), view.world_from_camera, problem.model.world_from_body[body],
                   true, at)) {
      continue;
    }
    const double weight = 1 / (problem.sigma_px * problem.sigma_px);
    out.chi2 += weight * at.error.squaredNorm();
    out.freedom += static_cast<double>(at.error.size());
    const FixedBlock block{layout.body[body], weight * at.body.transpose() * at.body};
    if (block.column < 0) continue;
    information.block<6, 6>(block.column, block.column) += block.information;
    blocks.push_back(block);
  }
  return blocks;
}

void add_lenses(const HeadLayout& layout, Eigen::MatrixXd& information) {
  for (const std::vector<int>& lens : layout.lens) {
    for (size_t i = 4; i < lens.size(); ++i) {
      const double sigma = coefficient_sigma(static_cast<int>(i));
      if (lens[i] >= 0) information(lens[i], lens[i]) += 1 / (sigma * sigma);
    }
  }
}

/// Squares of residuals, and how many of them are free.
struct Component {
  double squares = 0, freedom = 0;
  double factor() const { return freedom > 0 ? squares / freedom : 1; }
};

/// By how much each component should change (Koch, "Parameter estimation and hypothesis testing in
/// linear models", 1999, section 3.6.2): the squares of its residuals over its redundancy, which is
/// how many there are less the trace of what the parameters took of them.
void add_components(const HeadProblem& problem, const std::vector<Eliminated>& settings,
                    const Component& fixed, HeadCovariance& out) {
  Component corners = fixed, moving, readings, jitter;
  const double own = problem.reading_sigma * problem.reading_sigma;
  for (const Eliminated& e : settings) {
    const Eigen::MatrixXd cross = e.inverse * e.coupling * out.matrix;  // of errors and layout
    const Eigen::Matrix2d covariance = e.inverse + cross * e.coupling.transpose() * e.inverse;
    const Eigen::Vector2d weights = e.view->weight * e.view->sigma.cwiseAbs2().cwiseInverse();
    const Eigen::Matrix2d seen = e.inverse.inverse() - Eigen::Matrix2d(weights.asDiagonal());
    Component& of = e.view->moving() ? moving : corners;
    of.squares += e.chi2;
    of.freedom += e.rows - out.matrix.cwiseProduct(e.layout).sum() +
                  2 * cross.cwiseProduct(e.coupling).sum() - (covariance * seen).trace();
    for (int axis = 0; axis < 2; ++axis) {
      const double variance = 1 / weights[axis];
      const double redundancy = 1 - covariance(axis, axis) / variance;
      const double square = e.view->error[axis] * e.view->error[axis] / variance;
      // Each counts for a component by the share that this has in what is expected of it.
      const double share = std::min(1.0, own / variance);
      readings.squares += share * square;
      readings.freedom += share * redundancy;
      if (!e.view->moving()) continue;
      jitter.squares += (1 - share) * square;
      jitter.freedom += (1 - share) * redundancy;
    }
  }
  out.corners = corners.factor();
  out.moving = moving.factor();
  out.readings = readings.factor();
  out.jitter = jitter.factor();
  out.redundancy_readings = readings.freedom;
  out.redundancy_jitter = jitter.freedom;
}

}  // namespace

HeadLayout layout_of(const HeadProblem& problem) {
  HeadLayout layout;
  layout.axes.fill(-1);
  for (int i = 0; i < kAxesParameters; ++i) {
    const bool free = i < kTwist      ? problem.free.base
                      : i < kPanScale ? true
                                      : problem.free.encoder[static_cast<size_t>(i - kPanScale)];
    if (free) layout.axes[static_cast<size_t>(i)] = layout.size++;
  }
  const int lens = 4 + coefficient_count(problem.model.lens);
  for (size_t l = 0; l < problem.model.lenses.size(); ++l) {
    layout.lens.emplace_back(12, -1);
    for (int i = 0; i < lens && problem.free.lens; ++i) {
      layout.lens[l][static_cast<size_t>(i)] = layout.size++;
    }
  }
  for (const char free : problem.free.bodies) {
    layout.body.push_back(free ? layout.size : -1);
    if (free) layout.size += 6;
  }
  return layout;
}

HeadCovariance head_covariance(const HeadProblem& problem) {
  HeadCovariance out;
  out.layout = layout_of(problem);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(out.layout.size, out.layout.size);
  std::vector<Eliminated> settings;
  const auto blocks = add_fixed(problem, out.layout, information, out);
  Component fixed{out.chi2, out.freedom};
  for (const HeadView& view : problem.views) {
    SettingBlock block;
    if (!view.used || !block_of(problem, view, out.layout, block)) continue;
    const Eigen::Vector2d weights = view.weight * view.sigma.cwiseAbs2().cwiseInverse();
    Eigen::Matrix2d own = block.by_error.transpose() * block.by_error;
    own += weights.asDiagonal();
    Eliminated e{&view,
                 own.inverse(),
                 block.by_error.transpose() * block.by_layout,
                 block.by_layout.transpose() * block.by_layout,
                 block.error.squaredNorm(),
                 static_cast<double>(block.error.size())};
    information += e.layout;
    information -= e.coupling.transpose() * e.inverse * e.coupling;
    out.chi2 += block.error.squaredNorm();
    out.freedom += static_cast<double>(block.error.size());
    settings.push_back(std::move(e));
  }
  for (const Eliminated& e : settings) {
    out.chi2 += e.view->weight * e.view->error.cwiseQuotient(e.view->sigma).squaredNorm();
  }
  out.freedom -= out.layout.size;  // the errors of readings are as many as are expected of them
  add_lenses(out.layout, information);
  out.matrix = scaled_inverse(information);
  if (out.matrix.size() == 0) return out;
  for (const FixedBlock& b : blocks) {
    const Matrix6 covariance = out.matrix.block<6, 6>(b.column, b.column);
    fixed.freedom -= covariance.cwiseProduct(b.information).sum();
  }
  add_components(problem, settings, fixed, out);
  return out;
}

}  // namespace sightline::calibrate
