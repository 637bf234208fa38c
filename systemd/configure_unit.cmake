# SPDX-License-Identifier: Apache-2.0
# Runs at installation: fills the unit with the real prefix.
get_filename_component(prefix "${CMAKE_INSTALL_PREFIX}" ABSOLUTE)
set(SIGHTLINE_PROGRAMS "${prefix}/${SIGHTLINE_BINDIR}")
configure_file("${SIGHTLINE_UNIT_SOURCE}" "${SIGHTLINE_UNIT_TARGET}" @ONLY)
