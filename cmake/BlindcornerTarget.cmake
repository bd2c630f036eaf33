# blindcorner_library(name SOURCES... ) makes target blindcorner_<name> with alias blindcorner::<name>,
# the project's warnings, and its installation.
function(blindcorner_flags target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wconversion -Wshadow
                                           -fno-math-errno -fno-trapping-math)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
    target_compile_options(${target} PRIVATE -Wno-restrict)  # false alarms on std::string, GCC PR 105329
  elseif(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # False alarms on copies of empty vectors (GCC 14, Debian 13). GCC 12 and clang do check.
    target_compile_options(${target} PRIVATE -Wno-array-bounds)
  endif()
  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    target_compile_options(${target} PRIVATE -Wno-pass-failed)  # loops it does not vectorise
  elseif(CMAKE_UNITY_BUILD)
    target_compile_options(${target} PRIVATE -Wno-subobject-linkage)  # of types that stay in one source
  endif()
  if(BLINDCORNER_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(BLINDCORNER_SANITIZE)
    # At -O2 the checks in Eigen's code take minutes and 2 GB a source.
    target_compile_options(${target} PRIVATE -O1 -fsanitize=${BLINDCORNER_SANITIZE}
                                             -fno-sanitize-recover=all -fno-omit-frame-pointer)
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      target_compile_options(${target} PRIVATE -Wno-maybe-uninitialized)  # false alarms on std::regex
      if(BLINDCORNER_SANITIZE STREQUAL "thread")
        target_compile_options(${target} PRIVATE -Wno-use-after-free)  # false alarms on Eigen's memory
      endif()
    endif()
    target_compile_definitions(${target} PRIVATE BLINDCORNER_SANITIZE)
    # The sanitizer calls dlopen for the program, so that only an inherited run path finds the network.
    target_link_options(${target} PRIVATE -fsanitize=${BLINDCORNER_SANITIZE} -Wl,--disable-new-dtags)
  endif()
endfunction()

function(blindcorner_library name)
  add_library(blindcorner_${name} STATIC ${ARGN})
  add_library(blindcorner::${name} ALIAS blindcorner_${name})
  set_target_properties(blindcorner_${name} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(blindcorner_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  # Private headers, by their place in the tree: "forward/relay/relay.h", "io/npy.h".
  target_include_directories(blindcorner_${name} PRIVATE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/src)
  target_compile_features(blindcorner_${name} PUBLIC cxx_std_20)
  blindcorner_flags(blindcorner_${name})
  install(TARGETS blindcorner_${name} EXPORT blindcornerTargets
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
endfunction()

# Sources of this folder whose names without linkage are those of others, or hide those of a header
# that others mean: a build that joins sources (CMAKE_UNITY_BUILD, as `bootstrap.sh` does in an empty
# build folder) compiles them by themselves.
function(blindcorner_apart)
  set_source_files_properties(${ARGN} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()
