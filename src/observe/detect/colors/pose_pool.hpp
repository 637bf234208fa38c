// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

#include "observe/detect/colors/mesh_colors.hpp"
#include "observe/detect/joint_search.hpp"
#include "sightline/base/executor.hpp"

namespace sightline::observe {

/// Fills JointPose::colors, on all threads. `colors` null: nothing.
void add_agreement(const MeshColors* colors, std::span<JointPose> poses, const Executor& executor);

/// Sorted by score, the best first; stable.
void sort_by_score(std::vector<JointPose>& poses);

/// The best pose of each cell of place [m] and rotation [rad], in their order, at most `max`.
std::vector<JointPose> thinned(std::span<const JointPose> poses, const Eigen::Vector3d& center,
                               double place_step, double angle_step, size_t max);

/// Which `max` to keep of what is sorted by score, the best first; in that order. `colored`: the
/// product of score and colors, for each; it is not asked of the first half of `max`. Those are the
/// best by score; where colors of the mesh agree with any other (a product above 0), the rest are
/// the best by the product. So colors that are not those of the object cost half of the places.
std::vector<size_t> best_halves(std::span<const float> colored, size_t max);

/// `max` of them, sorted by score: best_halves().
std::vector<JointPose> keep_best(std::vector<JointPose> poses, size_t max);

/// The same of many, thinned(): first those by score.
std::vector<JointPose> best_of_cells(std::vector<JointPose> poses, const Eigen::Vector3d& center,
                                     double place_step, double angle_step, size_t max);

/// Chooses at most so many of some poses.
using KeepPoses = std::function<std::vector<JointPose>(std::vector<JointPose>, size_t max)>;
/// The same of each distance from an eye, in steps of kDistanceStep: as many of each, at most `max`
/// of all; what one does not need the others have.
std::vector<JointPose> keep_of_each_distance(std::span<const JointPose> poses,
                                             const Eigen::Vector3d& eye,
                                             const Eigen::Vector3d& center, size_t max,
                                             const KeepPoses& keep);

}  // namespace sightline::observe
