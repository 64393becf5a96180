# SPDX-License-Identifier: Apache-2.0
# What lets another project say find_package(palpate): one exported target a room, and
# palpate::palpate for all of them.
include(CMakePackageConfigHelpers)

get_property(rooms GLOBAL PROPERTY PALPATE_INSTALLED_ROOMS)
add_library(palpate_all INTERFACE)
add_library(palpate::palpate ALIAS palpate_all)
set_target_properties(palpate_all PROPERTIES EXPORT_NAME palpate)
target_link_libraries(palpate_all INTERFACE ${rooms})
install(TARGETS palpate_all EXPORT palpate_targets)

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/palpate)
install(EXPORT palpate_targets NAMESPACE palpate:: DESTINATION ${package_folder})
configure_package_config_file(cmake/palpateConfig.cmake.in palpateConfig.cmake
                              INSTALL_DESTINATION ${package_folder}
                              NO_SET_AND_CHECK_MACRO NO_CHECK_REQUIRED_COMPONENTS_MACRO)
write_basic_package_version_file(palpateConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/palpateConfig.cmake
              ${CMAKE_CURRENT_BINARY_DIR}/palpateConfigVersion.cmake
        DESTINATION ${package_folder})
