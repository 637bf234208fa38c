// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace sightline::observe {

/// OpenCV works in the calling thread alone from now on: threads are the daemon's, and results must
/// not depend on their number. Any number of threads at a time, which cv::setNumThreads() does not
/// stand: two at once are a crash inside TBB.
void keep_opencv_in_one_thread();

}  // namespace sightline::observe
