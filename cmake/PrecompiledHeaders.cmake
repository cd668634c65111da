# SPDX-License-Identifier: Apache-2.0
# Headers of libraries that most files include, compiled once for each kind of target: reading them
# anew costs a file about two seconds more than loading them. Files still include what they use; builds with sanitizers
# have no precompiled headers and find what is missing. GCC compiles a precompiled header out of the one that stands
# in its place: after a change of headers or flags delete build/release/**/*.gch, or other checkouts miss the compiler
# cache.
set(sightline_library_headers
  <algorithm> <array> <atomic> <cassert> <chrono> <cmath> <cstdint> <cstdio> <cstdlib> <cstring> <filesystem> <fstream>
  <functional> <limits> <map> <memory> <mutex> <numbers> <numeric> <optional> <set> <span> <sstream> <string>
  <string_view> <thread> <tuple> <utility> <vector>
  <Eigen/Cholesky> <Eigen/Core> <Eigen/Geometry>
  <absl/status/status.h> <absl/status/statusor.h> <absl/strings/match.h> <absl/strings/str_cat.h>
  <absl/strings/str_format.h> <absl/strings/str_join.h> <absl/time/time.h>
  <google/protobuf/message.h>)
# Loading what is not needed takes time as well: 0.7 s for gRPC. Only these folders have it.
set(sightline_grpc_folders coverage_server/service planner_client/commands planner_client/coverage_client
  planner_client/diagnosis_client planner_client/explore planner_client/rpc_client planning_service proto
  render_worker/service rpc_server tests/integration)

# sightline_headers(NAME HEADERS... LIBRARIES...): a target whose precompiled headers others reuse.
function(sightline_headers name)
  cmake_parse_arguments(ARG "" "" "HEADERS;LIBRARIES;OPTIONS" ${ARGN})
  set(source ${PROJECT_BINARY_DIR}/precompiled/${name}.cpp)
  file(CONFIGURE OUTPUT ${source} CONTENT "")
  add_library(${name} OBJECT ${source})
  target_link_libraries(${name} PRIVATE sightline_options Eigen3::Eigen absl::status absl::statusor absl::strings
    absl::time protobuf::libprotobuf gRPC::grpc++ ${ARG_LIBRARIES})
  target_compile_options(${name} PRIVATE ${ARG_OPTIONS})
  target_precompile_headers(${name} PRIVATE ${sightline_library_headers} ${ARG_HEADERS})
endfunction()

function(sightline_targets_below folder result)
  get_property(targets DIRECTORY ${folder} PROPERTY BUILDSYSTEM_TARGETS)
  get_property(folders DIRECTORY ${folder} PROPERTY SUBDIRECTORIES)
  foreach(below ${folders})
    sightline_targets_below(${below} more)
    list(APPEND targets ${more})
  endforeach()
  set(${result} ${targets} PARENT_SCOPE)
endfunction()

# To be called after all targets are known. What is optimised otherwise needs headers of its own; a target without
# the libraries has DISABLE_PRECOMPILE_HEADERS.
function(sightline_precompile_headers)
  set(targets ${ARGN})
  set(less "$<$<CONFIG:Release>:-O1>")
  foreach(with "" _grpc)
    set(grpc)
    if(with)
      set(grpc <grpcpp/grpcpp.h>)
    endif()
    sightline_headers(sightline_headers_full${with} HEADERS ${grpc})
    sightline_headers(sightline_headers_less${with} OPTIONS ${less} HEADERS ${grpc})
    if(SIGHTLINE_BUILD_TESTS)
      sightline_headers(sightline_headers_test${with} OPTIONS ${less} HEADERS ${grpc} <gmock/gmock.h> <gtest/gtest.h>
        LIBRARIES GTest::gmock)
    endif()
  endforeach()
  foreach(target ${targets})
    get_target_property(libraries ${target} LINK_LIBRARIES)
    get_target_property(options ${target} COMPILE_OPTIONS)
    get_target_property(own ${target} PRECOMPILE_HEADERS)
    get_target_property(none ${target} DISABLE_PRECOMPILE_HEADERS)
    get_target_property(type ${target} TYPE)
    if(own OR none OR type STREQUAL SHARED_LIBRARY OR NOT sightline_options IN_LIST libraries)
      continue()
    endif()
    set(kind full)
    if(less IN_LIST options)
      set(kind less)
      if(GTest::gmock IN_LIST libraries)
        set(kind test)
      endif()
    endif()
    # The target is written in the folder of its first source.
    get_target_property(sources ${target} SOURCES)
    get_target_property(folder ${target} SOURCE_DIR)
    list(GET sources 0 first)
    cmake_path(ABSOLUTE_PATH first BASE_DIRECTORY ${folder})
    foreach(grpc_folder ${sightline_grpc_folders})
      cmake_path(APPEND PROJECT_SOURCE_DIR ${grpc_folder} OUTPUT_VARIABLE grpc_path)
      cmake_path(IS_PREFIX grpc_path ${first} speaks_grpc)
      if(speaks_grpc)
        string(APPEND kind _grpc)
        break()
      endif()
    endforeach()
    target_precompile_headers(${target} REUSE_FROM sightline_headers_${kind})
    # GCC 12 forgets of code in precompiled headers that it is the system's, and warns of copies inside std::string that
    # cannot happen. Builds without precompiled headers have the warning.
    target_compile_options(${target} PRIVATE -Wno-array-bounds)
    # A file with options of its own does without.
    foreach(source ${sources})
      if(source MATCHES "^\\$<")
        continue()
      endif()
      cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${folder})
      get_property(own_options SOURCE ${source} DIRECTORY ${folder} PROPERTY COMPILE_OPTIONS)
      get_property(own_definitions SOURCE ${source} DIRECTORY ${folder} PROPERTY COMPILE_DEFINITIONS)
      if(own_options OR own_definitions)
        set_property(SOURCE ${source} DIRECTORY ${folder} PROPERTY SKIP_PRECOMPILE_HEADERS ON)
      endif()
    endforeach()
  endforeach()
endfunction()
