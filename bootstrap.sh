#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# From a fresh checkout on Debian or Ubuntu to a fitted capture, or to the test report.
# What is already there is left alone: a second run installs nothing, and compiles
# nothing but the Python package (`python`).
set -euo pipefail
unset CDPATH

usage() {
  cat <<'USAGE'
usage: ./bootstrap.sh fit     install what is missing, build, fit the bundled capture (out/fit/result.html)
       ./bootstrap.sh live    install what is missing, build, play a bundled recording and track it in the
                              browser until Ctrl-C, as with a sensor
       ./bootstrap.sh test    install what is missing, build, run the tests but for the slow ones
       ./bootstrap.sh slow    the same for the slow ones: each takes eight seconds or more on two cores
       ./bootstrap.sh pages   install what is missing, also Chromium, build, open every page in it and
                              look for faults (with Playwright and axe-core from PyPI)
       ./bootstrap.sh python  install what is missing, build, test the Python package in a virtual
                              environment of its own (from PyPI; skipped where that cannot be reached)
                              with all its extras: Dask, the notebook (Matplotlib, a kernel) and
                              robots' libraries (ROS bags, Foxglove's SDK, CommonRoad, MCAP readers,
                              WebSockets); EXTRAS=OFF leaves them and their tests out

Missing packages are installed with apt-get, as root or through sudo. All else stays in this folder.
JOBS=N ./bootstrap.sh ...     compile and test with N processes (default: one per processor, at most
                              one for every 1.5 GB of free memory)
USAGE
}

# The same names in Debian 12, Debian 13 and Ubuntu 24.04.
packages=(
  g++ cmake ninja-build pkg-config
  libeigen3-dev libceres-dev libembree-dev libtbb-dev
  libopenexr-dev nlohmann-json3-dev libcli11-dev libzip-dev zlib1g-dev libmatio-dev libhdf5-dev
  libpng-dev libyaml-cpp-dev libboost-dev
  libtinyobjloader-dev libcpp-httplib-dev
  libjs-d3
  libgtest-dev libgmock-dev libbenchmark-dev
)

# What the program does without: the learned baseline (cnn train, cnn evaluate), and the TMF8829
# makers' publisher (live --input zmq://...).
optional_packages=(libtorch-dev libzmq3-dev)

die() {
  echo "bootstrap.sh: $*" >&2
  exit 1
}

# Names of those arguments that are not installed Debian packages.
missing_packages() {
  local installed name
  # dpkg-query fails when it does not know one of the names; what it prints of the others counts.
  installed=" $(dpkg-query -W -f '${Package}:${db:Status-Status} ' "$@" 2>/dev/null || true)"
  for name in "$@"; do
    [[ "$installed" == *" $name:installed "* ]] || echo "$name"
  done
}

