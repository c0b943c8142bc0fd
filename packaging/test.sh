#!/usr/bin/env bash
# Everything run.sh does, then the format of the sources and all tests.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

# Later versions of clang-format lay some lines out differently.
check_format() {
    if ! clang-format --version 2>/dev/null | grep -q 'version 14\.'; then
        say "format: not checked (that needs clang-format 14)"
        return
    fi
    say "checking the format of the sources"
    find app core ui tests -name '*.h' -o -name '*.cpp' | sort >build/sources.txt
    quietly build/format.log xargs -a build/sources.txt clang-format --dry-run -Werror
}

run_tests() {
    say "testing with $(nproc) cores"
    if ! ctest --test-dir build --parallel "$(nproc)" --output-on-failure --no-tests=error >build/test.log 2>&1 </dev/null; then
        grep -A 8 -E ': Failure$|\*\*\*(Failed|Timeout|Exception)' build/test.log | head -n 80 || true
        give_up build/test.log "tests failed"
    fi
    # ctest's own summary.
    sed -n '/tests passed,/,$p' build/test.log
}

install_packages build run test
configure -DFLUOROCUT_TESTS=ON
build
run_main_job
check_format
run_tests
say "done"
