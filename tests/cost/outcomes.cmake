# SPDX-License-Identifier: Apache-2.0
# For site/CMakeLists.txt: the bench, but for what needs threads. What its cases come to is compared
# with the same program of a usual build (scripts/figures/outcomes.py); it is no part of the page.
# Without the libraries of the lab (scripts/setup lab) there is no such target.
foreach(header fmt/core.h nanoflann.hpp)
  find_path(at NAMES ${header} PATHS /usr/include NO_DEFAULT_PATH NO_CMAKE_FIND_ROOT_PATH NO_CACHE)
  if(NOT at)
    return()
  endif()
  unset(at)
endforeach()
palpate_header(fmt::fmt fmt)
palpate_header(nanoflann nanoflann.hpp)
palpate_header(Eigen3::unsupported unsupported)
set(NANOFLANN_INCLUDE_DIR ${CMAKE_BINARY_DIR}/headers)
foreach(room search palpate/net/teleop)
  add_subdirectory(${PROJECT_SOURCE_DIR}/${room} ${room} EXCLUDE_FROM_ALL)
endforeach()
file(GLOB_RECURSE lab ${PROJECT_SOURCE_DIR}/lab/*.cpp)
list(FILTER lab EXCLUDE REGEX "/(runner|entry)\\.cpp$")
add_executable(outcomes EXCLUDE_FROM_ALL ${PROJECT_SOURCE_DIR}/tests/cost/outcomes.cpp ${lab})
set_target_properties(outcomes PROPERTIES UNITY_BUILD OFF)
target_compile_definitions(outcomes PRIVATE FMT_HEADER_ONLY)
target_link_libraries(outcomes PRIVATE palpate::methods palpate::tool palpate::search
                      palpate::teleop palpate::devices palpate::sources fmt::fmt)
palpate_target_options(outcomes)
if(EMSCRIPTEN)
  # No case reads a file.
  target_link_options(outcomes PRIVATE -sALLOW_MEMORY_GROWTH -sERROR_ON_UNDEFINED_SYMBOLS=0)
endif()
