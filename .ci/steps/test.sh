# shellcheck shell=bash
# ./dev test: everything once. The build uses both cores; then come jobs side by side, and at the end, one at a time,
# what nothing may run beside.

# For the time that it takes, only a release runs all tests in all builds. Otherwise 5.2, the newest with a window, runs
# all, of tests with many cases other ones for each zip (tests/blender/conftest.py). The others run these,
WHAT_BUILDS_DIFFER_IN=(tests/blender/test_{accelerated_rigs,bake,cages,canvases,graphs,host,memory}.py
  tests/blender/test_{package,panel,render,safety,same_as_modifier,same_pass,shortcuts}.py)

# of which the newest official one, whose shapes are those of 5.2, runs these,
WHAT_A_NEW_BLENDER_CHANGES=(tests/blender/test_{graphs,host,memory,panel,safety,same_as_modifier}.py)

# and those for Windows these. Only a release runs the native tests there; Python for Windows runs what follows.
WHAT_SYSTEMS_DIFFER_IN=(tests/blender/test_{bake,bad_input,graphs,host,package,rigs_as_programs,safety}.py
  tests/blender/test_same_as_modifier.py)
PYTHON_TESTS_OF_SYSTEMS=(tests/python/test_{bake_files,bake_leftovers,bake_systems,boundaries,faults,files,host}.py
  tests/python/test_{hostile_input,instruction_sets,interrupts,rigs_from_blender,skinning,stub,threads,unmade_objects}.py)

# Under the address sanitizer these, which hand over arrays of all kinds: what becomes of them the native tests see there.
PYTHON_TESTS_OF_MEMORY=(tests/python/test_{boundaries,deformer,faults,files,played,host,hostile_input,influences}.py
  tests/python/test_{rig_programs,skeleton,skinning,stages,unmade_objects,weight_tools}.py)

# What a person does in a window. They take five minutes in each program, so that only a release runs all of them in all;
# otherwise 5.2 runs the first three.
WINDOW_TESTS=(in_window played_in_window in_weight_paint weighted first_ogre few_clicks moving_in_window profiled baked reduced each_method)

