# The Python package in a virtual environment of its own: installs the build, compiles the extension
# module against that (the libraries are not compiled again), installs the package, runs its tests. What
# the package index has to give is kept, so that a later run does without it.
# cmake -DBUILD_DIR=... -DSOURCE_DIR=... -DWORK_DIR=... -DPYTHON=... -DPROGRAM=... -DEXTRAS=ON|OFF
#       -P python_package.cmake
#
# EXTRAS: also the tests that need Dask, a notebook's kernel or robots' libraries (rosbags, Foxglove's SDK,
# CommonRoad, readers of MCAP files); without, they are skipped.
# Prints SKIPPED with the reason where the index cannot be reached, or Python's headers are missing.
set(prefix "${WORK_DIR}/prefix")
set(venv "${WORK_DIR}/venv")
set(packages "scikit-build-core>=0.10" "nanobind>=2.4" numpy pytest)
set(ready "${venv}/ready")
if(EXTRAS)
  list(APPEND packages matplotlib nbclient ipykernel "distributed>=2023.1" "rosbags>=0.11"
       "foxglove-sdk>=0.30" "commonroad-io>=2026.1" "mcap>=1.2" "mcap-ros2-support>=0.5"
       "mcap-protobuf-support>=0.4" "websockets>=13")
  set(ready "${venv}/ready_with_robot_extras")
endif()

function(run)
  execute_process(COMMAND ${ARGN} WORKING_DIRECTORY "${SOURCE_DIR}" RESULT_VARIABLE status
                  OUTPUT_VARIABLE output ERROR_VARIABLE output)
  set(status "${status}" PARENT_SCOPE)
  set(output "${output}" PARENT_SCOPE)
endfunction()

function(require)
  run(${ARGN})
  if(NOT status EQUAL 0)
    string(REPLACE ";" " " command "${ARGN}")
    message(FATAL_ERROR "${command}\nended with ${status}:\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

if(NOT EXISTS "${ready}")
  file(REMOVE_RECURSE "${venv}")
  run("${PYTHON}" -m venv "${venv}")
  if(NOT status EQUAL 0)
    message(STATUS "SKIPPED: no virtual environment (Debian: python3-venv):\n${output}")
    return()
  endif()
  run("${venv}/bin/pip" install --quiet --disable-pip-version-check --retries 1 --timeout 20
      --prefer-binary ${packages})
  if(NOT status EQUAL 0)
    message(STATUS "SKIPPED: the package index has not given ${packages}:\n${output}")
    return()
  endif()
  file(TOUCH "${ready}")
endif()

# Installed headers keep their times, so that objects of an earlier run may look newer than a header that
# has changed since: all are compiled again.
file(REMOVE_RECURSE "${prefix}" "${WORK_DIR}/build")
require("${CMAKE_COMMAND}" --install "${BUILD_DIR}" --prefix "${prefix}")
require("${venv}/bin/pip" install --quiet --disable-pip-version-check --no-build-isolation --no-deps
        --force-reinstall "${SOURCE_DIR}" --config-settings "build-dir=${WORK_DIR}/build"
        --config-settings "cmake.define.blindcorner_ROOT=${prefix}")
require("${CMAKE_COMMAND}" -E env "BLINDCORNER_PROGRAM=${PROGRAM}" "${venv}/bin/python" -m pytest -q -rs
        -p no:cacheprovider "${SOURCE_DIR}/python/tests" "${SOURCE_DIR}/ros2/test")
message(STATUS "${output}")
