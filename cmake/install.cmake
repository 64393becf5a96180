# SPDX-License-Identifier: Apache-2.0
# What lets another project say find_package(palpate): one exported target a room, and
# palpate::palpate for all of them.
include(CMakePackageConfigHelpers)

get_property(rooms GLOBAL PROPERTY PALPATE_INSTALLED_ROOMS)
add_library(palpate_all INTERFACE)
add_library(palpate::palpate ALIAS palpate_all)
set_target_properties(palpate_all PROPERTIES EXPORT_NAME palpate)
target_link_libraries(palpate_all INTERFACE ${rooms})
install(TARGETS palpate_all EXPORT palpate_targets COMPONENT dev)

# The kernel alone, from observations and a hand to a force.
add_library(palpate_kernel INTERFACE)
add_library(palpate::kernel ALIAS palpate_kernel)
set_target_properties(palpate_kernel PROPERTIES EXPORT_NAME kernel)
target_link_libraries(palpate_kernel INTERFACE palpate::methods palpate::cloud palpate::fixtures)
install(TARGETS palpate_kernel EXPORT palpate_targets COMPONENT dev)

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/palpate)
install(EXPORT palpate_targets NAMESPACE palpate:: COMPONENT dev DESTINATION ${package_folder})
configure_package_config_file(cmake/palpateConfig.cmake.in palpateConfig.cmake
                              INSTALL_DESTINATION ${package_folder}
                              NO_SET_AND_CHECK_MACRO NO_CHECK_REQUIRED_COMPONENTS_MACRO)
write_basic_package_version_file(palpateConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/palpateConfig.cmake
              ${CMAKE_CURRENT_BINARY_DIR}/palpateConfigVersion.cmake
        COMPONENT dev DESTINATION ${package_folder})

# The same for who builds without CMake: pkg-config palpate. A static library leaves what it needs
# itself to its users, so then nothing is private.
set(PALPATE_PC_LIBRARIES "")
foreach(room ${rooms})  # from the one that knows nobody on: the linker wants them the other way
  string(PREPEND PALPATE_PC_LIBRARIES " -l${room}")
endforeach()
set(PALPATE_PC_PRIVATE "")
if(BUILD_SHARED_LIBS)
  set(PALPATE_PC_PRIVATE ".private")
endif()
file(RELATIVE_PATH PALPATE_PC_PREFIX /prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig /prefix)
configure_file(cmake/palpate.pc.in palpate.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/palpate.pc COMPONENT dev
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
