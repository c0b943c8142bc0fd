#!/usr/bin/env bash
# The Debian package, in output/: installs what is missing to build it, builds, packs, checks.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

install_packages build run package
if [ -f build/CMakeCache.txt ]; then configure; else configure -DFLUOROCUT_TESTS=OFF; fi
build package-files
make_package
quietly build/package-check.log check_package
say "install it with: apt install ./$package"
