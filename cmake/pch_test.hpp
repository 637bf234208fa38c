// SPDX-License-Identifier: Apache-2.0
// Precompiled for the tests.
#include "pch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
