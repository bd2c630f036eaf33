#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The tables of docs/cheapspad.md, from the data set's .mat files.
set -euo pipefail
if (($# != 2)); then
  echo "usage: docs/cheapspad.sh DATA OUT    DATA: folder of the .mat files; OUT: folder for tables and pages" >&2
  exit 2
fi
data=$1 out=$2
program=${PROGRAM:-build/release/blindcorner}
mkdir -p "$out"
table() { # set, file, published filter
  "$program" import "$data/$2" --published-filter "$3" -o "$out/$1.exr"
  "$program" import "$data/$2" --published-filter "$3" --repeats 2 -o "$out/$1_pairs.exr"
  "$program" crossvalidate "scenes/cheapspad_$1.json" "$out/$1.exr" --samples "$out/$1_pairs.exr" \
    --importance-samples 2048 -o "$out/$1"
}
table mirrors smalltarget_mirrors_train.mat mirrors
table nomirrors bigtarget_nomirrors_train.mat nomirrors
