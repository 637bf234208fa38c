// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "hidden_surfaces/scene.hpp"

namespace sightline::hidden_surfaces {

/// One way to find out which surface is seen at each pixel.
class Method {
 public:
  virtual ~Method() = default;
  virtual std::string_view name() const = 0;
  /// What serves every view of the same scene, until something in it moves: a tree, where the
  /// method has one.
  virtual void prepare(const Scene& /*scene*/) {}
  virtual void draw(const Scene& scene, Picture& picture) = 0;
  /// The most memory that it needed beside scene and picture.
  virtual size_t bytes() const = 0;
};

std::unique_ptr<Method> make_z_buffer();
std::unique_ptr<Method> make_painter();
std::unique_ptr<Method> make_bsp();
std::unique_ptr<Method> make_warnock();
std::unique_ptr<Method> make_ray_casting();

/// In this order.
std::vector<std::unique_ptr<Method>> all_methods();

}  // namespace sightline::hidden_surfaces
