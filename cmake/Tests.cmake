# SPDX-License-Identifier: Apache-2.0
# Tests of a module are one program, so that its headers are read and its libraries linked once; CTest knows each
# group of sources in it by a name of its own.
set(SIGHTLINE_TEST_ENVIRONMENT
  "LSAN_OPTIONS=suppressions=${PROJECT_SOURCE_DIR}/deploy/sanitizers/leak.supp:print_suppressions=0"
  "TSAN_OPTIONS=ignore_noninstrumented_modules=1:suppressions=${PROJECT_SOURCE_DIR}/deploy/sanitizers/thread.supp:print_suppressions=0"
  "SIGHTLINE_SOURCE_DIR=${PROJECT_SOURCE_DIR}" "SIGHTLINE_BIN_DIR=${CMAKE_RUNTIME_OUTPUT_DIRECTORY}" "LP_NUM_THREADS=0")

# Properties of a test whose page has time limits of its own, in a browser: of the six jobs on two processors it leaves
# one, for a test that waits. Such tests begin first, before others take the jobs.
set(SIGHTLINE_NEARLY_ALONE PROCESSORS 5 COST 1000)

# sightline_test_program(NAME): the program of all following calls of sightline_test in this folder and below.
macro(sightline_test_program name)
  add_executable(${name})
  target_link_libraries(${name} PRIVATE sightline_options GTest::gmock GTest::gtest_main)
  sightline_optimise_less(${name})
  set(SIGHTLINE_TEST_PROGRAM ${name})
endmacro()

# sightline_test(NAME SOURCES... LIBRARIES... [DEFINITIONS...] [DEPENDS targets...] [TIMEOUT s] [DURATION s] [WAITS]):
# adds sources of GoogleTest tests to the module's program, and a test of CTest that runs the tests in these sources.
# DURATION: measured time, 10 s by default; longer tests begin earlier. WAITS: the test waits for processes or clocks
# most of the time. It takes one of CTest's jobs, other tests take two.
function(sightline_test name)
  cmake_parse_arguments(ARG "WAITS" "TIMEOUT;DURATION" "SOURCES;LIBRARIES;DEFINITIONS;DEPENDS" ${ARGN})
  set(program ${SIGHTLINE_TEST_PROGRAM})
  set(sources)
  foreach(source ${ARG_SOURCES})
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR} NORMALIZE)
    list(APPEND sources ${source})
  endforeach()
  # Several tests may name a helper.
  get_target_property(known ${program} SOURCES)
  foreach(source ${sources})
    if(NOT source IN_LIST known)
      target_sources(${program} PRIVATE ${source})
    endif()
  endforeach()
  target_link_libraries(${program} PRIVATE ${ARG_LIBRARIES})
  if(ARG_DEFINITIONS)
    set_property(SOURCE ${sources} TARGET_DIRECTORY ${program} APPEND PROPERTY COMPILE_DEFINITIONS ${ARG_DEFINITIONS})
  endif()
  if(ARG_DEPENDS)
    add_dependencies(${program} ${ARG_DEPENDS})
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 600)
  endif()
  if(SIGHTLINE_SANITIZE OR NOT CMAKE_BUILD_TYPE STREQUAL "Release")
    math(EXPR ARG_TIMEOUT "5 * ${ARG_TIMEOUT}")  # tests take longer without optimisation and with sanitizers
  endif()
  add_test(NAME ${name}
    COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/tests/run_sources.py $<TARGET_FILE:${program}> ${sources})
  if(NOT ARG_DURATION)
    set(ARG_DURATION 10)
  endif()
  set(jobs 2)
  if(ARG_WAITS)
    set(jobs 1)
  endif()
  # Long tests begin first, so that none runs alone at the end.
  set_tests_properties(${name} PROPERTIES TIMEOUT ${ARG_TIMEOUT} COST ${ARG_DURATION} PROCESSORS ${jobs}
    ENVIRONMENT "${SIGHTLINE_TEST_ENVIRONMENT}")
endfunction()
