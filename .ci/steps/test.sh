# shellcheck shell=bash
# ./dev test: everything once. The build uses both cores; then come jobs side by side, and at the end, one at a time,
# what nothing may run beside.

# [--blender VERSION|all] [pytest arguments for the tests in Blender]
run_tests() {
  local versions=(own) missing=() version
  declare -A blenders=([own]=$BLENDER)
  trap 'kill 0' INT # which a command in the background does not hear
  if [ "${1:-}" = --blender ]; then
    set_up_blenders "${2:?--blender wants a version, or all}" # first: the build makes a module for each one's Python
    shift 2
  else
    [ "$BLENDER" != blender ] || install_packages blender
  fi
  build
  package
  wheel
  start "lint" lint
  start "native tests" ctest --test-dir "$BUILD" --output-on-failure
  start "address sanitizer" sanitize address
  start "thread sanitizer" sanitize thread
  start "Python tests, numpy 1" python_tests # Debian 12's own
  start "Python tests, numpy 2" python_tests "$(.ci/pypi numpy)" # official Blenders', and people's
  start "Windows" cross windows
  start "ARM" cross aarch64
  start "Clang" cross clang
  start "fuzzing" fuzz
  start "Python package" package_tests
  install_packages assimp-testmodels # characters that nobody here made
  for version in "${versions[@]}"; do
    start "Blender $version" test_in_blender "$version" "$@"
  done
  await_all
  for version in "${versions[@]}"; do # one at a time: a window that waits for a core is late
    pick "$version"
    is_module || alone "window of Blender $version" window_tests
    [[ ! $version =~ ^(own|3.4|5.2)$ ]] || alone "farm with Blender $version" farm_tests
  done
  report
}

# How long each step took, and what is wrong.
report() {
  local version
  say "durations"
  printf '%s\n' "${took[@]}"
  for version in "${missing[@]}"; do
    say "NOT TESTED: BLENDER $version COULD NOT BE SET UP"
  done
  if [ ${#failed[@]} -gt 0 ]; then
    say "FAILED: $(printf '%s; ' "${failed[@]}")"
    exit 1
  fi
  say "all tests passed"
}

# [FOLDER of another numpy]
python_tests() {
  local scipy packages
  scipy=$(.ci/pypi scipy)
  packages=${1:+$1:}$scipy
  say "Python tests, numpy $(PYTHONPATH=$packages $PYTHON -c 'import numpy; print(numpy.__version__)')"
  PYTHONPATH=$packages SINEW_BUILD=$BUILD $PYTHON -m pytest -q -p no:cacheprovider tests/python
}

package_tests() {
  install_packages libhwy-dev libtbb-dev # Debian's own, for `pip install .`
  say "tests of the Python package"
  SINEW_ZIP=$ZIP tests/wheel/run "$BUILD/wheels" "$BUILD/environments"
}

# VERSION|all: fills in versions, their commands in blenders, and missing, which could not be set up.
set_up_blenders() {
  local version command wanted=("$1")
  [ "$1" != all ] || mapfile -t wanted < <(.ci/blender versions)
  versions=()
  for version in "${wanted[@]}"; do
    if command=$(.ci/blender "$version"); then
      versions+=("$version")
      blenders[$version]=$command
    elif [ "$1" = all ]; then
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
    SINEW_USD=$(usd_core "$1") SINEW_ZIP=$ZIP \
      isolated_blender -b --python-exit-code 1 --python tests/blender/run.py -- "${@:2}" &&
    { is_module || walk_at_random --seed gate --steps 300; }
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

# Under a virtual screen, drawn in software.
window_tests() {
  install_packages xvfb xauth xdotool imagemagick
  say "window tests in $("$BLENDER" --version | head -1)"
  local folder
  folder=$BUILD/window/$($BLENDER --version | sed -n 's/^Blender \([0-9.]*\).*/\1/p')
  mkdir -p "$folder"
  for file in in_window in_weight_paint first_ogre profiled baked each_method; do
    LIBGL_ALWAYS_SOFTWARE=1 isolated xvfb-run -a -s "-screen 0 1280x800x24" tests/blender/hand.sh "$folder" \
      "$BLENDER" --window-geometry 0 0 1280 800 --python tests/blender/$file.py -- "$folder" \
      >"$folder/$file.log" 2>&1 || { tail -40 "$folder/$file.log"; return 1; }
    grep '^window:' "$folder/$file.log"
  done
}

# Render farms' job descriptions.
farm_tests() {
  say "farm tests"
  install_packages nodejs
  local openjd
  openjd=$(.ci/pypi openjd-cli)
  BLENDER=$BLENDER SINEW_OPENJD=$openjd isolated $PYTHON -m pytest -q -p no:cacheprovider tests/farm
}
