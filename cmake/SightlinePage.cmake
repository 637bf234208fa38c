# SPDX-License-Identifier: Apache-2.0
# sightline_page(TARGET): the page (web/) and the API's description as sources of TARGET, so that the daemon needs no
# files beside itself. esbuild makes one script of the TypeScript; without it there is the API, and no page.
find_program(SIGHTLINE_ESBUILD esbuild)
function(sightline_page target)
  set(web "${PROJECT_SOURCE_DIR}/web")
  set(out "${PROJECT_BINARY_DIR}/generated/web")
  set(assets "/api/v1/openapi.json|application/json|${PROJECT_SOURCE_DIR}/src/control/openapi.json")
  if(SIGHTLINE_ESBUILD)
    file(GLOB scripts CONFIGURE_DEPENDS "${web}/*.ts")
    add_custom_command(
      OUTPUT "${out}/app.js"
      COMMAND "${SIGHTLINE_ESBUILD}" "${web}/app.ts" --bundle --minify --target=es2020 --format=iife
              --charset=utf8 --log-level=warning "--outfile=${out}/app.js"
      DEPENDS ${scripts}
      VERBATIM)
    list(APPEND assets "/|text/html$<SEMICOLON> charset=utf-8|${web}/index.html"
                       "/app.js|text/javascript$<SEMICOLON> charset=utf-8|${out}/app.js"
                       "/style.css|text/css$<SEMICOLON> charset=utf-8|${web}/style.css"
                       "/icon.svg|image/svg+xml|${web}/icon.svg")
  else()
    message(STATUS "no esbuild: the daemon is built without its page")
  endif()
  set(files "")
  set(list "")
  foreach(asset IN LISTS assets)
    string(REGEX REPLACE ".*\\|" "" file "${asset}")
    list(APPEND files "${file}")
    string(APPEND list "${asset}\n")
  endforeach()
  file(GENERATE OUTPUT "${out}/assets.txt" CONTENT "${list}")
  add_custom_command(
    OUTPUT "${out}/assets.cpp"
    COMMAND "${CMAKE_COMMAND}" "-DLIST=${out}/assets.txt" "-DOUT=${out}/assets.cpp" -P
            "${PROJECT_SOURCE_DIR}/cmake/embed.cmake"
    DEPENDS ${files} "${out}/assets.txt" "${PROJECT_SOURCE_DIR}/cmake/embed.cmake"
    VERBATIM)
  target_sources(${target} PRIVATE "${out}/assets.cpp")
endfunction()
