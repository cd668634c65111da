# SPDX-License-Identifier: Apache-2.0
# Compiler settings of our own code. Libraries come in as SYSTEM.
find_program(SIGHTLINE_CCACHE ccache)
if(SIGHTLINE_CCACHE)
  # Paths below the tree count as relative, so that checkouts in different folders share the cache. Precompiled headers
  # of 200 MB are hashed once, not for every file.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_BASEDIR=${PROJECT_SOURCE_DIR}
    CCACHE_NOHASHDIR=true CCACHE_SLOPPINESS=pch_defines,time_macros CCACHE_INODECACHE=true ${SIGHTLINE_CCACHE})
endif()

# mold links sightline-plan in 0.7 s, GNU ld in 1.8 s (2026-11-28, beside other work). CMake has CMAKE_LINKER_TYPE from 3.29 on only.
find_program(SIGHTLINE_MOLD mold)
if(SIGHTLINE_MOLD)
  add_link_options(-fuse-ld=mold)
endif()
# A program loads the libraries whose symbols it uses, not all that its own libraries name: `sightline --help` needs
# neither gRPC nor protobuf.
add_link_options(-Wl,--as-needed)
# Sources that are compiled together would be linked together, whatever of them a program uses.
add_compile_options(-ffunction-sections -fdata-sections)
add_link_options(-Wl,--gc-sections)

add_library(sightline_options INTERFACE)
target_compile_options(sightline_options INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Werror
  # Same bytes on every machine: no fused multiply-add where one CPU has it and another has not.
  -ffp-contract=off)
target_include_directories(sightline_options INTERFACE ${PROJECT_SOURCE_DIR})

if(SIGHTLINE_FUZZ)
  add_compile_options(-fsanitize=fuzzer-no-link)
  # GCC decides about warnings.
  target_compile_options(sightline_options INTERFACE -Wno-error -Wno-unknown-warning-option)
endif()
if(SIGHTLINE_SANITIZE)
  add_compile_options(-fsanitize=${SIGHTLINE_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${SIGHTLINE_SANITIZE})
  # GCC 12 sees uninitialised members inside std::regex once it is instrumented.
  target_compile_options(sightline_options INTERFACE -Wno-maybe-uninitialized)
  # GCC cannot emit resolvers of target_clones under sanitizers.
  add_compile_definitions(SIGHTLINE_NO_TARGET_CLONES)
  if(SIGHTLINE_SANITIZE MATCHES thread)
    # With this macro, protobuf's map fields are eight bytes larger than in the distribution's library, which is built
    # without it, and reflection on them crashes. The
    # standard library, of headers alone, keeps what it does for the sanitizer.
    add_compile_options(-U__SANITIZE_THREAD__)
    add_compile_definitions(_GLIBCXX_TSAN=1)
  endif()
endif()

# sightline_optimise_less(TARGETS...): code that waits for servers, people or disks, and tests. Full optimisation costs
# a third of its build without a noticeable gain.
function(sightline_optimise_less)
  foreach(target ${ARGN})
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
  endforeach()
endfunction()
