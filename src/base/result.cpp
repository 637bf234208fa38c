// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/result.hpp"

namespace sightline {

int exit_code(const Error& error) {
  switch (error.code) {
    case ErrorCode::kInvalidInput:
    case ErrorCode::kNotFound:
    case ErrorCode::kDamaged:
      return 2;
    case ErrorCode::kUnavailable:
      return 3;
    case ErrorCode::kIo:
    case ErrorCode::kTimeout:
    case ErrorCode::kInternal:
      return 1;
  }
  return 1;
}

}  // namespace sightline
