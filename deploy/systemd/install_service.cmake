# SPDX-License-Identifier: Apache-2.0
# Included while installing, with SERVICE (a name), HERE (this folder) and WORK (a folder for what is
# made): the unit and its file of options. Only now is the prefix known, which --prefix and cpack change.
cmake_path(ABSOLUTE_PATH CMAKE_INSTALL_PREFIX NORMALIZE OUTPUT_VARIABLE prefix)
set(BINDIR "${prefix}/bin")
set(SYSCONFDIR "${prefix}/etc")
if(prefix STREQUAL "/usr")
  set(SYSCONFDIR /etc)
endif()
file(READ "${HERE}/hardening.in" HARDENING)
configure_file("${HERE}/${SERVICE}.service.in" "${WORK}/${SERVICE}.service" @ONLY)
file(INSTALL "${WORK}/${SERVICE}.service" DESTINATION "${prefix}/lib/systemd/system")
# Somebody may have changed the options.
if(NOT EXISTS "$ENV{DESTDIR}${SYSCONFDIR}/default/${SERVICE}")
  file(INSTALL "${HERE}/${SERVICE}.default" DESTINATION "${SYSCONFDIR}/default" RENAME "${SERVICE}")
endif()
