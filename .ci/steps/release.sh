# shellcheck shell=bash
# ./dev release: what is uploaded for a version, in build/release.

release() {
  local version blender folder=$BUILD/release
  version=$($PYTHON .ci/release.py check)
  check_packages -v "not installed" # which comes
  (run_tests --blender release) # in a shell of its own, which it ends
  blender=$(.ci/blender 4.3) # any from 4.2 on makes an index; this one's Debian is released
  for_all package_and_wheel
  check_packages
  $PYTHON .ci/release.py collect "$BUILD" "$folder"
  make_index "$blender" "$folder"
  $PYTHON .ci/release.py finish "$folder"
  say "Sinew $version is in $folder"
  ls -lh "$folder"
  cat <<END

Next, as docs/releasing.md says:
  git tag -a v$version -m "Sinew $version"
  git push origin v$version
Then upload everything in $folder to the release of that tag, with NOTES.md as its text.
END
}

# [options of grep]: refuses if Debian's packages that the options pick are not those of .ci/debian.txt.
check_packages() {
  local found
  found=$({ .ci/pins || true; } | grep "${@:-.}") || return 0
  printf '%s\n' "$found" "./dev release: so .ci/debian.txt would be wrong. Run .ci/pins move, and commit what it changes" >&2
  exit 1
}

# BLENDER FOLDER: an index for Blender's Get Extensions. It lists the zips for one platform: Blender takes two zips for the
# same platform for a mistake.
make_index() {
  say "making the index"
  local zips=$BUILD/index
  rm -rf "$zips" && mkdir "$zips"
  cp "$2"/sinew-*-*.zip "$zips"
  isolated "$1" --command extension server-generate --repo-dir="$zips"
  [ ! -f "$zips/index.json" ] || mv "$zips/index.json" "$2"
  rm -rf "$zips"
}
