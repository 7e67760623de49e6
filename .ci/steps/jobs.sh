# shellcheck shell=bash
# Jobs side by side: two at a time, for most of them use one core. What each says comes when it is done.

declare -A running=() started=() # by process: the job's name, and when that was
failed=() took=()

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

# NAME SINCE PASSED
ended() {
  local seconds=$((SECONDS - $2)) word=took
  $3 || { word="FAILED (above), after" failed+=("$1"); }
  took+=("$(printf '%3d:%02d  %s' $((seconds / 60)) $((seconds % 60)) "$1")")
  say "$1: $word $seconds seconds"
}

log_of() {
  mkdir -p "$BUILD/log"
  echo "$BUILD/log/${1//[ ,\/]/-}.log"
}
