# SPDX-License-Identifier: Apache-2.0
# Debian packages, by `cpack -G DEB` in the build folder, of what the target `installables` built.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME sightline)
set(CPACK_PACKAGE_VENDOR Sightline)
set(CPACK_PACKAGE_CONTACT "Sightline developers <developers@sightline.invalid>" CACHE STRING
  "Who answers for the packages: NAME <MAIL>")
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
# Files of /etc are outside the prefix.
set(CPACK_SET_DESTDIR ON)
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)

set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

# sightline_package(TARGET COMPONENT NAME SUMMARY TEXT [ON_REQUEST] [DEPENDS ...] [RECOMMENDS ...]
#   [SUGGESTS ...] [SERVICE name] [KEPT_FOLDERS ...]): a package of the component, if its program is built.
#   ON_REQUEST: only made by `cpack -G DEB -D CPACK_COMPONENTS_ALL=COMPONENT`.
#   KEPT_FOLDERS: folders that the service makes, which a purge removes.
set(CPACK_COMPONENTS_ALL)
function(sightline_package target component name summary text)
  if(NOT TARGET ${target})
    return()
  endif()
  cmake_parse_arguments(ARG "ON_REQUEST" "SERVICE" "DEPENDS;RECOMMENDS;SUGGESTS;KEPT_FOLDERS" ${ARGN})
  if(NOT ARG_ON_REQUEST)
    set(CPACK_COMPONENTS_ALL ${CPACK_COMPONENTS_ALL} ${component} PARENT_SCOPE)
  endif()
  string(TOUPPER ${component} upper)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${name} PARENT_SCOPE)
  set(CPACK_DEBIAN_${upper}_DESCRIPTION "${summary}\n${text}" PARENT_SCOPE)
  foreach(kind DEPENDS RECOMMENDS SUGGESTS)
    list(JOIN ARG_${kind} ", " joined)
    set(CPACK_DEBIAN_${upper}_PACKAGE_${kind} "${joined}" PARENT_SCOPE)
  endforeach()
  if(NOT ARG_SERVICE)
    return()
  endif()
  set(SERVICE ${ARG_SERVICE})
  list(JOIN ARG_KEPT_FOLDERS " " KEPT_FOLDERS)
  set(made ${PROJECT_BINARY_DIR}/deploy/packages/${name})
  foreach(script postinst prerm postrm)
    configure_file(${PROJECT_SOURCE_DIR}/deploy/packages/${script}.in ${made}/${script} @ONLY
      FILE_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
  endforeach()
  file(WRITE ${made}/conffiles "/etc/default/${SERVICE}\n")
  set(CPACK_DEBIAN_${upper}_PACKAGE_CONTROL_EXTRA
    "${made}/postinst;${made}/prerm;${made}/postrm;${made}/conffiles" PARENT_SCOPE)
endfunction()

set(same "(= ${PROJECT_VERSION})")
sightline_package(sightline client sightline
  "plans machine-vision inspection by simulation"
  "Given a CAD part and a scanner of laser line, camera and linear stage, it
finds the few linear scans that measure the part's surface, and says how
many any plan would need."
  DEPENDS "sightline-coverage-server ${same}"
  RECOMMENDS "sightline-render ${same}"
  SUGGESTS "sightline-serve ${same}" "sightline-step-import ${same}")
sightline_package(sightline-render render sightline-render
  "simulated images and diagnosis of recordings for sightline"
  "The commands of sightline that are about images: it renders those that the
camera would record, chooses f-number, exposure and focus, and compares
recordings with the simulation."
  DEPENDS "sightline ${same}"
  RECOMMENDS "sightline-render-worker ${same}")
sightline_package(sightline-serve serve sightline-serve
  "planning service of sightline, by gRPC and HTTP"
  "Takes planning and rendering jobs from other programs and from a web page,
keeps them over restarts, and runs them here or on a cluster. The page on
which scans are explored by hand is part of it."
  DEPENDS "sightline ${same}"
  RECOMMENDS "sightline-render ${same}"
  SERVICE sightline-serve
  KEPT_FOLDERS /var/lib/sightline)
sightline_package(coverage_server coverage_server sightline-coverage-server
  "coverage of parts by laser scans, served by gRPC"
  "The engine behind the planner sightline: which points of a part's surface
a linear scan of laser line and camera measures, and how well. Other
programs may ask it as well."
  SERVICE sightline-coverage-server)
sightline_package(render_worker render_worker sightline-render-worker
  "images that a laser-line camera would record, served by gRPC"
  "Renders raw images as a given sensor would read them out: laser speckle,
defocus, light reflected between walls, noise of the sensor. It also says
what the description of recordings leaves out."
  SERVICE sightline-render-worker
  KEPT_FOLDERS /var/cache/sightline-render-worker)
# Its libraries bring X11.
sightline_package(sightline_step_import step_import sightline-step-import
  "STEP files and their tolerances for sightline"
  "Reads STEP (AP203, AP214, AP242) by OpenCASCADE and writes parts as GLB
and tolerances as JSON. The planner sightline starts it for STEP files."
  ON_REQUEST)
# Its libraries are OpenCV's.
sightline_package(sightline_target_corners target_corners sightline-target-corners
  "checkerboards in images for sightline"
  "Finds the corners of a checkerboard in images by OpenCV. The planner
sightline starts it to calibrate a real scanner."
  ON_REQUEST)
include(CPack)
