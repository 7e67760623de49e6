# shellcheck shell=bash
# Formatting and static checks.

lint() {
  check_format_and_types && tidy
}

# All but clang-tidy, which takes most of the time.
check_format_and_types() {
  say "ruff"
  local ruff
  ruff=$(.ci/pypi ruff)/bin/ruff
  "$ruff" format --check . && "$ruff" check . || return 1
  say "mypy"
  install_packages python3-numpy
  PYTHONPATH=$(.ci/pypi mypy) $PYTHON -m mypy || return 1
  install_packages clang-format shellcheck
  say "shellcheck"
  grep -lE '^#!.*\bbash$' -r dev .ci tests docs | xargs shellcheck --severity=warning --external-sources --check-sourced ||
    return 1
  say "clang-format"
  find native tests \( -name '*.h' -o -name '*.cpp' \) -exec clang-format --dry-run -Werror {} +
}

tidy() {
  install_packages clang-tidy
  say "clang-tidy"
  # For its compile_commands.json. Each source as it stands: with what it includes itself, and the kernels once.
  configure "$BUILD/lint" -DSINEW_PYTHON=OFF -DSINEW_TESTS=OFF -DSINEW_PRECOMPILED_HEADERS=OFF -DSINEW_UNITY=OFF \
    -DCMAKE_CXX_FLAGS=-DHWY_COMPILE_ONLY_STATIC || return 1
  run-clang-tidy -quiet -p "$BUILD/lint" -j "$(nproc)" -extra-arg=-Wno-unknown-warning-option \
    "$PWD/native/src/" >"$BUILD/lint/log" 2>&1 ||
    { grep -E '(warning|error): ' "$BUILD/lint/log" | sort -u; return 1; }
}
