# SPDX-License-Identifier: Apache-2.0
# Runs at installation: fills the units with the real prefix. The template is the same service under another name
# for its configuration, state and cache: no two installations share a folder, since systemd gives the whole
# folder of a service to its dynamic user.
get_filename_component(prefix "${CMAKE_INSTALL_PREFIX}" ABSOLUTE)
set(SIGHTLINE_PROGRAMS "${prefix}/${SIGHTLINE_BINDIR}")

set(SIGHTLINE_INSTALLATION "sightline")
set(SIGHTLINE_FOLDER "sightline")
set(SIGHTLINE_TITLE "")
configure_file("${SIGHTLINE_UNIT_SOURCE}" "${SIGHTLINE_UNIT_FOLDER}/sightlined.service" @ONLY)

set(SIGHTLINE_INSTALLATION "%i")
set(SIGHTLINE_FOLDER "sightline-%i")
set(SIGHTLINE_TITLE " of %i")
configure_file("${SIGHTLINE_UNIT_SOURCE}" "${SIGHTLINE_UNIT_FOLDER}/sightlined@.service" @ONLY)
