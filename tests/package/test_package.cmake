# Installs the build, builds the consumer against the installed package alone, and lets it fit the
# installed sample capture. cmake -DBUILD_DIR=... -DSOURCE_DIR=... -DWORK_DIR=... -P test_package.cmake
set(prefix "${WORK_DIR}/prefix")
file(REMOVE_RECURSE "${WORK_DIR}")

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    string(REPLACE ";" " " command "${ARGN}")
    message(FATAL_ERROR "${command}\nended with ${status}:\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

run("${CMAKE_COMMAND}" --install "${BUILD_DIR}" --prefix "${prefix}")
run("${CMAKE_COMMAND}" -S "${SOURCE_DIR}" -B "${WORK_DIR}/build" -G "${GENERATOR}"
    "-DCMAKE_PREFIX_PATH=${prefix}" "-DCMAKE_BUILD_TYPE=${BUILD_TYPE}" "-DCMAKE_CXX_COMPILER=${CXX}")
run("${CMAKE_COMMAND}" --build "${WORK_DIR}/build")

set(scenes "${prefix}/${DATA_DIR}/blindcorner/scenes")

# The same by pkg-config, without CMake.
set(ENV{PKG_CONFIG_PATH} "${prefix}/${LIB_DIR}/pkgconfig:$ENV{PKG_CONFIG_PATH}")
run(pkg-config --cflags --libs blindcorner)
separate_arguments(flags UNIX_COMMAND "${output}")
run("${CXX}" "${SOURCE_DIR}/main.cpp" -o "${WORK_DIR}/consumer_of_pkg_config" ${flags})
run("${WORK_DIR}/consumer_of_pkg_config" "${scenes}/tmf8828_wall.json" "${scenes}/captures/tmf8828_wall.exr")
if(NOT output MATCHES "pose:( +-?[0-9.e-]+)+\n")
  message(FATAL_ERROR "the consumer that pkg-config built printed no pose but:\n${output}")
endif()

run("${WORK_DIR}/build/consumer" "${scenes}/tmf8828_wall.json" "${scenes}/captures/tmf8828_wall.exr")
if(NOT output MATCHES "pose:( +-?[0-9.e-]+)+\n")
  message(FATAL_ERROR "the consumer printed no pose but:\n${output}")
endif()
if(NOT output MATCHES "speed: 0\\.[12]")
  message(FATAL_ERROR "the consumer's car did not drive:\n${output}")
endif()
message(STATUS "${output}")
