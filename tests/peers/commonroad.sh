#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The vehicles beside CommonRoad's: installs commonroad-vehicle-models from PyPI in a virtual
# environment, drives its kinematic, single-track and single-track-drift models and the program's
# through the same commands, and prints by how much positions differ within 5 s.
#   tests/peers/commonroad.sh       exit status 1 where equal equations differ by more than 1 mm
set -euo pipefail
unset CDPATH
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.."

program=build/release/blindcorner
[[ -x "$program" ]] || { echo "commonroad.sh: build $program first (./bootstrap.sh fit)" >&2; exit 2; }

venv=build/peers/commonroad
if [[ ! -x "$venv/bin/python" ]]; then
  python3 -m venv "$venv"
fi
"$venv/bin/python" -c 'import scipy, vehiclemodels' 2>/dev/null ||
  "$venv/bin/pip" install --quiet commonroad-vehicle-models==3.0.2 scipy

exec "$venv/bin/python" tests/peers/commonroad_compare.py --program "$program"
