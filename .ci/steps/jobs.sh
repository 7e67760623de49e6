# shellcheck shell=bash
# Jobs side by side: two at a time, for most of them use one core. What each says comes when it is done.

declare -A running=() started=() # by process: the job's name, and when that was
failed=() took=() # of each job the seconds that passed, those of a processor, and its name
processor=0 cores_before=$(head -1 /proc/stat)

# NAME COMMAND [arguments]: as soon as there is a place.
start() {
  [ ${#running[@]} -lt 2 ] || await_one
  say "$1: started"
  (set -e; "${@:2}") >"$(log_of "$1")" 2>&1 </dev/null &
  running[$!]=$1 started[$!]=$SECONDS
}

# NAME COMMAND [arguments]: now, with nothing beside it but jobs that run already.
alone() {
  local since=$SECONDS passed=true
  (set -e; "${@:2}") & # where `set -e` is heeded, as in a job
  wait $! || passed=false
  ended "$1" "$since" $passed
}

# Shows what the first of `running` to end has said.
await_one() {
  local pid passed=true
  wait -n -p pid "${!running[@]}" || passed=false
  cat "$(log_of "${running[$pid]}")"
  ended "${running[$pid]}" "${started[$pid]}" $passed
  unset "running[$pid]"
}

await_all() {
  while [ ${#running[@]} -gt 0 ]; do
    await_one
  done
}

# NAME SINCE PASSED: of what was waited for last
ended() {
  local seconds=$((SECONDS - $2)) word=took used=$processor
  count_processor
  $3 || { word="FAILED (above), after" failed+=("$1"); }
  took+=("$seconds $((processor - used)) $1")
  say "$1: $word $seconds seconds"
}

# Sets `processor` to the seconds that all processes took that were waited for so far, and theirs.
count_processor() {
  local minutes
  mkdir -p "$BUILD/log"
  times >"$BUILD/log/.times" # in a subshell it would be that of the subshell
  minutes=$(tail -1 "$BUILD/log/.times" | sed -E 's/([0-9]+)m([0-9.]+)s/\1*60+\2/g; s/ /+/')
  processor=$(awk "BEGIN {printf \"%d\", $minutes}")
}

log_of() {
  mkdir -p "$BUILD/log"
  echo "$BUILD/log/${1//[ ,\/]/-}.log"
}
