// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "sightline/fuse/estimator.hpp"
#include "support/synthetic_rig.hpp"

namespace sightline {
namespace {
TEST(Estimator, Placeholder) {}
}  // namespace
}  // namespace sightline
