// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/opencv_threads.hpp"

#include <mutex>
#include <opencv2/core/utility.hpp>

namespace sightline::observe {

void keep_opencv_in_one_thread() {
  static std::once_flag once;
  std::call_once(once, [] { cv::setNumThreads(1); });
}

}  // namespace sightline::observe
