#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The learned baselines beside PyTorch: installs it in a virtual environment, trains small networks
# by the program, loads their weights there, and compares the outputs; then lets PyTorch write
# weights that the program reads.
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
  # PyTorch's own index has builds without CUDA, a tenth of the size; without it PyPI's serves.
  "$venv/bin/pip" install --quiet --retries 1 \
    --extra-index-url https://download.pytorch.org/whl/cpu torch==2.13.0 numpy

exec "$venv/bin/python" tests/peers/cnn_compare.py --program "$program"
