# SPDX-License-Identifier: Apache-2.0
# Debian packages, `cpack` in a build with -DPALPATE_PACKAGES=ON: palpate (the programs, their man
# page and completion), libpalpate-dev (static libraries, headers, CMake's and pkg-config's files)
# and python3-palpate, as far as they are built. The drivers load vendors' libraries when they are
# asked for, so they are no packages of their own.
set(generated ${CMAKE_CURRENT_BINARY_DIR}/manual)
add_custom_command(OUTPUT ${generated}/palpate.1.gz ${generated}/palpate
  COMMAND ${CMAKE_COMMAND} -E make_directory ${generated}
  COMMAND /usr/bin/python3 ${PROJECT_SOURCE_DIR}/scripts/manual.py $<TARGET_FILE:palpate-lab>
          ${generated}
  DEPENDS palpate-lab ${PROJECT_SOURCE_DIR}/scripts/manual.py VERBATIM)
add_custom_target(palpate_manual ALL DEPENDS ${generated}/palpate.1.gz)
install(TARGETS palpate-lab COMPONENT program)
install(FILES ${generated}/palpate.1.gz COMPONENT program DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
install(FILES ${generated}/palpate COMPONENT program
        DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)

set(components program dev)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME palpate)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION "Sessions with live depth cameras and haptic devices, \
touching recordings, and a bench that compares methods.")
set(CPACK_DEBIAN_DEV_PACKAGE_NAME libpalpate-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
# Of what palpateConfig.cmake asks for.
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "libeigen3-dev, libpng-dev, zlib1g-dev, liblzf-dev, \
nlohmann-json3-dev, libsqlite3-dev, libzstd-dev, liblz4-dev, libbz2-dev")
set(CPACK_COMPONENT_DEV_DESCRIPTION "Static libraries and headers, for CMake's find_package and \
for pkg-config.")
if(PALPATE_PYTHON)
  list(APPEND components python)
  math(EXPR next "${PALPATE_PYTHON_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-palpate)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= 3.${PALPATE_PYTHON_MINOR}), \
python3 (<< 3.${next}), python3-numpy")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/cmake/debian/postinst
                                                ${PROJECT_SOURCE_DIR}/cmake/debian/prerm)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_STRICT_PERMISSION ON)
  set(CPACK_COMPONENT_PYTHON_DESCRIPTION "The Python package: renderer, traces, sessions, \
and the bench with methods written in Python.")
endif()
foreach(component ${components})
  string(TOUPPER ${component} upper)
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE COMPONENT ${component} RENAME copyright
          DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${CPACK_DEBIAN_${upper}_PACKAGE_NAME})
  set(CPACK_DEBIAN_${upper}_PACKAGE_SHLIBDEPS ON)
endforeach()

set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "haptic rendering of streaming depth data")
set(CPACK_GENERATOR DEB)
set(CPACK_COMPONENTS_ALL ${components})
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_PACKAGE_CONTACT "palpate's maintainers <palpate@localhost>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_OUTPUT_FILE_PREFIX packages)
include(CPack)
