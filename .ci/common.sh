# shellcheck shell=bash
# What the scripts of this folder share. The scripts source it.

CACHE=${XDG_CACHE_HOME:-$HOME/.cache}/sinew
DOWNLOADS=$CACHE/downloads # files that are large and needed anew in each bare root (.ci/run), each beside its hash
KEYS=/usr/share/keyrings/debian-archive-keyring.gpg

# Prints the comment at the top of the script.
usage() {
  sed -n '2,/^set/s/^# \{0,1\}//p' "$0" >&2
}

as_root() {
  if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi
}

# Packages that this machine's Debian has. Of several jobs that want some at a time one waits for the other.
install_packages() {
  ! dpkg -s "$@" >/dev/null 2>&1 || return 0
  echo "installing $*" >&2
  mkdir -p "$CACHE"
  (
    flock 9
    as_root apt-get update -qq &&
      as_root env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y -qq --no-install-recommends --no-upgrade -o DPkg::Lock::Timeout=600 "$@" >/dev/null
  ) 9>"$CACHE/apt.lock"
}

# deb|deb-src: Debian's archives as this machine's apt knows them, for a sources.list.
archives() {
  apt-get indextargets --format "$1 [signed-by=$KEYS] \$(REPO_URI) \$(RELEASE) \$(COMPONENT)" \
    "Created-By: Packages" "Origin: Debian" "Component: main" | sort -u
}

# FOLDER deb|deb-src: sets APT to an apt-get that has all its files in FOLDER, so that it changes nothing of what this
# machine's knows.
separate_apt() {
  mkdir -p "$1"/{lists,cache/archives}/partial
  archives "$2" >"$1/list"
  [ -s "$1/list" ] || { echo "apt knows no Debian archive"; return 1; }
  # shellcheck disable=SC2034 # who sources this uses it
  APT=(apt-get -o "Dir::Etc::SourceList=$1/list" -o Dir::Etc::SourceParts=- -o "Dir::State::Lists=$1/lists"
    -o "Dir::Cache=$1/cache" -o APT::Sandbox::User=)
}

# FILE: moves it to DOWNLOADS, with its hash.
keep() (
  mkdir -p "$DOWNLOADS" && cd "$(dirname "$1")" && sha256sum "${1##*/}" >"$1.sha256" && mv "$1" "$1.sha256" "$DOWNLOADS"
)

# NAME: prints the path of that file in DOWNLOADS, if it is what was put there.
kept() (
  [ -f "$DOWNLOADS/$1.sha256" ] && cd "$DOWNLOADS" && sha256sum --check --quiet "$1.sha256" >&2 && echo "$PWD/$1"
)

# FOLDER MADE_BY WHAT: prints the folder. If it was not made by MADE_BY, has `make_it NEW` fill a new one, in a folder
# WORK that is then removed.
set_up_once() {
  mkdir -p "$CACHE"
  exec 9>"$1.lock"
  flock 9
  if [ "$(cat "$1/.ready" 2>/dev/null)" != "$2" ]; then
    echo "setting up $3 (log: $1.log)" >&2
    WORK=$(mktemp -d "$CACHE/new-XXXXXX")
    trap 'rm -rf "$WORK"' EXIT
    { mkdir "$WORK/new" && make_it "$WORK/new" && echo "$2" >"$WORK/new/.ready" && rm -rf "$1" &&
      mv -T "$WORK/new" "$1"; } >"$1.log" 2>&1 </dev/null || {
      tail -5 "$1.log" >&2
      echo ".ci/${0##*/}: $3 could not be set up" >&2
      exit 1
    }
  fi
  echo "$1"
}
