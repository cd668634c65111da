# SPDX-License-Identifier: Apache-2.0
# Unity builds: the sources of a target are compiled several at a time, so that headers are read and
# templates are instantiated once for all of them. The preset `incremental` does without, for work on a few files.
option(SIGHTLINE_UNITY_BUILD "Compile the sources of a target several at a time" OFF)
# How many sources one compilation takes at most. More of them read headers less often and need more memory: twelve of
# core need up to 1.4 GB.
set(SIGHTLINE_UNITY_BATCH 12 CACHE STRING "Sources that are compiled at a time")

# sightline_unity_build(TARGETS...): to be called after all sources are known.
function(sightline_unity_build)
  foreach(target ${ARGN})
    get_target_property(type ${target} TYPE)
    get_target_property(libraries ${target} LINK_LIBRARIES)
    if(NOT type MATCHES "_LIBRARY$|EXECUTABLE" OR type STREQUAL INTERFACE_LIBRARY OR
        NOT sightline_options IN_LIST libraries)
      continue()
    endif()
    # GCC takes joined sources for headers and warns of members of anonymous types: what has one source is not joined.
    get_target_property(sources ${target} SOURCES)
    get_target_property(folder ${target} SOURCE_DIR)
    list(LENGTH sources count)
    if(count LESS 2)
      continue()
    endif()
    foreach(source ${sources})
      if(NOT source MATCHES "\\.cpp$" OR source MATCHES "^\\$<")
        continue()
      endif()
      cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${folder} OUTPUT_VARIABLE path)
      # Functions with instruction sets of their own are compiled alone. CMake leaves out sources that have
      # options or definitions of their own.
      if(EXISTS ${path})
        file(STRINGS ${path} clones REGEX "core/cpu/function_clones.h")
        if(clones)
          set_property(SOURCE ${path} DIRECTORY ${folder} PROPERTY SKIP_UNITY_BUILD_INCLUSION ON)
        endif()
      endif()
    endforeach()
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${SIGHTLINE_UNITY_BATCH})
  endforeach()
endfunction()
