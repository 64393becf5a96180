# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash
# What scripts/run, scripts/test and scripts/screenshot share; sourced by them, in the repository's
# root.

say() { echo "${0##*/}: $*" >&2; }

# in_cache FOLDER ARGUMENTS...: whether FOLDER is configured with all these -DNAME=VALUE.
in_cache() {
  local cache argument name value
  [[ -e $1/build.ninja ]] || return 1
  cache=$'\n'$(<"$1/CMakeCache.txt")$'\n'
  shift
  for argument in "$@"; do
    [[ $argument == -D* ]] || continue
    name=${argument#-D} value=${argument#*=}
    name=${name%%=*}
    [[ $cache =~ $'\n'"$name":[^=]+="$value"$'\n' ]] || return 1
  done
}

# progress: of ninja's output, what went wrong; and every five seconds how far it has come. Serves
# where no terminal shows ninja's own line. It reads until ninja ends, even if nobody reads what it
# says any more: a reader that ends before would end the build with SIGPIPE, without a word.
progress() {
  local line next=0
  trap '' PIPE
  while IFS= read -r line || [[ $line ]]; do
    if [[ $line =~ ^@([0-9]+)/([0-9]+)\  ]]; then
      if ((BASH_REMATCH[1] > 0 && SECONDS >= next)); then
        say "building ${BASH_REMATCH[1]} of ${BASH_REMATCH[2]}"
        next=$((SECONDS + 5))
      fi
    elif [[ $line != ninja:\ Entering* && $line != "ninja: no work"* && $line != "-- "* ]]; then
      echo "$line" >&2
    fi
  done
}

# has_room FOLDER...: whether some megabytes can be written in each. Says what to do where not.
has_room() {
  local folder file
  for folder in "$@"; do
    if ! { file=$(mktemp -p "$folder") && head -c 4M /dev/zero >"$file"; } 2>/dev/null; then
      rm -f "$file"
      say "nothing can be written in $folder: it is full, or another user's; make room, use a" \
        "clone of your own, or set TMPDIR to another folder for temporary files"
      return 1
    fi
    rm -f "$file"
  done
}

# build_in FOLDER -DNAME=VALUE... [-- TARGETS...]: configures and builds. With every argument in
# CMake's cache it leaves it to ninja to see whether anything has changed: sources, their headers,
# CMake's files, and the folders' contents. Writes to stderr alone: stdout is the program's.
# A folder that was configured from another source folder (-S) or for other compilers is begun anew:
# CMake would forget all other settings.
build_in() {
  local folder=$1 said sources=$PWD arguments=() targets=()
  shift
  has_room "$PWD" "${TMPDIR:-/tmp}" || return 1
  while (($#)) && [[ $1 != -- ]]; do
    if [[ $1 == -S ]]; then sources=$PWD/$2; fi
    arguments+=("$1")
    shift
  done
  if [[ -e $folder/CMakeCache.txt ]] &&
    ! [[ $(sed -n 's/^CMAKE_HOME_DIRECTORY:INTERNAL=//p' \
      "$folder/CMakeCache.txt") -ef $sources ]]; then
    rm -rf "$folder"
  fi
  local argument name cache=
  if [[ -e $folder/CMakeCache.txt ]]; then cache=$'\n'$(<"$folder/CMakeCache.txt")$'\n'; fi
  for argument in "${arguments[@]}"; do
    name=${argument#-D} name=${name%%=*}
    if [[ $cache && $name =~ ^CMAKE_(C|CXX)_COMPILER$ ]] &&
      ! [[ $cache =~ $'\n'"$name":[^=]+=([^$'\n']*/)?"${argument##*[=/]}"$'\n' ]]; then
      rm -rf "$folder"
    fi
  done
  if (($#)); then targets=("${@:2}"); fi
  if command -v ccache >/dev/null; then
    arguments+=(-DCMAKE_C_COMPILER_LAUNCHER=ccache -DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
  fi
  if ! in_cache "$folder" "${arguments[@]}"; then
    if [[ ! -e $folder/build.ninja ]]; then
      say "configuring $folder"
      # What an attempt that failed found out about the compiler is wrong.
      rm -rf "$folder/CMakeCache.txt" "$folder/CMakeFiles"
    fi
    said=$(cmake -B "$folder" -G Ninja "${arguments[@]}" 2>&1) || {
      echo "$said" >&2
      return 1
    }
  fi
  local ninja=(ninja -C "$folder" -k 0 -j "$(nproc)" "${targets[@]}")
  if [[ -t 2 ]]; then
    "${ninja[@]}" >&2
  else
    NINJA_STATUS='@%f/%t ' "${ninja[@]}" 2>&1 | { progress || true; }
  fi
}

# npm_quietly ARGUMENTS...: npm in web/, of which only a failure is shown.
npm_quietly() {
  local said
  said=$(cd web && npm "$@" 2>&1) || {
    echo "$said" >&2
    return 1
  }
}

# get_npm_packages: those of the page.
lock=web/node_modules/.package-lock.json
get_npm_packages() {
  if [[ ! -e $lock || web/package-lock.json -nt $lock ]]; then
    say "getting the page's packages with npm"
    npm_quietly ci --no-audit --no-fund || return 1
    touch "$lock"
  fi
}

# build_page: the viewer's page, web/dist, which becomes part of the program; only if something has
# changed.
build_page() {
  local page=web/dist/index.html
  get_npm_packages || return 1
  if [[ -e $page ]]; then
    [[ $(find web/src web/index.html web/*.ts "$lock" -newer "$page" -print -quit) ]] || return 0
  fi
  say "building the page"
  npm_quietly run build
}
