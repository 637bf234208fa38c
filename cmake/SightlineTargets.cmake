# SPDX-License-Identifier: Apache-2.0
# Functions that make rooms, programs, tests and fuzzers alike.

macro(sightline_global_flags)
  set(CMAKE_CXX_STANDARD 20)
  set(CMAKE_CXX_STANDARD_REQUIRED ON)
  set(CMAKE_CXX_EXTENSIONS OFF)
  set(CMAKE_POSITION_INDEPENDENT_CODE ON)
  # Programs as libraries are compiled, so that they can share precompiled headers.
  set(CMAKE_CXX_COMPILE_OPTIONS_PIE "-fPIC")
  set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
  set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/bin")
  find_program(SIGHTLINE_CCACHE ccache)
  if(SIGHTLINE_CCACHE)
    # What ccache asks for with precompiled headers.
    set(CMAKE_CXX_COMPILER_LAUNCHER "${CMAKE_COMMAND}" -E env "CCACHE_SLOPPINESS=pch_defines,time_macros"
                                    "${SIGHTLINE_CCACHE}")
  endif()
  add_library(sightline_flags INTERFACE)
  target_include_directories(sightline_flags INTERFACE "${PROJECT_SOURCE_DIR}/include")
  # The same in all targets, so that they can share precompiled headers.
  target_compile_options(sightline_flags INTERFACE -pthread)
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64|amd64")
    target_compile_definitions(sightline_flags INTERFACE SIGHTLINE_X86_64)
  else()
    # Where every processor multiplies and adds in one rounding, poses would differ from those of an x86-64.
    target_compile_options(sightline_flags INTERFACE -ffp-contract=off)
  endif()
  target_compile_options(sightline_flags INTERFACE -Wall -Wextra -Wconversion -Wshadow)
  if(SIGHTLINE_STRICT)
    target_compile_options(sightline_flags INTERFACE -Werror)
  endif()
  if(SIGHTLINE_SANITIZE)
    # Global, so that every object of the program agrees.
    add_compile_options(-fsanitize=${SIGHTLINE_SANITIZE} -fno-omit-frame-pointer)
    add_link_options(-fsanitize=${SIGHTLINE_SANITIZE})
    # What g++ 12 warns of by following values misleads it where the instrumentation splits a test or
    # keeps strings from being inlined; the release build has these warnings.
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      add_compile_options(-Wno-maybe-uninitialized -Wno-array-bounds -Wno-restrict -Wno-stringop-overflow
                          -Wno-stringop-overread)
    endif()
    if(SIGHTLINE_SANITIZE MATCHES "undefined")
      add_compile_options(-fno-sanitize-recover=undefined)
    endif()
  endif()
  if(SIGHTLINE_COVERAGE)
    add_compile_options(--coverage)
    add_link_options(--coverage)
  endif()
  if(SIGHTLINE_FUZZ)
    add_compile_options(-fsanitize=fuzzer-no-link)
    add_link_options(-fsanitize=fuzzer-no-link)
  endif()
endmacro()

# The dependencies every room may need; a room names its own extra ones in its CMakeLists.txt.
macro(sightline_find_dependencies)
  find_package(PkgConfig REQUIRED)
  find_package(Threads REQUIRED)
  find_package(Eigen3 3.4 REQUIRED NO_MODULE)
  find_package(fmt REQUIRED)
  find_package(spdlog REQUIRED)
endmacro()

# sightline_make_pch(): the targets sightline_pch and, with tests, sightline_pch_test.
function(sightline_make_pch)
  if(NOT SIGHTLINE_PCH)
    return()
  endif()
  add_library(sightline_pch STATIC "${PROJECT_SOURCE_DIR}/cmake/pch.cpp")
  target_link_libraries(sightline_pch PRIVATE sightline_flags Eigen3::Eigen fmt::fmt)
  target_precompile_headers(sightline_pch PRIVATE "${PROJECT_SOURCE_DIR}/cmake/pch.hpp")
  if(SIGHTLINE_TESTS)
    find_package(GTest REQUIRED)
    add_library(sightline_pch_test STATIC "${PROJECT_SOURCE_DIR}/cmake/pch.cpp")
    target_link_libraries(sightline_pch_test PRIVATE sightline_flags Eigen3::Eigen fmt::fmt GTest::gtest GTest::gmock)
    target_precompile_headers(sightline_pch_test PRIVATE "${PROJECT_SOURCE_DIR}/cmake/pch_test.hpp")
  endif()
endfunction()

# Uses the precompiled header of another target. Sources with compile options of their own go without.
function(sightline_precompile target from)
  if(TARGET ${from})
    target_precompile_headers(${target} REUSE_FROM ${from})
    target_link_libraries(${target} PRIVATE Eigen3::Eigen fmt::fmt)
  endif()