# [--blender VERSION|all|release] [pytest arguments for the tests in Blender]; release: also what only a release needs
run_tests() {
  local versions=(own) missing=() systems=() pythons=(3.13) part=() packaged=(--source tests/wheel tests/python) version kind=
  local in_python=("${PYTHON_TESTS_OF_SYSTEMS[@]}") in_memory=("${PYTHON_TESTS_OF_MEMORY[@]}") since
  declare -A blenders=([own]=$BLENDER)
  trap 'kill 0' INT # which a command in the background does not hear
  if [ "${1:-}" = --blender ]; then
    kind=${2:?--blender wants a version, or all}
    shift 2
    case $kind in
      all | windows-*) systems=(windows) ;;
      release) systems=("${SYSTEMS[@]}") ;;
    esac
    if [[ "$kind" =~ ^(all|release)$ ]]; then # unpacking them leaves a core to what needs none of their Pythons
      start "Debian releases" set_up_releases
      TARGET=sinew_tests build
      await_all # each one's Python gets a module
      start "Blenders" blenders_of "$kind"
    else
      set_up_blenders "$kind"
    fi
  else
    [ "$BLENDER" != blender ] || install_packages blender
  fi
  ended "setting up" 0 true
  since=$SECONDS
  [ "$kind" != all ] || PYTHONS=(3.13) # of the Blender for Windows that is tested
  build
  package_and_wheel "${systems[@]}"
  ended "building" "$since" true
  await_all
  [[ ! "$kind" =~ ^(all|release)$ ]] || set_up_blenders "$kind"
  start "lint" check_format_and_types
  start "native tests" ctest --test-dir "$BUILD" --output-on-failure
  [ "$kind" != release ] || in_memory=()
  start "address sanitizer" sanitize_address "${in_memory[@]}"
  # The two longest, the sanitizer and 5.2, are first, so that the short ones fill both cores at the end.
  install_packages assimp-testmodels assimp-utils # characters that nobody here made; a reader of glTF and FBX
  for version in "${versions[@]}"; do
    part=()
    [[ ! "$kind $version" =~ ^all\ (3|4) ]] || part=("${WHAT_BUILDS_DIFFER_IN[@]}")
    [[ "$kind $version" != "all 5.3" ]] || part=("${WHAT_A_NEW_BLENDER_CHANGES[@]}")
    [[ "$kind $version" != "all windows-"* ]] || part=("${WHAT_SYSTEMS_DIFFER_IN[@]}")
    start "Blender $version" test_in_blender "$version" "${part[@]}" "$@"
  done
  start "Python tests" python_tests # with Debian 12's numpy 1; the Python package's are run with 2, too
  [ "$kind" != release ] || start "Windows" cross windows
  if [[ " ${systems[*]} " = *" windows "* ]]; then
    [ "$kind" != release ] || pythons=(3.11 3.13 3.14) in_python=(tests/python)
    for version in "${pythons[@]}"; do
      start "Python $version for Windows" windows_python_tests "$version" "${in_python[@]}"
    done
  fi
  if [[ " ${systems[*]} " = *" aarch64 "* ]]; then
    start "Python for ARM" arm_python_tests
  fi
  if [[ "$kind" =~ ^(all|release)$ ]]; then
    start "modules as files" binaries_tests
  fi
  if [ "$kind" = release ]; then
    start "Blender's structs" .ci/layouts
    start "thread sanitizer" sanitize thread
    start "ARM" cross aarch64
    start "Clang" cross clang # which also makes the modules for macOS
    start "clang-tidy" tidy
    start "fuzzing" fuzz
  fi
  [ "$kind" = release ] || packaged=(tests/wheel)
  start "Python package" package_tests "${packaged[@]}"
  for version in "${versions[@]}"; do
    [[ ! $version =~ ^(own|3.4|5.2)$ || "$kind $version" = "all 3.4" ]] || start "farm with Blender $version" farm_tests "$version"
  done
  await_all
  for version in "${versions[@]}"; do # one at a time: a window that waits for a core is late
    pick "$version"
    part=("${WINDOW_TESTS[@]}")
    [ "$kind" != all ] || part=("${WINDOW_TESTS[@]:0:3}")
    [[ "$kind $version" =~ ^all\ (3.4|4.3)$ ]] || is_module || alone "window of Blender $version" window_tests "${part[@]}"
  done
  report
}

# How long each step took, and what is wrong.
report() {
  local version
  say "durations"
  printf '%s\n' "${took[@]}" | $PYTHON .ci/budget.py "$kind"
  awk -v before="$cores_before" '/^cpu / {
    split(before, was)
    for (i = 2; i <= 9; i++) { all += $i - was[i]; if (i == 5 || i == 6) idle += $i - was[i] }
    printf "the cores were busy for %d %% of the time\n", 100 * (1 - idle / all)
  }' /proc/stat
  for version in "${missing[@]}"; do
    say "NOT TESTED: BLENDER $version COULD NOT BE SET UP"
  done
  if [ ${#failed[@]} -gt 0 ]; then
    say "FAILED: $(printf '%s; ' "${failed[@]}")"
    exit 1
  fi
  say "all tests passed"
}

# [WHAT...]: without, all
python_tests() {
  local scipy
  [ $# -gt 0 ] || set -- tests/python
  scipy=$(.ci/pypi scipy)
  say "Python tests"
  PYTHONPATH=$scipy SINEW_BUILD=$BUILD $PYTHON -m pytest -q --durations=8 -p no:cacheprovider "$@"
}

# VERSION of Python, WHAT...
windows_python_tests() {
  local original
  original=$(.ci/windows_python "$1") &&
    tests_with_wheel Windows "$original" "$BUILD/windows-python-$1" "cp${1/./}-*-win_amd64" "${@:2}"
}

arm_python_tests() {
  local original
  original=$(.ci/arm_python) && tests_with_wheel "64-bit ARM" "$original" "$BUILD/arm-python" "cp311-*_aarch64" tests/python
}

# SYSTEM PYTHON FOLDER WHEEL WHAT...: with the wheel, as pip installs it into FOLDER, a copy of PYTHON; all but the tests
# that read machine code.
tests_with_wheel() {
  say "Python tests, $("$2/run" --version) for $1"
  # shellcheck disable=SC2086 # a pattern
  rm -rf "$3" && cp -r "$2" "$3" &&
    "$3/run" -m pip install -q --no-index --no-deps "$BUILD"/wheels/sinew_native-*-$4.whl &&
    SINEW_BUILD='' SINEW_ZIP=$ZIP "$3/run" -m pytest -q --durations=8 -p no:cacheprovider tests/wheel "${@:5}" \
      --ignore tests/python/test_vectorisation.py
}

# What the modules for all systems need and show.
binaries_tests() {
  local lief libraries
  lief=$(.ci/pypi lief) && libraries=$(.ci/macos_python) || return 1
  say "tests of the modules as files"
  PYTHONPATH=$lief SINEW_LIBPYTHONS=$libraries SINEW_MODULES=$(IFS=: && echo "${MODULES[*]}") \
    $PYTHON -m pytest -q --durations=8 -p no:cacheprovider tests/binaries
}

# WHAT...: folders of tests, in each environment
package_tests() {
  install_packages libhwy-dev libtbb-dev # Debian's own, for `pip install .`
  say "tests of the Python package"
  SINEW_ZIP=$ZIP tests/wheel/run "$BUILD/wheels" "$BUILD/environments" "$@"
}

set_up_releases() {
  local python
  for python in 3.14 3.13; do
    .ci/blender python $python
  done
}

# all|release: sets up what can be, before it is asked for.
blenders_of() {
  local version
  for version in $(versions_of "$1"); do
    .ci/blender "$version" || true
  done
}

# VERSION|all|release: prints the versions.
versions_of() {
  case $1 in
    all) .ci/blender versions ;;
    release) .ci/blender releases ;;
    *) echo "$1" ;;
  esac
}

