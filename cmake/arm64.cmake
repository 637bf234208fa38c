# SPDX-License-Identifier: Apache-2.0
# Toolchain for arm64 on another architecture: Debian's cross compiler, libraries of build/arm64-sysroot (made by
# scripts/deps --arm64), tests under qemu-user. Tools that run while building (protoc, esbuild) are the host's.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)

get_filename_component(SIGHTLINE_SYSROOT "${CMAKE_CURRENT_LIST_DIR}/../build/arm64-sysroot" ABSOLUTE)
if(DEFINED ENV{SIGHTLINE_SYSROOT})
  set(SIGHTLINE_SYSROOT "$ENV{SIGHTLINE_SYSROOT}")
endif()
if(NOT EXISTS "${SIGHTLINE_SYSROOT}/usr/include")
  message(FATAL_ERROR "no arm64 libraries in ${SIGHTLINE_SYSROOT}: scripts/deps --arm64")
endif()
set(CMAKE_SYSROOT "${SIGHTLINE_SYSROOT}")
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_SYSROOT_DIR} "${SIGHTLINE_SYSROOT}")
set(ENV{PKG_CONFIG_LIBDIR} "${SIGHTLINE_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${SIGHTLINE_SYSROOT}/usr/share/pkgconfig")

set(CMAKE_CROSSCOMPILING_EMULATOR "qemu-aarch64;-L;${SIGHTLINE_SYSROOT}")
