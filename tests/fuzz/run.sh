#!/bin/sh
# tests/fuzz/run.sh [--built PROGRAM] SECONDS [READER...]: fuzzes each reader for that time, with a
# fuzzer that is built first or already there (docs/fuzzing.md). What a run adds to the corpus, and
# the inputs that fail, are stored under build/fuzz/findings.
set -eu
program=
if [ "${1:-}" = --built ]; then
  program=$2
  shift 2
fi
seconds=${1:?usage: run.sh [--built PROGRAM] SECONDS [READER...]}
shift
cd "$(dirname "$0")/../.."
if [ -z "$program" ]; then
  CXX=${CXX:-clang++} cmake --preset fuzz > /dev/null
  cmake --build build/fuzz --target blindcorner_fuzz
  program=build/fuzz/tests/fuzz/blindcorner_fuzz
fi
failed=0
for reader in ${*:-$(ls tests/fuzz/corpus)}; do
  findings=build/fuzz/findings/$reader
  mkdir -p "$findings/corpus"
  echo "== $reader"
  # libhdf5 asks for whatever a damaged file names, stands it when it gets nothing, and leaks.
  sanitizer= malloc_limit=1024
  if [ "$reader" = hdf5 ]; then
    sanitizer=allocator_may_return_null=1:detect_leaks=0 malloc_limit=100000000
  fi
  if ! ASAN_OPTIONS=$sanitizer nice -n 10 "$program" --reader="$reader" -max_total_time="$seconds" \
      -seed="${FUZZ_SEED:-0}" -timeout="${FUZZ_TIMEOUT:-20}" -rss_limit_mb=2048 -malloc_limit_mb="$malloc_limit" -max_len=65536 -close_fd_mask=1 \
      -artifact_prefix="$findings/" "$findings/corpus" "tests/fuzz/corpus/$reader" \
      2> "$findings/log"; then
    failed=1
    grep -E "ERROR|SUMMARY|Test unit written" "$findings/log" || tail -3 "$findings/log"
  fi
  grep -E "^Done|DONE" "$findings/log" || true
done
exit $failed
