// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace sightline::observe {

/// The Huber function rho(e) = e^2/2 for e <= threshold, threshold (e - threshold/2) beyond, of an
/// error e >= 0 in sigmas, and its weight rho'(e)/e in iteratively re-weighted least squares
/// (Zhang, "Parameter estimation techniques", 1997, section 9.4).
class HuberLoss {
 public:
  explicit HuberLoss(double threshold) : threshold_(threshold) {}
  double weight(double error) const { return error <= threshold_ ? 1.0 : threshold_ / error; }
  double cost(double error) const {
    return error <= threshold_ ? error * error / 2 : threshold_ * (error - threshold_ / 2);
  }

 private:
  double threshold_;
};

}  // namespace sightline::observe
