# SPDX-License-Identifier: Apache-2.0
# Files that `cmake --install` installs, by component; cmake/Packages.cmake makes a package of each. The target
# `installables` builds it.
# Only programs that are built are installed: those of SIGHTLINE_PROGRAMS.
include(GNUInstallDirs)
find_package(Python3 COMPONENTS Interpreter)
if(NOT Python3_FOUND)
  message(STATUS "No Python 3: no man pages and completions")
endif()
add_custom_target(installables ALL)

# sightline_install_licence(COMPONENT PACKAGE): the licence, named as in Debian packages.
function(sightline_install_licence component package)
  install(FILES ${PROJECT_SOURCE_DIR}/deploy/packages/copyright
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} COMPONENT ${component})
endfunction()

# sightline_install_manual(TARGET COMPONENT [GROUPS...]): man page and completions of a program, made from its
# --help. GROUPS are the programs that the target starts for its commands. Commands of a group that is not
# built are left out.
set(sightline_manuals sightline coverage_server render_worker)
function(sightline_install_manual target component)
  if(NOT Python3_FOUND)
    return()
  endif()
  set(made ${PROJECT_BINARY_DIR}/deploy)
  set(generator ${PROJECT_SOURCE_DIR}/deploy/command_line)
  set(outputs ${made}/man/${target}.1.gz ${made}/bash/${target} ${made}/zsh/_${target})
  set(built ${ARGN})
  set(commands_of)
  foreach(group ${ARGN})
    if(TARGET ${group})
      list(APPEND commands_of --commands-of $<TARGET_FILE:${group}>)
    else()
      list(REMOVE_ITEM built ${group})
    endif()
  endforeach()
  if("${built}" STREQUAL "${ARGN}")
    set(commands_of)
  endif()
  add_custom_command(OUTPUT ${outputs}
    COMMAND ${Python3_EXECUTABLE} -B ${generator}/generate ${commands_of} $<TARGET_FILE:${target}> ${made}
      ${sightline_manuals}
    DEPENDS ${target} ${built} ${generator}/generate ${generator}/command_help.py ${generator}/completion.py
      ${generator}/man_page.py
    COMMENT "Man page and completions of ${target}"
    VERBATIM)
  add_custom_target(${target}_manual DEPENDS ${outputs})
  add_dependencies(installables ${target}_manual)
  install(FILES ${made}/man/${target}.1.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT ${component})
  install(FILES ${made}/bash/${target} DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
    COMPONENT ${component})
  # Debian's zsh looks into different folders below /usr and /usr/local.
  install(CODE "
    set(folder site-functions)
    if(CMAKE_INSTALL_PREFIX STREQUAL /usr)
      set(folder vendor-completions)
    endif()
    file(INSTALL \"${made}/zsh/_${target}\"
      DESTINATION \"\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DATADIR}/zsh/\${folder}\")"
    COMPONENT ${component})
endfunction()

# sightline_install_program(TARGET COMPONENT PACKAGE [GROUPS...]): a program that people start, with its manual.
function(sightline_install_program target component package)
  if(NOT TARGET ${target})
    return()
  endif()
  add_dependencies(installables ${target})
  install(TARGETS ${target} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT ${component})
  sightline_install_licence(${component} ${package})
  sightline_install_manual(${target} ${component} ${ARGN})
endfunction()

# sightline_install_group(TARGET COMPONENT PACKAGE): a program that `sightline` starts for a group of its commands.
# The programs find each other by these two folders.
function(sightline_install_group target component package)
  if(NOT TARGET ${target})
    return()
  endif()
  add_dependencies(installables ${target})
  install(TARGETS ${target} RUNTIME DESTINATION libexec/sightline COMPONENT ${component})
  sightline_install_licence(${component} ${package})
endfunction()

# sightline_install_service(NAME TARGET COMPONENT): a systemd unit and its file of options.
function(sightline_install_service name target component)
  if(NOT TARGET ${target})
    return()
  endif()
  install(CODE "
    set(SERVICE ${name})
    set(HERE \"${PROJECT_SOURCE_DIR}/deploy/systemd\")
    set(WORK \"${PROJECT_BINARY_DIR}/deploy/systemd\")
    include(\"${PROJECT_SOURCE_DIR}/deploy/systemd/install_service.cmake\")"
    COMPONENT ${component})
endfunction()

sightline_install_program(sightline client sightline sightline-plan sightline-render sightline-serve)
sightline_install_program(coverage_server coverage_server sightline-coverage-server)
sightline_install_program(render_worker render_worker sightline-render-worker)
sightline_install_program(sightline_step_import step_import sightline-step-import)
sightline_install_program(sightline_target_corners target_corners sightline-target-corners)
sightline_install_group(sightline-plan client sightline)
sightline_install_group(sightline-render render sightline-render)
sightline_install_group(sightline-serve serve sightline-serve)
sightline_install_service(sightline-serve sightline-serve serve)
sightline_install_service(sightline-coverage-server coverage_server coverage_server)
sightline_install_service(sightline-render-worker render_worker render_worker)

install(FILES README.md SECURITY.md LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT client)
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT client)
install(DIRECTORY examples DESTINATION ${CMAKE_INSTALL_DATADIR}/sightline COMPONENT client
  PATTERN CMakeLists.txt EXCLUDE
  PATTERN *.cpp EXCLUDE)
