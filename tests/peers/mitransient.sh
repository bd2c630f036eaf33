#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The forward models beside mitransient: installs it from PyPI in a virtual environment, renders the
# same two scenes with both, and prints error against processor time and the ratio at 1 %.
#   tests/peers/mitransient.sh [SECONDS]     most processor seconds of one mitransient rendering
set -euo pipefail
unset CDPATH
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.."

program=build/release/blindcorner
[[ -x "$program" ]] || { echo "mitransient.sh: build $program first (./bootstrap.sh fit)" >&2; exit 2; }

# Dr.Jit compiles with LLVM; versions 14 and 15 fail on recent processors.
if [[ -z "${DRJIT_LIBLLVM_PATH:-}" ]]; then
  for library in /usr/lib/*/libLLVM.so.19.1 /usr/lib/*/libLLVM-19.so*; do
    [[ -e "$library" ]] && export DRJIT_LIBLLVM_PATH="$library" && break
  done
fi
[[ -n "${DRJIT_LIBLLVM_PATH:-}" ]] || { echo "mitransient.sh: apt-get install libllvm19, or set DRJIT_LIBLLVM_PATH" >&2; exit 2; }

venv=build/peers/venv
if [[ ! -x "$venv/bin/python" ]]; then
  python3 -m venv "$venv"
fi
"$venv/bin/python" -c 'import mitransient' 2>/dev/null || "$venv/bin/pip" install --quiet mitransient==1.3.1

exec "$venv/bin/python" tests/peers/mitransient_compare.py --program "$program" --seconds "${1:-60}"