# VERSION|all|release: fills in versions, their commands in blenders, and missing, which could not be set up.
set_up_blenders() {
  local version command wanted
  mapfile -t wanted < <(versions_of "$1")
  versions=()
  for version in "${wanted[@]}"; do
    if command=$(.ci/blender "$version"); then
      versions+=("$version")
      blenders[$version]=$command
    elif [ ${#wanted[@]} -gt 1 ]; then
      missing+=("$version")
    else
      exit 1
    fi
  done
}

# The later steps use that one of `blenders`, with a profile of its own.
pick() {
  BLENDER=${blenders[$1]} PROFILE=$BUILD/profile-$1
}

is_module() {
  [[ $("$BLENDER" --version) == *"Python module"* ]]
}

# VERSION [pytest arguments]: the zip, installed in a fresh profile.
test_in_blender() {
  pick "$1"
  say "tests in $("$BLENDER" --version | head -1)" &&
    install_in_profile &&
    SINEW_SAMPLES=$([ "${kind:-}" != all ] || cksum <"$ZIP" | cut -d" " -f1) pytest_in_blender "$@" &&
    { is_module || walk_at_random --seed gate --steps 120; } &&
    { [ "$1" != 5.2 ] || [ $# -gt 1 ] || tests_without_memory "$1"; }
}

# VERSION: the same tests while Sinew does without Blender's memory, before each commit a tenth of them.
tests_without_memory() {
  say "tests without Blender's memory"
  SINEW_SAFE=1 SINEW_SAMPLES=$([ "${kind:-}" != all ] || cksum <"$ZIP" | cut -d" " -f1) pytest_in_blender "$1"
}

# VERSION [pytest arguments]: with the zip that is installed
pytest_in_blender() {
  SINEW_USD=$(usd_core "$1") SINEW_ZIP=$ZIP \
    isolated_blender -b --python-exit-code 1 --python tests/blender/run.py -- "${@:2}"
}

# [--blender VERSION] WORD: the tests of all kinds that have the word in their names, or WHAT...: a file of tests/blender
# or tests/python and further arguments of pytest. In 5.2 if no other is named. What is built is brought up to date.
try_tests() {
  local version=5.2 ROOTS=''
  [ "$BLENDER" = blender ] || version=own
  if [ "${1:-}" = --blender ]; then
    version=${2:?--blender wants a version}
    shift 2
  fi
  case ${1:?which tests? name a word, or a file of tests/blender or tests/python} in
    tests/blender/*) prepare_blender && pytest_in_blender "$version" "$@" ;;
    tests/python/*) TARGET=modules build && python_tests "$@" ;;
    *) try_word "$1" ;;
  esac
}

# Sets up the Blender of `version`, with the zip as it is now.
prepare_blender() {
  [ "$version" = own ] || use_blender "$version"
  PROFILE=$BUILD/profile-$version
  package
  cmp -s "$ZIP" "$PROFILE/installed.zip" || { install_in_profile && cp "$ZIP" "$PROFILE/installed.zip"; }
}

# WORD, in small or capital letters. Of what has no such test, nothing is built.
try_word() {
  local native python blender
  native=$(native_tests_of "$1")
  mapfile -t python < <(files_of "$1" tests/python)
  mapfile -t blender < <(files_of "$1" tests/blender)
  [ -n "$native${python[*]}${blender[*]}" ] || { echo "./dev try: no test has $1 in its name" >&2; exit 2; }
  rm -f "$BUILD/log/.tried"
  if [ ${#blender[@]} -gt 0 ]; then prepare_blender; elif [ ${#python[@]} -gt 0 ]; then TARGET=modules build; fi
  if [ -n "$native" ]; then
    TARGET=sinew_tests build
    start "native tests" "$BUILD/tests/native/sinew_tests" --gtest_brief=1 --gtest_filter="$native"
  fi
  [ ${#python[@]} -eq 0 ] || start "Python tests" some_of python_tests "${python[@]}" -k "$1"
  [ ${#blender[@]} -eq 0 ] || start "Blender $version" some_of pytest_in_blender "$version" "${blender[@]}" -k "$1"
  await_all
  [ ${#failed[@]} -eq 0 ] || { say "FAILED: ${failed[*]}"; exit 1; }
  [ -n "$native" ] || [ -e "$BUILD/log/.tried" ] || { echo "./dev try: no test has $1 in its name" >&2; exit 2; }
}

# WORD FOLDER: prints the files of tests that have the word somewhere.
files_of() {
  local file
  for file in "$2"/test_*.py; do
    if [[ ${file,,} = *"${1,,}"* ]] || grep -qi -- "$1" "$file"; then echo "$file"; fi
  done
}

# WORD: prints those that have it in their name or their text, as GoogleTest's filter takes them.
native_tests_of() {
  awk -v word="${1//_/}" '/^TEST/ { split($0, part, /[(,) ]+/); name = "*" part[2] "." part[3] "*" }
    { text = $0; gsub("_", "", text) } name && index(tolower(text), tolower(word)) { print name }' \
    tests/native/*_test.cpp | sort -u | paste -sd:
}

# COMMAND...: of pytest. That a file has the word, but no test of that name, is no failure.
some_of() {
  local code=0
  "$@" || code=$?
  [ $code -ne 5 ] || return 0
  touch "$BUILD/log/.tried"
  return $code
}

# VERSION of Blender: the folder of USD for its Python, or nothing where a test may do without.
usd_core() {
  is_module || case $1 in
    own) [ "$BLENDER" != blender ] || .ci/pypi usd-core 3.11 ;;
    3.4) .ci/pypi usd-core 3.11 ;;
    4.3) .ci/pypi usd-core 3.13 ;;
    5.2) .ci/pypi usd-core 3.14 ;;
  esac
}

# FILE...: under a virtual screen, drawn in software.
window_tests() {
  install_packages xvfb xauth xdotool imagemagick
  say "window tests in $("$BLENDER" --version | head -1)"
  local folder
  folder=$BUILD/window/$($BLENDER --version | sed -n 's/^Blender \([0-9.]*\).*/\1/p')
  mkdir -p "$folder"
  for file in "$@"; do
    LIBGL_ALWAYS_SOFTWARE=1 isolated xvfb-run -a -s "-screen 0 1280x800x24" tests/blender/hand.sh "$folder" \
      "$BLENDER" --window-geometry 0 0 1280 800 --python tests/blender/$file.py -- "$folder" \
      >"$folder/$file.log" 2>&1 || { tail -40 "$folder/$file.log"; return 1; }
    grep '^window:' "$folder/$file.log"
  done
}

# VERSION: render farms' job descriptions.
farm_tests() {
  pick "$1"
  say "farm tests"
  install_packages nodejs
  local openjd
  openjd=$(.ci/pypi openjd-cli)
  BLENDER=$BLENDER SINEW_OPENJD=$openjd isolated $PYTHON -m pytest -q --durations=8 -p no:cacheprovider tests/farm
}
