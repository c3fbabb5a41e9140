# With UNHAND_UNITY, `size` sources of the target are compiled as one, so that headers are read once; but never those
# named ALONE. Names in unnamed namespaces must be unique in the target (or overloads whose parameters do not convert).
function(unhand_batches target size)
  cmake_parse_arguments(ARG "" "" "ALONE" ${ARGN})
  if(UNHAND_UNITY)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${size})
    if(ARG_ALONE)
      set_source_files_properties(${ARG_ALONE} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    endif()
  endif()
endfunction()

# The headers that most sources read, compiled once for all targets of a `kind`. GCC then compiles those targets as it
# compiled the headers, whatever their own command lines say of optimisation: one kind, one set of options. The first
# target of a kind must define no macro that the others do not.
function(unhand_precompiled target kind)
  if(CMAKE_CXX_COMPILER_LAUNCHER OR NOT CMAKE_CXX_COMPILER_ID STREQUAL GNU)  # a compiler cache does better without
    return()
  endif()
  get_property(owner GLOBAL PROPERTY UNHAND_PRECOMPILED_${kind})
  if(owner)
    target_precompile_headers(${target} REUSE_FROM ${owner})
  else()
    set_property(GLOBAL PROPERTY UNHAND_PRECOMPILED_${kind} ${target})
    target_precompile_headers(${target} PRIVATE <algorithm> <array> <cmath> <filesystem> <functional> <map> <memory>
      <optional> <span> <string> <vector> <Eigen/Dense> <ceres/jet.h> <fmt/format.h>)
  endif()
endfunction()

# One folder = one target unhand::<folder> = one namespace unhand::<folder>.
#
#   unhand_module(contact
#     SOURCES limit_surface.cpp ...
#     HEADERS limit_surface.hpp ...
#     USES    dynamics              # the modules whose headers it may include
#     LINKS   SUNDIALS::cvode_shared  # private third-party libraries
#     LEVEL   -O2                   # of optimisation in a Release build, where its time goes into other modules
#     BATCH   5                     # as unhand_batches
#     ALONE   registry.cpp
#     FAST    kinematics.cpp        # compiled alone at -O3 whatever LEVEL says, loops marked `omp simd` in vectors:
#                                   # arithmetic that most of the time goes into
#     PRECOMPILED)                  # as unhand_precompiled, with the modules of the same LEVEL
function(unhand_module name)
  cmake_parse_arguments(ARG "PRECOMPILED" "BATCH;LEVEL" "SOURCES;HEADERS;USES;LINKS;ALONE;FAST" ${ARGN})
  add_library(unhand_${name} ${ARG_SOURCES})
  add_library(unhand::${name} ALIAS unhand_${name})
  set_target_properties(unhand_${name} PROPERTIES EXPORT_NAME ${name})
  if(ARG_BATCH)
    unhand_batches(unhand_${name} ${ARG_BATCH} ALONE ${ARG_ALONE})
  endif()
  if(ARG_PRECOMPILED)
    unhand_precompiled(unhand_${name} modules${ARG_LEVEL})
  endif()
  target_compile_features(unhand_${name} PUBLIC cxx_std_20)
  target_include_directories(unhand_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/unhand>)
  foreach(used IN LISTS ARG_USES)
    target_link_libraries(unhand_${name} PUBLIC unhand::${used})
  endforeach()
  foreach(library IN LISTS ARG_LINKS)
    target_link_libraries(unhand_${name} PRIVATE $<BUILD_INTERFACE:${library}>)
    if(NOT BUILD_SHARED_LIBS)  # whoever links a static library links what it needs, and sees no header of it
      target_link_libraries(unhand_${name} INTERFACE $<INSTALL_INTERFACE:$<LINK_ONLY:${library}>>)
    endif()
  endforeach()
  target_link_libraries(unhand_${name} PRIVATE $<BUILD_INTERFACE:unhand_warnings>)
  target_compile_options(unhand_${name} PRIVATE $<$<CONFIG:Release>:${ARG_LEVEL}>)
  set(growths inline-unit-growth=400 large-function-growth=1000 large-stack-frame-growth=10000)
  # Without these GCC stops inlining in the middle of the arithmetic of dual numbers: twice the time and more.
  list(TRANSFORM growths REPLACE "(.+)" "$<$<AND:$<CXX_COMPILER_ID:GNU>,$<CONFIG:Release>>:--param=\\1>")
  if(NOT ARG_LEVEL)
    target_compile_options(unhand_${name} PRIVATE ${growths})
  endif()
  if(ARG_FAST)  # precompiled headers would bring their own level
    set_source_files_properties(${ARG_FAST} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON SKIP_PRECOMPILE_HEADERS ON
      COMPILE_OPTIONS "$<$<CONFIG:Release>:-O3>;-fopenmp-simd;-fno-math-errno;-fno-trapping-math;${growths}")
  endif()
  install(TARGETS unhand_${name} EXPORT unhandTargets)
  foreach(header IN LISTS ARG_HEADERS)
    cmake_path(GET header PARENT_PATH folder)  # "arm" of arm/chain.hpp
    install(FILES ${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/unhand/${name}/${folder})
  endforeach()
endfunction()

# What the command line and the studies are compiled with: text and tables, less to compile than at -O1; what takes time
# is in the modules. A target that uses it must not set the optimisation itself.
function(unhand_program target)
  target_link_libraries(${target} PRIVATE unhand_warnings)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-Og>)
  if(CMAKE_CXX_COMPILER_LAUNCHER)  # a compiler cache does better without
    return()
  endif()
  if(NOT TARGET program_headers)
    add_executable(program_headers ${PROJECT_SOURCE_DIR}/cmake/nothing.cpp)
    target_link_libraries(program_headers PRIVATE unhand_warnings Eigen3::Eigen fmt::fmt nlohmann_json::nlohmann_json)
    target_compile_features(program_headers PRIVATE cxx_std_20)
    target_compile_options(program_headers PRIVATE $<$<CONFIG:Release>:-Og>)
    target_precompile_headers(program_headers PRIVATE <algorithm> <array> <cmath> <filesystem> <fstream> <functional>
      <map> <memory> <optional> <span> <string> <vector> <Eigen/Dense> <fmt/format.h> <nlohmann/json.hpp>)
  endif()
  target_precompile_headers(${target} REUSE_FROM program_headers)
endfunction()

# What every test is compiled with.
function(unhand_test_options)
  add_library(unhand_test_options INTERFACE)
  target_link_libraries(unhand_test_options INTERFACE unhand_warnings GTest::gmock GTest::gtest_main)
  target_compile_options(unhand_test_options INTERFACE $<$<CONFIG:Release>:-Og>)  # less to compile than -O1; what takes time is in the library
  if(NOT CMAKE_CXX_COMPILER_LAUNCHER)  # a compiler cache does better without
    add_executable(test_headers ${PROJECT_SOURCE_DIR}/cmake/empty.cpp)
    target_link_libraries(test_headers PRIVATE unhand_test_options Eigen3::Eigen)
    target_compile_features(test_headers PRIVATE cxx_std_20)
    target_precompile_headers(test_headers PRIVATE <gmock/gmock.h> <gtest/gtest.h> <ceres/jet.h> <random>)
  endif()
endfunction()

# unhand_test(dynamics SOURCES integrator_test.cpp ... USES release BATCH 4)
# makes the executable test_<name> from SOURCES and registers each test case. Those that LONG names (patterns
# of --gtest_filter) have the label <name>.long instead of <name>: runs of many seconds through the code of shorter tests
# beside them, which slow builds (sanitizers, counters) leave out.
function(unhand_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT;BATCH" "SOURCES;USES;ALONE;LONG" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 1500)  # the sanitizers are an order of magnitude slower
  endif()
  add_executable(test_${name} ${ARG_SOURCES})
  foreach(used IN LISTS ARG_USES)
    target_link_libraries(test_${name} PRIVATE unhand::${used})
  endforeach()
  if(ARG_BATCH)
    unhand_batches(test_${name} ${ARG_BATCH} ALONE ${ARG_ALONE})
  endif()
  target_link_libraries(test_${name} PRIVATE unhand_test_options)
  target_include_directories(test_${name} PRIVATE ${PROJECT_SOURCE_DIR})
  if(TARGET test_headers)
    target_precompile_headers(test_${name} REUSE_FROM test_headers)
  endif()
  set(discovery TEST_PREFIX ${name}. NO_PRETTY_VALUES DISCOVERY_TIMEOUT 60)
  set(properties PROPERTIES TIMEOUT ${ARG_TIMEOUT})
  if(ARG_LONG)
    list(JOIN ARG_LONG ":" long)
    gtest_discover_tests(test_${name} ${discovery} TEST_FILTER ${long} TEST_LIST ${name}_long ${properties} LABELS ${name}.long)
    gtest_discover_tests(test_${name} ${discovery} TEST_FILTER "-${long}" ${properties} LABELS ${name})
  else()
    gtest_discover_tests(test_${name} ${discovery} ${properties} LABELS ${name})
  endif()
endfunction()
