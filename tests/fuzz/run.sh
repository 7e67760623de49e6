#!/usr/bin/env bash
# BUILD TARGET SECONDS: one target, from the repository's corpus and from what earlier runs have found. Says how often
# it ran; fails with what libFuzzer said, and leaves the input in BUILD, if something is wrong.
set -euo pipefail
corpus=$1/corpus/$2
mkdir -p "$corpus"
here=$(dirname "$0")
[ ! -w /dev/shm ] || export TMPDIR=/dev/shm # for the files that the readers read
if ! "$1/tests/fuzz/$2_fuzz" -max_total_time="$3" -timeout=20 -max_len=4096 -dict="$here/words.txt" \
  -artifact_prefix="$1/$2-" -print_final_stats=1 "$corpus" "$here/corpus/$2" >"$1/$2.log" 2>&1; then
  tail -60 "$1/$2.log"
  echo "fuzz: $2 FAILED; $1/tests/fuzz/$2_fuzz FILE runs the input once more, see above for the file"
  exit 1
fi
echo "fuzz: $2, $(sed -n 's/^stat::number_of_executed_units: *//p' "$1/$2.log") executions"
