#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The learned baseline beside PyTorch: installs its build for processors in a virtual environment,
# trains a small network by the program, loads its weights there, and compares the outputs on the
# captures held back; then lets PyTorch write weights that the program reads.
#   tests/peers/cnn.sh       exit status 1 where outputs differ by more than 1e-5
set -euo pipefail
unset CDPATH
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.."

program=build/release/blindcorner
[[ -x "$program" ]] || { echo "cnn.sh: build $program first (./bootstrap.sh fit)" >&2; exit 2; }

venv=build/peers/cnn
if [[ ! -x "$venv/bin/python" ]]; then
  python3 -m venv "$venv"
fi
"$venv/bin/python" -c 'import torch, numpy' 2>/dev/null ||
  "$venv/bin/pip" install --quiet --extra-index-url https://download.pytorch.org/whl/cpu \
    torch==2.13.0+cpu numpy

exec "$venv/bin/python" tests/peers/cnn_compare.py --program "$program"
