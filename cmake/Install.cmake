# SPDX-License-Identifier: Apache-2.0
# What `cmake --install` installs, by component; cmake/Packages.cmake makes a package of each. The target
# `installables` builds it.
include(GNUInstallDirs)
find_package(Python3 REQUIRED COMPONENTS Interpreter)
add_custom_target(installables ALL)

# sightline_install_program(TARGET COMPONENT PACKAGE): the program, its man page, its completions, and
# the licence as Debian packages name it.
set(sightline_programs sightline coverage_server render_worker)
function(sightline_install_program target component package)
  set(made ${PROJECT_BINARY_DIR}/deploy)
  set(generator ${PROJECT_SOURCE_DIR}/deploy/command_line)
  set(outputs ${made}/man/${target}.1.gz ${made}/bash/${target} ${made}/zsh/_${target})
  add_custom_command(OUTPUT ${outputs}
    COMMAND ${Python3_EXECUTABLE} -B ${generator}/generate $<TARGET_FILE:${target}> ${made} ${sightline_programs}
    DEPENDS ${target} ${generator}/generate ${generator}/command_help.py ${generator}/completion.py
      ${generator}/man_page.py
    COMMENT "Man page and completions of ${target}"
    VERBATIM)
  add_custom_target(${target}_manual DEPENDS ${outputs})
  add_dependencies(installables ${target}_manual)
  install(TARGETS ${target} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT ${component})
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
  install(FILES ${PROJECT_SOURCE_DIR}/deploy/packages/copyright
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} COMPONENT ${component})
endfunction()

# sightline_install_service(NAME COMPONENT): a systemd unit and its file of options.
function(sightline_install_service name component)
  install(CODE "
    set(SERVICE ${name})
    set(HERE \"${PROJECT_SOURCE_DIR}/deploy/systemd\")
    set(WORK \"${PROJECT_BINARY_DIR}/deploy/systemd\")
    include(\"${PROJECT_SOURCE_DIR}/deploy/systemd/install_service.cmake\")"
    COMPONENT ${component})
endfunction()

sightline_install_program(sightline client sightline)
sightline_install_program(coverage_server coverage_server sightline-coverage-server)
sightline_install_program(render_worker render_worker sightline-render-worker)
if(TARGET sightline_step_import)
  sightline_install_program(sightline_step_import step_import sightline-step-import)
endif()
sightline_install_service(sightline-serve client)
sightline_install_service(sightline-coverage-server coverage_server)
sightline_install_service(sightline-render-worker render_worker)

install(FILES README.md LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT client)
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT client)
install(DIRECTORY examples DESTINATION ${CMAKE_INSTALL_DATADIR}/sightline COMPONENT client
  PATTERN CMakeLists.txt EXCLUDE
  PATTERN *.cpp EXCLUDE)
