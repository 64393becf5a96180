# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash
# What scripts/run and scripts/test share; sourced by them, in the repository's root.

# build_in FOLDER CMAKE_ARGUMENTS...: configures and builds. A person sees ninja's progress line, a
# log only what went wrong. Writes to stderr alone: stdout is the program's.
build_in() {
  local folder=$1 said quiet=()
  shift
  if command -v ccache >/dev/null; then set -- "$@" -DCMAKE_CXX_COMPILER_LAUNCHER=ccache; fi
  said=$(cmake -B "$folder" -G Ninja "$@" 2>&1) || {
    echo "$said" >&2
    return 1
  }
  [[ -t 2 ]] || quiet=(--quiet)
  ninja -C "$folder" -k 0 -j "$(nproc)" "${quiet[@]}" >&2
}

# build_page: the viewer's page, web/dist, which becomes part of the program; only if something has
# changed.
build_page() {
  local said lock=web/node_modules/.package-lock.json page=web/dist/index.html
  if [[ ! -e $lock || web/package-lock.json -nt $lock ]]; then
    said=$(cd web && npm ci 2>&1 && touch node_modules/.package-lock.json) || {
      echo "$said" >&2
      return 1
    }
  fi
  if [[ -e $page && -z $(find web/src web/index.html web/*.ts "$lock" -newer "$page") ]]; then
    return 0
  fi
  said=$(cd web && npm run build 2>&1) || {
    echo "$said" >&2
    return 1
  }
}
