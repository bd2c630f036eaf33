#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# What `export` writes for tal, read by tal itself, and what tal writes read by `import`: installs
# y-tal from PyPI in a virtual environment.
#   tests/peers/tal.sh       exit status 1 where a number differs
set -euo pipefail
unset CDPATH
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.."

program=build/release/blindcorner
[[ -x "$program" ]] || { echo "tal.sh: build $program first (./bootstrap.sh fit)" >&2; exit 2; }

venv=build/peers/tal
if [[ ! -x "$venv/bin/python" ]]; then
  python3 -m venv "$venv"
fi
"$venv/bin/python" -c 'import tal' 2>/dev/null || "$venv/bin/pip" install --quiet y-tal

exec "$venv/bin/python" tests/peers/tal_compare.py --program "$program"