# Installs those arguments that are missing; does not call apt-get when none is.
install_packages() {
  { command -v dpkg-query && command -v apt-get; } >/dev/null ||
    die "this needs Debian or Ubuntu (apt-get); elsewhere install what its list of packages names and run: cmake --preset release"
  local missing as_root=()
  mapfile -t missing < <(missing_packages "$@")
  ((${#missing[@]})) || return 0
  if [[ "$(id -u)" != 0 ]]; then
    command -v sudo >/dev/null || die "missing packages and neither root nor sudo; as root: apt-get install ${missing[*]}"
    as_root=(sudo)
  fi
  echo "Installing ${missing[*]}"
  # A source that cannot be reached is no reason to stop: the lists at hand may do.
  "${as_root[@]}" apt-get update -q || echo "bootstrap.sh: apt-get update failed; trying with the package lists at hand" >&2
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}" ||
    die "apt-get could not install: ${missing[*]}"
}

# Installs those arguments that are missing and can be had.
install_optional_packages() {
  local missing
  mapfile -t missing < <(missing_packages "$@")
  ((${#missing[@]})) || return 0
  (install_packages "${missing[@]}") || echo "bootstrap.sh: going on without: ${missing[*]}" >&2
}

# Memory that compilers may use, MB: what is free, or what a container may have if that is less.
free_memory() {
  local megabytes limit
  megabytes=$(($(sed -n 's/^MemAvailable: *\([0-9]*\) kB/\1/p' /proc/meminfo) / 1024))
  limit=$(cat /sys/fs/cgroup/memory.max 2>/dev/null || echo max)
  if [[ "$limit" != max ]] && ((limit / 1048576 < megabytes)); then
    megabytes=$((limit / 1048576))
  fi
  echo "$megabytes"
}

# Processes to compile with. The largest sources (Eigen, Ceres, JSON) take 1 to 1.5 GB each.
job_count() {
  local jobs memory_jobs
  if [[ -n "${JOBS:-}" ]]; then
    [[ "$JOBS" =~ ^[1-9][0-9]*$ ]] || die "JOBS=$JOBS: expected a number of processes, 1 or more"
    echo "$JOBS"
    return
  fi
  jobs=$(nproc)
  memory_jobs=$(($(free_memory) / 1500))
  ((memory_jobs >= 1)) || memory_jobs=1
  echo $((jobs < memory_jobs ? jobs : memory_jobs))
}

# Configures and builds a target of the preset `release`: JOBS TARGET [OPTION...]. In an empty build
# folder sources are compiled several at a time, which halves the time of a first build and lengthens
# those of later changes.
build() {
  local log=build/configure.log options=("${@:3}")
  mkdir -p build
  [[ -e build/release/CMakeCache.txt ]] || options+=(-DCMAKE_UNITY_BUILD=ON)
  cmake --preset release "${options[@]}" >"$log" 2>&1 || {
    cat "$log" >&2
    die "CMake failed"
  }
  cmake --build --preset release --parallel "$1" --target "$2"
}

# What opens pages, from PyPI, in a virtual environment of its own. Playwright uses Debian's Chromium
# and downloads none.
page_tools() {
  local venv=build/pages
  if [[ -e "$venv/ready" ]]; then return; fi
  rm -rf "$venv"
  python3 -m venv "$venv" || die "no virtual environment (Debian: python3-venv)"
  "$venv/bin/pip" install --quiet --disable-pip-version-check playwright axe-playwright-python pytest ||
    die "PyPI has not given playwright, axe-playwright-python and pytest"
  touch "$venv/ready"
}

# Plays the bundled recording of a person who comes and goes, and tracks it: one sensor after another
# would be read in the same way. Ctrl-C ends both.
live() {
  local program=build/release/blindcorner scene=scenes/person_vl53l8ch.json
  local captures=scenes/captures log=out/live player="" port="${PORT:-8628}"
  mkdir -p "$log"
  "$program" replay "$captures/person_gone.exr" "$captures/person_walk.exr" --loop \
    --listen tcp://127.0.0.1:0 >"$log/replay.txt" &
  player=$!
  # shellcheck disable=SC2064  # the number is known now
  trap "kill $player 2>/dev/null || true" EXIT
  trap ':' INT  # live ends by itself, and then this script
  until [[ -s "$log/replay.txt" ]]; do
    kill -0 "$player" 2>/dev/null || die "the recording could not be played"
    sleep 0.1
  done
  if command -v xdg-open >/dev/null && [[ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]]; then
    (sleep 1 && xdg-open "http://127.0.0.1:$port/" >/dev/null 2>&1) &
  fi
  echo "Open http://127.0.0.1:$port/ in a browser; answers go to $PWD/$log/answers.jsonl; Ctrl-C ends it."
  "$program" live "$scene" --input "$(head -n 1 "$log/replay.txt")" --empty-first 2 --port "$port" \
    >"$log/answers.jsonl"
}

main() {
  case "${1:-}" in
    fit | live | test | slow | pages | python) (($# == 1)) || { usage >&2; exit 2; } ;;
    '' | -h | --help) usage; exit 0 ;;
    *) usage >&2; exit 2 ;;
  esac
  local jobs
  jobs=$(job_count)
  cd -- "$(dirname -- "${BASH_SOURCE[0]}")"
  install_packages "${packages[@]}"
  if [[ "$1" == fit ]]; then
    build "$jobs" blindcorner_program
    build/release/blindcorner fit scenes/tmf8828_wall.json scenes/captures/tmf8828_wall.exr -o out/fit
    echo "Page with the picture: $PWD/out/fit/result.html"
  elif [[ "$1" == live ]]; then
    build "$jobs" blindcorner_program
    live
  elif [[ "$1" == pages ]]; then
    # A browser without a font draws boxes.
    install_packages chromium fonts-dejavu-core python3-venv
    page_tools
    build "$jobs" blindcorner_program -DBLINDCORNER_PAGES_PYTHON="$PWD/build/pages/bin/python"
    ctest --preset release -R pages.chromium --verbose
  elif [[ "$1" == python ]]; then
    local extras="${EXTRAS:-ON}"
    [[ "$extras" =~ ^(ON|OFF)$ ]] || die "EXTRAS=$extras: expected ON or OFF"
    install_packages python3-dev python3-venv
    build "$jobs" blindcorner_program -DBLINDCORNER_PYTHON_TEST=ON -DBLINDCORNER_PYTHON_EXTRAS="$extras"
    ctest --preset release -R package.python
  else
    install_optional_packages "${optional_packages[@]}"
    build "$jobs" all
    if [[ "$1" == test ]]; then
      ctest --preset release --parallel "$jobs" --label-exclude slow
    else
      ctest --preset release --parallel "$jobs" --label-regex slow
    fi
  fi
}

# Sourced by other scripts for install_packages.
if [[ "${BASH_SOURCE[0]}" == "$0" ]]; then
  main "$@"
fi
