# SPDX-License-Identifier: Apache-2.0
# Writes OUT, a C++ source that holds the files of LIST: one "PATH|TYPE|FILE" a line.
file(READ "${LIST}" text)
string(REPLACE ";" "\\;" text "${text}")
string(REGEX REPLACE "\n" ";" lines "${text}")
set(arrays "")
set(table "")
set(number 0)
foreach(line IN LISTS lines)
  if(line STREQUAL "")
    continue()
  endif()
  string(REGEX MATCH "^([^|]*)\\|([^|]*)\\|(.*)$" whole "${line}")
  set(path "${CMAKE_MATCH_1}")
  set(type "${CMAKE_MATCH_2}")
  file(READ "${CMAKE_MATCH_3}" hex HEX)
  string(LENGTH "${hex}" length)
  math(EXPR length "${length} / 2")
  string(REGEX REPLACE "(..)" "'\\\\x\\1'," bytes "${hex}")
  string(APPEND arrays "constexpr char kBytes${number}[] = {${bytes}0};\n")
  string(APPEND table "    {\"${path}\", \"${type}\", {kBytes${number}, ${length}}},\n")
  math(EXPR number "${number} + 1")
endforeach()
file(WRITE "${OUT}" "// Made by cmake/embed.cmake.
#include \"control/router.hpp\"
namespace sightline::control {
namespace {
${arrays}constexpr Asset kAssets[] = {
${table}};
}
std::span<const Asset> assets() { return kAssets; }
}
")
