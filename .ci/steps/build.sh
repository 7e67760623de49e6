# shellcheck shell=bash
# What is made: the native library, its Python modules, the zip and the wheels.

# With the time since the start.
say() { printf '\n== %d:%02d %s\n' $((SECONDS / 60)) $((SECONDS % 60)) "$*"; }

# Of several jobs that want some at a time one waits for the other.
install_packages() {
  ! dpkg -s "$@" >/dev/null 2>&1 || return 0
  say "installing $*"
  local as_root=()
  [ "$(id -u)" -eq 0 ] || as_root=(sudo)
  (
    flock 9
    "${as_root[@]}" apt-get update -qq &&
      "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y -qq --no-install-recommends --no-upgrade "$@" >/dev/null
  ) 9<dev
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

# [CMake options]; TARGET: what to build if not everything
build() {
  say "building"
  local roots
  roots=$(.ci/blender roots | paste -sd ';') # their Pythons get a module too
  configure_and_build "$BUILD" -DSINEW_PYTHON_ROOTS="$roots" "$@"
}

# A zip with the modules of the Blenders that are set up.
package() {
  install_packages python3-markdown
  TARGET=modules build
  say "packaging"
  ZIP=$($PYTHON addon/package.py "$BUILD"/python/sinew_native.*.so "$BUILD")
  echo "$ZIP"
}

# Wheels of the very modules that are in the zip. The platform is what install.md asks for.
wheel() {
  install_packages python3-pip
  TARGET=modules build
  say "wheels"
  rm -rf "$BUILD/wheels"
  local module tag
  for module in "$BUILD"/python/sinew_native.cpython-*.so; do
    tag=cp$(sed 's/.*cpython-\([0-9]*\)-.*/\1/' <<<"$module")
    SOURCE_DATE_EPOCH=315532800 $PYTHON -m pip wheel -q --no-deps --wheel-dir "$BUILD/wheels" \
      --config-settings cmake.define.SINEW_MODULE="$module" \
      --config-settings wheel.tags="$tag-$tag-manylinux_2_34_$(uname -m)" .
  done
  ls "$BUILD"/wheels/*
}

# package or wheel: with the modules of all versions, for the Debian releases have all of their Pythons.
for_all() {
  local version
  for version in $(.ci/blender programs); do
    .ci/blender "$version" >/dev/null
  done
  "$1"
}
