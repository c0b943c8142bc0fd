#!/usr/bin/env bash
# From a bare Debian machine to the first picture: installs what is missing, builds, and runs the main job.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

install_packages build run
# A folder that is configured already stays as it is; a new one needs no tests, nor their libraries.
if [ -f build/CMakeCache.txt ]; then configure; else configure -DFLUOROCUT_TESTS=OFF; fi
build fluorocut fluorocut-cli
run_main_job
if [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; then
    say "opening the desktop program (its log: build/desktop.log)"
    setsid build/bin/fluorocut >build/desktop.log 2>&1 </dev/null &
fi
say "done"
