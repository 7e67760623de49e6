# shellcheck shell=bash
# The native library, compiled and tested in other ways than it is shipped.

# Highway's for x86 are left out but AVX2 and what there is without any.
ONE_INSTRUCTION_SET='-DSINEW_DISABLED_TARGETS=HWY_SSE4|HWY_AVX3'

# Tests ask for memory that cannot be had; the sanitizers would end them there.
NO_MEMORY_IS_NO_FAULT=allocator_may_return_null=1

# [thread|address]...: without a name both
sanitize() {
  local kinds=("$@") kind
  [ $# -gt 0 ] || kinds=(thread address)
  for kind in "${kinds[@]}"; do
    case $kind in
      thread | address) "sanitize_$kind" || return 1 ;;
      *) echo "there is no sanitizer $kind; expected thread or address" >&2; exit 2 ;;
    esac
  done
}

# FOLDER SANITIZERS [CMake options]. What reads nowhere, or behind an object, the address sanitizer finds as well: to look
# for it twice takes a third of the time to compile. Eigen asks for memory as it does without sanitizers, for code that is
# compiled so may free it.
build_sanitized() {
  configure_and_build "$1" -DSINEW_SANITIZE="$2" -DCMAKE_BUILD_TYPE=Sanitized \
    -DCMAKE_CXX_FLAGS_SANITIZED="-O1 -g1 -fno-sanitize=null,object-size,pointer-overflow -DEIGEN_MALLOC_ALREADY_ALIGNED=1" "${@:3}"
}

sanitize_thread() {
  say "native tests under the thread sanitizer"
  local folder=$BUILD/sanitize-thread instrumented
  instrumented=$(.ci/libraries thread)
  # Threads meet alike in every instruction set.
  build_sanitized "$folder" thread -DTBB_DIR="$instrumented/lib/cmake/TBB" -DSINEW_PYTHON=OFF "$ONE_INSTRUCTION_SET" &&
    TSAN_OPTIONS=$NO_MEMORY_IS_NO_FAULT \
      ctest --test-dir "$folder" --output-on-failure -E '/(SSE2|EMU128|SCALAR)( |$)'
}

# [WHAT...]: of the Python tests; without, all, and with all instruction sets. With, what is compiled is what may do
# harm: the library with both sanitizers, its bindings with the one for memory, and the tests not at all, which are linked
# as they were compiled to be run without.
sanitize_address() {
  local folder=$BUILD/sanitize-address runtime='' library options
  if [ $# -gt 0 ]; then
    TARGET=sinew_tests build
    options=("$ONE_INSTRUCTION_SET" -DSINEW_COMPILED_TESTS="$BUILD/tests/native/objects.txt"
      -DSINEW_MODULE_OPTIONS="-O0;-fno-sanitize=undefined")
  else
    set -- tests/python
    # SSE2 has vectors of the same size.
    options=(-DSINEW_DISABLED_TARGETS=HWY_SSE4 -DSINEW_COMPILED_TESTS= -DSINEW_MODULE_OPTIONS=)
  fi
  say "native tests under the address,undefined sanitizer"
  build_sanitized "$folder" address,undefined "${options[@]}" &&
    ASAN_OPTIONS=$NO_MEMORY_IS_NO_FAULT ctest --test-dir "$folder" --output-on-failure || return 1
  say "Python tests under the address,undefined sanitizer"
  for library in libasan.so libubsan.so libstdc++.so.6; do
    runtime+="$(g++ -print-file-name=$library) "
  done
  # Without leaks, of which Python itself has many, and without the test that reads the machine code.
  LD_PRELOAD=$runtime ASAN_OPTIONS=detect_leaks=0:$NO_MEMORY_IS_NO_FAULT SINEW_BUILD=$folder $PYTHON -m pytest -q --durations=8 -p no:cacheprovider \
    "$@" --ignore tests/python/test_vectorisation.py
}

# [--seconds N]; two at a time
fuzz() {
  local seconds=30
  [ "${1:-}" != --seconds ] || seconds=${2:?--seconds wants a number}
  install_packages clang libclang-rt-dev
  say "fuzzing, $seconds seconds each"
  local folder=$BUILD/fuzz
  configure_and_build "$folder" -DCMAKE_CXX_COMPILER=clang++ -DSINEW_PYTHON=OFF -DSINEW_TESTS=OFF -DSINEW_FUZZ=ON \
    -DSINEW_SANITIZE=address,undefined,fuzzer-no-link -DCMAKE_CXX_FLAGS_RELEASE="-O1 -g1" \
    "$ONE_INSTRUCTION_SET" || return 1
  printf '%s\n' bvh dmat obj rig rig_file rig_program skeleton skin weights weight_tools | xargs -P 2 -I{} tests/fuzz/run.sh "$folder" {} "$seconds"
}

# [clang|windows|aarch64]...: without a name all
cross() {
  local targets=("$@") target
  [ $# -gt 0 ] || targets=(clang windows aarch64)
  for target in "${targets[@]}"; do
    say "native tests: $target"
    case $target in
      clang)
        install_compiler clang &&
          CROSS=clang configure_and_build "$BUILD/clang" -DSINEW_PYTHON=OFF \
            -DCMAKE_TOOLCHAIN_FILE="$PWD/.ci/toolchains/clang.cmake" || return 1
        ;;
      windows) .ci/wine cmd /c ver && TARGET=sinew_tests build_for windows || return 1 ;;
      aarch64) install_packages qemu-user && TARGET=sinew_tests build_for aarch64 || return 1 ;;
      *) echo "there is no target $target; expected clang, windows or aarch64" >&2; exit 2 ;;
    esac
    ctest --test-dir "$BUILD/$target" --output-on-failure || return 1
  done
}
