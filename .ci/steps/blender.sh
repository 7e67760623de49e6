# shellcheck shell=bash
# The zip in Blender: installed, played, walked through at random.

# Blender with a throw-away profile.
isolated_blender() {
  isolated "$BLENDER" "$@"
}

isolated() {
  HOME=$PROFILE BLENDER_USER_RESOURCES=$PROFILE "$@"
}

# Lets the later steps use that version, and a module for its Python.
use_blender() {
  BLENDER=$(.ci/blender "$1")
  ROOTS=$(.ci/blender root "$1")
}

install_zip() {
  local installing=''
  if [ "$BLENDER" = blender ]; then
    ROOTS='' # its Python is this machine's
    # What compiling needs first, for apt does one thing at a time; Blender meanwhile.
    install_packages "${PACKAGES[@]}" dpkg-dev python3-markdown python3-pip
    install_packages blender &
    installing=$!
  fi
  package
  [ -z "$installing" ] || wait "$installing" || {
    echo "Blender could not be installed: look for what apt says above" >&2
    exit 1
  }
  say "installing the zip in a fresh profile"
  install_in_profile
}

install_in_profile() {
  rm -rf "$PROFILE" && mkdir -p "$PROFILE" &&
    isolated_blender -b --python-exit-code 1 --python addon/install.py -- "$ZIP" | grep -v '^$'
}

demo() {
  install_zip
  say "playing"
  local folder=${1:-ogre} poses=walk.dmat
  [ "$folder" != capsule ] || poses=pose.dmat # a twist
  [ -d "data/$folder" ] && folder=data/$folder
  isolated_blender -b --python-exit-code 1 --python addon/demo.py -- "$folder" "$BUILD/demo" "$poses" |
    grep --line-buffered -vE '^(Fra:|Saved:| Time:|$)' # the renderer's progress
}

# With the zip that is installed. A walk that fails is cut down to the steps that matter. With --poison among the options,
# Blender and the C library overwrite what they free, so that whoever still reads it is found out.
walk_at_random() {
  local option options=() command=("$BLENDER") freed=0 # what the C library writes over it; 0: nothing
  for option in "$@"; do
    if [ "$option" = --poison ]; then freed=165 command+=(--debug-memory); else options+=("$option"); fi
  done
  say "a random walk in $("$BLENDER" --version | head -1)"
  MALLOC_PERTURB_=$freed isolated $PYTHON tests/blender/walk/shrink.py "${options[@]}" -- "${command[@]}"
}

# [--blender VERSION] [--poison] [options of walk/shrink.py]
walk() {
  if [ "${1:-}" = --blender ]; then
    use_blender "${2:?--blender wants a version}"
    shift 2
  fi
  install_zip
  walk_at_random "$@"
}
