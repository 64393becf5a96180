# SPDX-License-Identifier: Apache-2.0
# How every target of the project is made: the same warnings, sanitizers and checks everywhere.

# palpate_dependency(NAME ...): find_package(NAME ...) of what the library needs, here and wherever
# the installed package is found.
set(PALPATE_DEPENDENCIES "")
macro(palpate_dependency)
  find_package(${ARGN} REQUIRED)
  string(REPLACE ";" " " palpate_dependency_arguments "${ARGN}")
  string(APPEND PALPATE_DEPENDENCIES "find_dependency(${palpate_dependency_arguments})\n")
endmacro()

# palpate_target_options(TARGET): warnings and sanitizers. Never leaves the build.
function(palpate_target_options target)
  if(PALPATE_WARNINGS)
    target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wconversion
                           -Wno-sign-conversion $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor>)
  endif()
  # A product is rounded before it is added to, whatever the processor could do at once: then the
  # same session has the same forces on all of them.
  target_compile_options(${target} PRIVATE -ffp-contract=off)
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(aarch64|arm64)$")
    target_compile_options(${target} PRIVATE -U__ARM_FEATURE_FMA)  # by which Eigen would fuse them
  endif()
  if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    # Clang vectorises a least or greatest float only where NaN is promised away; then `omp simd`
    # remains a wish, and the loop is as right as before.
    target_compile_options(${target} PRIVATE -Wno-pass-failed)
  endif()
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
    # GCC bug 105651: false alarms about overlap in std::string's operator+.
    target_compile_options(${target} PRIVATE -Wno-restrict)
  endif()
  get_target_property(unity ${target} UNITY_BUILD)
  if(unity)
    # All files of a room as one (-DCMAKE_UNITY_BUILD=ON), which parses the big headers once. Then
    # a local name may be that of another file's constant; builds file by file have all warnings.
    set_target_properties(${target} PROPERTIES UNITY_BUILD_BATCH_SIZE 0)
    target_compile_options(${target} PRIVATE -Wno-shadow)
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      target_compile_options(${target} PRIVATE
                             $<$<COMPILE_LANGUAGE:CXX>:-Wno-subobject-linkage>)
    endif()
  endif()
  if(PALPATE_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(NOT PALPATE_VECTOR_SET STREQUAL "all")
    string(TOUPPER "PALPATE_VECTOR_SET_${PALPATE_VECTOR_SET}" vector_set)
    target_compile_definitions(${target} PRIVATE ${vector_set}=1)
  endif()
  if(PALPATE_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${PALPATE_SANITIZE}
                           -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_compile_definitions(${target} PRIVATE PALPATE_SANITIZED=1)
    target_link_options(${target} PRIVATE -fsanitize=${PALPATE_SANITIZE})
  endif()
  if(PALPATE_FUZZ)
    target_compile_options(${target} PRIVATE -fsanitize=fuzzer-no-link)
    target_link_options(${target} PRIVATE -fsanitize=fuzzer-no-link)
  endif()
  if(CMAKE_CXX_COMPILER_ID MATCHES Clang AND (PALPATE_SANITIZE OR PALPATE_FUZZ))
    target_compile_options(${target} PRIVATE -Wno-pass-failed)  # they keep loops from SIMD
  endif()
endfunction()

# palpate_tidy(TARGET [-CHECK]...): clang-tidy on all of a target's files, read as one, since its
# checks take four times as long on the headers as on a room's own files. Done anew when a file has
# changed. Of files by their place in the project, whatever the folder above it is called.
function(palpate_tidy target)
  if(NOT PALPATE_CLANG_TIDY)
    return()
  endif()
  list(JOIN ARGN "," checks)
  string(PREPEND checks "-bugprone-suspicious-include,")
  find_program(PALPATE_CLANG_TIDY_PROGRAM NAMES clang-tidy-14 clang-tidy REQUIRED)
  get_target_property(sources ${target} SOURCES)
  list(FILTER sources INCLUDE REGEX "\\.cpp$")
  set(includes "")
  foreach(source ${sources})
    get_filename_component(source ${source} ABSOLUTE)
    string(APPEND includes "#include \"${source}\"\n")
  endforeach()
  set(as_one ${CMAKE_CURRENT_BINARY_DIR}/${target}_as_one.cpp)
  file(CONFIGURE OUTPUT ${as_one} CONTENT "${includes}" @ONLY)
  # A library that is never built: it tells clang-tidy how to read that file.
  add_library(${target}_as_one OBJECT EXCLUDE_FROM_ALL ${as_one})
  foreach(property COMPILE_OPTIONS COMPILE_DEFINITIONS INCLUDE_DIRECTORIES LINK_LIBRARIES)
    set_property(TARGET ${target}_as_one PROPERTY ${property}
                 $<TARGET_PROPERTY:${target},${property}>)
  endforeach()
  target_compile_options(${target}_as_one PRIVATE -Wno-shadow)
  file(GLOB_RECURSE read CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/palpate/*.hpp
       ${CMAKE_CURRENT_SOURCE_DIR}/*.hpp)
  set(stamp ${CMAKE_CURRENT_BINARY_DIR}/${target}.tidy)
  add_custom_command(OUTPUT ${stamp}
    COMMAND ${PALPATE_CLANG_TIDY_PROGRAM} --quiet --config-file=${PROJECT_SOURCE_DIR}/.clang-tidy
            --warnings-as-errors=* "--checks=${checks}" -p ${CMAKE_BINARY_DIR}
            "--header-filter=^${PROJECT_SOURCE_DIR}/(palpate|lab|app|bench|python)/.*[.][ch]pp$"
            ${as_one}
    COMMAND ${CMAKE_COMMAND} -E touch ${stamp}
    DEPENDS ${sources} ${read} ${PROJECT_SOURCE_DIR}/.clang-tidy
    WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}
    COMMENT "Checking ${target} with clang-tidy" VERBATIM)
  add_custom_target(${target}_tidy ALL DEPENDS ${stamp})
endfunction()

# palpate_runs_once(TARGET): little optimised, as code that runs once (options, messages, set-up)
# costs more processor time to optimise than it ever gains.
function(palpate_runs_once target)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release,RelWithDebInfo>:-O1>)
endfunction()

# palpate_slow_when_checked(TARGET): not optimised under a sanitizer or beside clang-tidy, where
# what the network, the command line or a driver waits for costs more processor time to compile than
# it takes to run.
function(palpate_slow_when_checked target)
  if(PALPATE_SANITIZE OR PALPATE_CLANG_TIDY)
    target_compile_options(${target} PRIVATE -O0)
  endif()
endfunction()

# palpate_room(NAME LINKS <public libraries...> PRIVATE <private libraries...>)
#
# A library palpate_NAME, palpate::NAME to others, from all .cpp files of the current folder; its
# headers are included by their path from the repository root, which is also where they install.
function(palpate_room name)
  cmake_parse_arguments(ARG "" "" "LINKS;PRIVATE" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS *.cpp *.c)
  file(GLOB headers CONFIGURE_DEPENDS *.hpp *.h)
  if(PALPATE_LEFT_OUT)  # of another project, which has other files in their place
    list(FILTER sources EXCLUDE REGEX ${PALPATE_LEFT_OUT})
  endif()
  add_library(palpate_${name} ${sources} ${headers})
  add_library(palpate::${name} ALIAS palpate_${name})
  set_target_properties(palpate_${name} PROPERTIES EXPORT_NAME ${name} VERSION ${PROJECT_VERSION}
                        SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  target_compile_features(palpate_${name} PUBLIC cxx_std_20)
  target_include_directories(palpate_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_link_libraries(palpate_${name} PUBLIC ${ARG_LINKS} PRIVATE ${ARG_PRIVATE})
  palpate_target_options(palpate_${name})
  # No tick runs in these: they wait for files, vendors' libraries and networks.
  if(name MATCHES "^(bag|sources|drivers|record|session|telelink|node|viewer)$")
    palpate_runs_once(palpate_${name})
  endif()
  if(PALPATE_CLANG_TIDY AND NOT name MATCHES "^(core|paper|sight|methods|cloud)$")
    palpate_slow_when_checked(palpate_${name})  # what a tick runs stays as its users have it
  endif()
  # At the folder's end, when it has said how its files are compiled
  cmake_language(EVAL CODE "cmake_language(DEFER CALL palpate_tidy palpate_${name})")
  file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  if(folder MATCHES "^palpate/")
    set_property(GLOBAL APPEND PROPERTY PALPATE_INSTALLED_ROOMS palpate_${name})
    install(TARGETS palpate_${name} EXPORT palpate_targets COMPONENT dev)
    install(FILES ${headers} COMPONENT dev DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/${folder})
  endif()
endfunction()

# palpate_list(TARGET FUNCTION TYPE HEADER DECLARE ITEM FILES [ROOM]): adds to TARGET the function
# std::vector<TYPE> palpate::ROOM::FUNCTION(), with an entry for each file *FILES*.cpp of the
# current folder and of PALPATE_EXTENSIONS, which become part of TARGET: what is added is one file.
# In DECLARE and ITEM @ stands for the file's name without FILES.
set(PALPATE_EXTENSIONS "" CACHE STRING
    "Folders with files NAME_driver.cpp, NAME_method.cpp and verb_NAME.cpp of one's own")
function(palpate_list target function type header declare item files)
  set(namespace palpate ${ARGN})
  list(JOIN namespace "::" namespace)
  set(patterns *${files}*.cpp)
  set(declared "")
  set(items "")
  foreach(folder ${PALPATE_EXTENSIONS})
    if(NOT IS_DIRECTORY ${folder})
      message(FATAL_ERROR "PALPATE_EXTENSIONS: there is no folder ${folder}; name it absolutely")
    endif()
    file(GLOB added CONFIGURE_DEPENDS ${folder}/*${files}*.cpp)
    target_sources(${target} PRIVATE ${added})
    list(APPEND patterns ${folder}/*${files}*.cpp)
  endforeach()
  file(GLOB found CONFIGURE_DEPENDS ${patterns})
  foreach(file ${found})
    get_filename_component(name ${file} NAME_WE)
    string(REPLACE "${files}" "" name ${name})
    string(REPLACE "@" "${name}" one "${declare}")
    string(APPEND declared "${one};  // NOLINT(readability-redundant-declaration)\n")
    string(REPLACE "@" "${name}" one "${item}")
    string(APPEND items "${one}, ")
  endforeach()
  set(list ${CMAKE_CURRENT_BINARY_DIR}/${function}.cpp)
  file(CONFIGURE OUTPUT ${list} @ONLY CONTENT [[
#include "@header@"
namespace @namespace@ {
@declared@std::vector<@type@> @function@() {
  return {@items@};
}
}  // namespace @namespace@
]])
  target_sources(${target} PRIVATE ${list})
endfunction()

# palpate_test(NAME LINKS <libraries...>): all .cpp files of the current folder as one GoogleTest
# program test_NAME, each TEST of it a ctest test.
function(palpate_test name)
  cmake_parse_arguments(ARG "" "" "LINKS" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS *.cpp)
  if(NOT sources)
    return()
  endif()
  add_executable(test_${name} ${sources})
  target_include_directories(test_${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(test_${name} PRIVATE ${ARG_LINKS} GTest::gtest_main)
  palpate_target_options(test_${name})
  # Each file has a namespace of its own, so that they can be compiled as one; six, for all cores.
  set_target_properties(test_${name} PROPERTIES UNITY_BUILD_BATCH_SIZE 6)
  palpate_runs_once(test_${name})
  target_precompile_headers(test_${name} REUSE_FROM palpate_test_headers)
  gtest_discover_tests(test_${name} DISCOVERY_TIMEOUT 60 TEST_FILTER "${PALPATE_TEST_FILTER}"
    TEST_PREFIX "${PALPATE_TEST_PREFIX}"
    PROPERTIES TIMEOUT 300 ENVIRONMENT "PALPATE_DATA=${PALPATE_DATA}")
endfunction()

# palpate_long_run(NAME LINKS <libraries...>): long_run/NAME.cpp, a program for long runs by hand,
# made by `ninja NAME`; with all else only by clang without a sanitizer, so that it goes on
# compiling.
function(palpate_long_run name)
  cmake_parse_arguments(ARG "" "" "LINKS" ${ARGN})
  add_executable(${name} long_run/${name}.cpp)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE ${ARG_LINKS})
  palpate_target_options(${name})
  if(PALPATE_SANITIZE OR NOT CMAKE_CXX_COMPILER_ID MATCHES Clang)
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON)
  endif()
endfunction()

# palpate_fake_library(FILE SOURCE [DEFINITIONS ...] [LINKS ...]): a vendor's library as the tests
# make it, to be loaded by name: FILE, such as libdrd.so.3 or old/libdrd.so.3, below the folder
# ${PALPATE_FAKES}. DEFINITIONS make other versions of it from the same SOURCE.
function(palpate_fake_library file source)
  cmake_parse_arguments(ARG "" "" "DEFINITIONS;LINKS" ${ARGN})
  string(MAKE_C_IDENTIFIER "fake_${file}" target)
  get_filename_component(name ${file} NAME)
  get_filename_component(folder ${PALPATE_FAKES}/${file} DIRECTORY)
  add_library(${target} MODULE ${source})
  set_target_properties(${target} PROPERTIES PREFIX "" SUFFIX "" OUTPUT_NAME ${name}
                        LIBRARY_OUTPUT_DIRECTORY ${folder} UNITY_BUILD OFF)
  target_compile_features(${target} PRIVATE cxx_std_20)
  target_compile_definitions(${target} PRIVATE ${ARG_DEFINITIONS})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${target} PRIVATE ${ARG_LINKS})
  palpate_target_options(${target})
  palpate_runs_once(${target})
  if(PALPATE_SANITIZE AND CMAKE_CXX_COMPILER_ID MATCHES Clang)
    # It has types of its own, by other names than the driver's, as the vendor's headers have.
    target_compile_options(${target} PRIVATE -fno-sanitize=function)
  endif()
  add_dependencies(palpate_fakes ${target})
endfunction()

# palpate_uses_fakes(TARGET): the fake libraries are built before TARGET, which sees their folder as
# PALPATE_FAKES.
function(palpate_uses_fakes target)
  add_dependencies(${target} palpate_fakes)
  target_compile_definitions(${target} PRIVATE PALPATE_FAKES="${PALPATE_FAKES}")
endfunction()

# palpate_memcheck(NAME FILTER): tests of test_NAME under valgrind, which finds reads of what was
# never written. Valgrind offers no AVX-512, so the AVX2 loops run. FILTER, as GoogleTest's, keeps
# the time bounded: everything takes some forty times as long.
function(palpate_memcheck name filter)
  find_program(PALPATE_VALGRIND valgrind)
  if(NOT PALPATE_VALGRIND OR PALPATE_SANITIZE OR NOT CMAKE_CXX_COMPILER_ID STREQUAL "GNU"
     OR NOT TARGET test_${name})
    return()
  endif()
  # Tests that count allocations bring an operator new of their own: no mismatch.
  add_test(NAME "${PALPATE_TEST_PREFIX}memcheck/${name}"
           COMMAND ${PALPATE_VALGRIND} --quiet --error-exitcode=9 --show-mismatched-frees=no
                   $<TARGET_FILE:test_${name}> --gtest_brief=1 --gtest_filter=${filter})
  set_tests_properties("${PALPATE_TEST_PREFIX}memcheck/${name}" PROPERTIES TIMEOUT 900 COST 100
                       ENVIRONMENT PALPATE_MEMCHECK=1)
endfunction()
