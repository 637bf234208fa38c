// SPDX-License-Identifier: Apache-2.0
// What clients_test.py runs: prints COUNT poses of the daemon at PORT through the C++ header.
#include <cstdio>
#include <cstdlib>
#include <exception>

#include "sightline_poses.hpp"

int main(int argc, char** argv) {
  try {
    sightline_client::PoseStream stream("127.0.0.1", static_cast<uint16_t>(std::atoi(argv[1])),
                                        argc > 3 ? argv[3] : "");
    for (int i = std::atoi(argv[2]); i > 0; --i) {
      const auto pose = stream.next();
      if (!pose) return 1;
      std::printf("%s %s %lld %d %.17g %.17g\n", pose->object.c_str(), pose->state.c_str(),
                  static_cast<long long>(pose->t_ns), pose->has_pose ? 1 : 0,
                  pose->translation_m[0], pose->covariance[35]);
    }
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
