#!/bin/sh
# tests/fuzz/run.sh SECONDS [READER...]: fuzzes each reader for that time (docs/fuzzing.md). What a
# run adds to the corpus, and the inputs that fail, are stored under build/fuzz/findings.
set -eu
seconds=${1:?usage: run.sh SECONDS [READER...]}
shift
cd "$(dirname "$0")/../.."
CXX=${CXX:-clang++} cmake --preset fuzz > /dev/null
cmake --build build/fuzz --target blindcorner_fuzz
failed=0
for reader in ${*:-$(ls tests/fuzz/corpus)}; do
  findings=build/fuzz/findings/$reader
  mkdir -p "$findings/corpus"
  echo "== $reader"
  if ! nice -n 10 build/fuzz/tests/fuzz/blindcorner_fuzz --reader="$reader" -max_total_time="$seconds" \
      -timeout=20 -rss_limit_mb=2048 -malloc_limit_mb=1024 -max_len=65536 -close_fd_mask=1 \
      -artifact_prefix="$findings/" "$findings/corpus" "tests/fuzz/corpus/$reader" \
      2> "$findings/log"; then
    failed=1
    grep -E "ERROR|SUMMARY|Test unit written" "$findings/log" || tail -3 "$findings/log"
  fi
  grep -E "^Done|DONE" "$findings/log" || true
done
exit $failed
