# SPDX-License-Identifier: Apache-2.0
# cmake -D SOURCE_FOLDER= -D PROJECT_VERSION= -D GIVEN_COMMIT= -D IN= -D OUT= -P write_version.cmake
#
# Writes OUT from IN with the commit of SOURCE_FOLDER; an OUT that says it already stays untouched, so
# that nothing is compiled.
set(SIGHTLINE_COMMIT "${GIVEN_COMMIT}")
find_program(GIT git)
if(NOT SIGHTLINE_COMMIT AND GIT)
  # Sources unpacked inside another repository must not take its commit.
  cmake_path(GET SOURCE_FOLDER PARENT_PATH parent)
  set(ENV{GIT_CEILING_DIRECTORIES} "${parent}")
  # No lock, so that a build is not in the way of a commit made at the same time.
  set(git ${GIT} --no-optional-locks -C ${SOURCE_FOLDER})
  execute_process(COMMAND ${git} rev-parse --short=7 HEAD
    OUTPUT_VARIABLE SIGHTLINE_COMMIT OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  if(SIGHTLINE_COMMIT)
    execute_process(COMMAND ${git} status --porcelain --untracked-files=no
      OUTPUT_VARIABLE changes ERROR_QUIET)
    if(changes)
      string(APPEND SIGHTLINE_COMMIT "-dirty")
    endif()
  endif()
endif()
if(NOT SIGHTLINE_COMMIT)
  set(SIGHTLINE_COMMIT unknown)
endif()
configure_file("${IN}" "${OUT}" @ONLY)
