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
