#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Layout (clang-format) of all C++ files and clang-tidy over all sources, or over the FILEs given.
#   tests/lint.sh [--format-only] [FILE...]
# Versions differ in taste: Debian 12's (14) decide. clang-tidy takes up to a minute a source (Eigen).
set -euo pipefail
unset CDPATH
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
source ./bootstrap.sh

format_only=false
if [[ "${1:-}" == --format-only ]]; then
  format_only=true
  shift
fi
files=("$@")
if ((${#files[@]} == 0)); then
  mapfile -t files < <(find forward include inverse planner src tests -name '*.cpp' -o -name '*.h' | sort)
fi

status=0
install_packages clang-format
clang-format --dry-run -Werror "${files[@]}" || status=1
$format_only && exit "$status"

install_packages clang-tidy
database=build/release/compile_commands.json
[[ -f "$database" ]] || die "$database is missing; ./bootstrap.sh test makes it"
sources=()
for file in "${files[@]}"; do
  # Headers are checked with the sources that include them; tests/package is a project of its own.
  [[ "$file" == *.cpp && "$file" != tests/package/* ]] && sources+=("$file")
done
((${#sources[@]})) || exit "$status"
printf '%s\0' "${sources[@]}" |
  xargs -0 -n 1 -P "$(job_count)" clang-tidy -p "${database%/*}" --quiet 2> >(grep -vE 'warnings? (generated|treated)|^Suppressed|^Use -header-filter' >&2) ||
  status=1
exit "$status"
