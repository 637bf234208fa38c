// SPDX-License-Identifier: Apache-2.0
// Precompiled for every room, program and test: what most sources include anyway and what is dear
// to parse. Sources still include what they use; SIGHTLINE_PCH=OFF builds without.
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/format.h>
