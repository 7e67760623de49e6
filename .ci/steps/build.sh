# shellcheck shell=bash
# What is made: the native library, its Python modules, the zip and the wheels.

# With the time since the start.
say() { printf '\n== %d:%02d %s\n' $((SECONDS / 60)) $((SECONDS % 60)) "$*"; }

# The systems besides this one for which there are modules, named as in .ci/toolchains and .ci/pythons.
SYSTEMS=(windows aarch64 macos-arm64 macos-x64)

# Installs the compiler of a name in .ci/toolchains, and what native tests need. Those for macOS install themselves.
install_compiler() {
  case $1 in
    clang) install_packages googletest clang-16 libc++-16-dev libc++abi-16-dev ;;
    windows) install_packages googletest g++-mingw-w64-x86-64-posix ;;
    aarch64) install_packages googletest g++-aarch64-linux-gnu ;;
  esac
}

PYTHONS=() # for which there are modules for another system, if not for all

# SYSTEM [CMake options]: its modules, and what else TARGET names, in build/SYSTEM.
build_for() {
  install_compiler "$1"
  local pythons
  pythons=$(.ci/pythons "$1" "${PYTHONS[@]}") || return 1
  CROSS=$1 configure_and_build "$BUILD/$1" -DSINEW_PYTHON=ON -DSINEW_CROSS_PYTHONS="$pythons" \
    -DCMAKE_TOOLCHAIN_FILE="$PWD/.ci/toolchains/$1.cmake" "${@:2}"
}

# FOLDER [CMake options]; CROSS: a name in .ci/toolchains if not for this machine
configure() {
  install_packages "${PACKAGES[@]}"
  LIBRARIES=$(.ci/libraries ${CROSS:+"$CROSS"})
  PYBIND11=$(.ci/pypi pybind11)
  cmake -S . -B "$1" -G Ninja -DPython3_EXECUTABLE=$PYTHON -DCMAKE_BUILD_TYPE=Release \
    -Dpybind11_DIR="$PYBIND11/pybind11/share/cmake/pybind11" -DCMAKE_PREFIX_PATH="$LIBRARIES" \
    -DTBB_DIR="$LIBRARIES/lib/cmake/TBB" -DHWY_DIR="$LIBRARIES/lib/cmake/hwy" "${@:2}" >/dev/null
}

# FOLDER [CMake options]
configure_and_build() {
  configure "$@" && cmake --build "$1" --parallel "$(nproc)" --target "${TARGET:-all}"
}

# [CMake options]; TARGET: what to build if not everything; ROOTS: the root folders whose Pythons get a module too, if not
# all that are set up
build() {
  say "building"
  local roots
  roots=${ROOTS-$(.ci/blender roots | paste -sd ';')}
  configure_and_build "$BUILD" -DSINEW_PYTHON_ROOTS="$roots" "$@"
}

# [SYSTEM...]: zips with the modules for this system and those.
package() {
  build_modules "$@"
  make_zips
}

# Of MODULES. ZIP is the one for all systems.
make_zips() {
  install_packages python3-markdown
  say "packaging"
  local made
  made=$($PYTHON addon/package.py "${MODULES[@]}" "$BUILD")
  echo "$made"
  ZIP=$(head -1 <<<"$made")
}

# The pages that are in the zip.
manual() {
  install_packages python3-markdown
  $PYTHON addon/manual.py "$BUILD/manual"
}

# [SYSTEM...]: sets MODULES to the files, also those for the Pythons of ROOTS.
build_modules() {
  local system
  TARGET=modules build
  mapfile -t MODULES <"$BUILD/modules.txt"
  for system in "$@"; do
    say "building modules for $system"
    TARGET=modules build_for "$system"
    mapfile -t -O ${#MODULES[@]} MODULES <"$BUILD/$system/modules.txt"
  done
}

# [SYSTEM...]: wheels with the modules for this system and those.
wheel() {
  build_modules "$@"
  make_wheels
}

# Of MODULES, the very ones that are in the zip. The platform is what install.md asks for.
make_wheels() {
  install_packages python3-pip
  say "wheels"
  rm -rf "$BUILD/wheels"
  local module python platform
  for module in "${MODULES[@]}"; do
    python=cp$(sed 's/.*\.c[a-z-]*\([0-9]*\)-.*/\1/' <<<"$module")
    case $module in
      *-win_amd64.pyd) platform=win_amd64 ;;
      */macos-arm64/*) platform=macosx_11_0_arm64 ;;
      */macos-x64/*) platform=macosx_11_0_x86_64 ;;
      *-aarch64-*) platform=manylinux_2_34_aarch64 ;;
      *) platform=manylinux_2_34_$(uname -m) ;;
    esac
    SOURCE_DATE_EPOCH=315532800 $PYTHON -m pip wheel -q --no-deps --wheel-dir "$BUILD/wheels" \
      --config-settings cmake.define.SINEW_MODULE="$module" --config-settings wheel.tags="$python-$python-$platform" .
  done
  ls "$BUILD"/wheels/*
}

# [SYSTEM...]
package_and_wheel() {
  package "$@"
  make_wheels
}

# package, wheel or both: with the modules of all versions, for the Debian releases have all of their Pythons, and for all
# systems.
for_all() {
  local version
  for version in $(.ci/blender programs); do
    .ci/blender "$version" >/dev/null
  done
  "$1" "${SYSTEMS[@]}"
  compare_packages
}

# Whether Debian's packages are those that .ci/debian.txt lists.
compare_packages() {
  local found
  found=$(.ci/pins) || {
    say "what was made may differ from what others make of this commit:"
    echo "$found"
  }
}