endfunction()

# sightline_source_options(OPTIONS SOURCE...): compile options of single sources (of the calling folder).
function(sightline_source_options options)
  set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS "${options}" SKIP_PRECOMPILE_HEADERS ON)
endfunction()

# sightline_room(NAME ROOMS base ... LIBRARIES X::X ... [EXCLUDE regex ...])
# Static library sightline_NAME of every .cpp in the room's folder and its sub-rooms, less those that a
# regular expression of EXCLUDE matches (optional parts). Private headers are included by their path
# from src/; vendor libraries are linked privately.
function(sightline_room name)
  cmake_parse_arguments(ARG "" "" "ROOMS;LIBRARIES;EXCLUDE" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS RELATIVE "${CMAKE_CURRENT_SOURCE_DIR}" "*.cpp" "*/*.cpp" "*/*/*.cpp")
  foreach(pattern IN LISTS ARG_EXCLUDE)
    list(FILTER sources EXCLUDE REGEX "${pattern}")
  endforeach()
  add_library(sightline_${name} STATIC ${sources})
  target_link_libraries(sightline_${name} PUBLIC sightline_flags)
  foreach(room IN LISTS ARG_ROOMS)
    target_link_libraries(sightline_${name} PUBLIC sightline_${room})
  endforeach()
  target_link_libraries(sightline_${name} PRIVATE ${ARG_LIBRARIES})
  target_include_directories(sightline_${name} PRIVATE "${PROJECT_SOURCE_DIR}/src")
  sightline_precompile(sightline_${name} sightline_pch)
endfunction()

# sightline_test(NAME SOURCES x_test.cpp ... ROOMS geometry ... [LIBRARIES ...] [LABELS ...] [TIMEOUT s])
# One GoogleTest program, one CTest entry named NAME. Exit status 77 means skipped. Its folder becomes a label,
# `room_FOLDER`, and a target, `tests_FOLDER`, so that what a change touches can be built and run alone.
function(sightline_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT" "SOURCES;ROOMS;LIBRARIES;LABELS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE sightline_flags ${ARG_LIBRARIES} GTest::gtest GTest::gmock
                                        GTest::gtest_main)
  foreach(room IN LISTS ARG_ROOMS)
    target_link_libraries(${name} PRIVATE sightline_${room})
  endforeach()
  target_include_directories(${name} PRIVATE "${PROJECT_SOURCE_DIR}/tests")
  sightline_precompile(${name} sightline_pch_test)
  target_compile_definitions(${name} PRIVATE SIGHTLINE_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
                                             SIGHTLINE_BINARY_DIR="${PROJECT_BINARY_DIR}")
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  if(SIGHTLINE_SANITIZE)  # what renders its images takes ten times as long
    math(EXPR ARG_TIMEOUT "4 * ${ARG_TIMEOUT}")
  endif()
  add_test(NAME ${name} COMMAND ${name} WORKING_DIRECTORY "${PROJECT_SOURCE_DIR}")
  get_filename_component(folder "${CMAKE_CURRENT_SOURCE_DIR}" NAME)
  set_tests_properties(${name} PROPERTIES TIMEOUT ${ARG_TIMEOUT} SKIP_RETURN_CODE 77
                                          LABELS "room_${folder};${ARG_LABELS}")
  if(NOT TARGET tests_${folder})
    add_custom_target(tests_${folder})
  endif()
  add_dependencies(tests_${folder} ${name})
endfunction()

# sightline_fuzzer(NAME SOURCES f.cpp ROOMS ... CORPUS dir)
# The source defines LLVMFuzzerTestOneInput. With SIGHTLINE_FUZZ it links libFuzzer; otherwise it is
# linked with tests/fuzz/replay_main.cpp, which runs the corpus plus mutated copies of it, as a test.
function(sightline_fuzzer name)
  cmake_parse_arguments(ARG "" "CORPUS" "SOURCES;ROOMS;LIBRARIES" ${ARGN})
  if(SIGHTLINE_FUZZ)
    add_executable(${name} ${ARG_SOURCES})
    target_link_options(${name} PRIVATE -fsanitize=fuzzer)
  else()
    add_executable(${name} ${ARG_SOURCES} "${PROJECT_SOURCE_DIR}/tests/fuzz/replay_main.cpp")
    add_test(NAME ${name} COMMAND ${name} "${ARG_CORPUS}")
    set_tests_properties(${name} PROPERTIES TIMEOUT 300 LABELS fuzz)
  endif()
  target_link_libraries(${name} PRIVATE sightline_flags ${ARG_LIBRARIES})
  foreach(room IN LISTS ARG_ROOMS)
    target_link_libraries(${name} PRIVATE sightline_${room})
  endforeach()
endfunction()
