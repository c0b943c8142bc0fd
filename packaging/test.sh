#!/usr/bin/env bash
# Everything run.sh does, then the format of the sources, the Debian package and all tests.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

# Later versions of clang-format lay some lines out differently.
format_good=yes
check_format() {
    if ! clang-format --version 2>/dev/null | grep -q 'version 14\.'; then
        say "format of the sources: not checked (that needs clang-format 14)"
        return
    fi
    find app core ui tests -name '*.h' -o -name '*.cpp' | sort >build/sources.txt
    if xargs -a build/sources.txt clang-format --dry-run -Werror >build/format.log 2>&1 </dev/null; then
        say "format of the sources: good"
    else
        format_good=no
        say "format of the sources: off in $(grep -c ': error:' build/format.log) places"
    fi
}

run_tests() {
    say "testing with $(nproc) cores"
    if ! ctest --test-dir build --parallel "$(nproc)" --output-on-failure --no-tests=error >build/test.log 2>&1 </dev/null; then
        grep -A 8 -E ': Failure$|\*\*\*(Failed|Timeout|Exception)' build/test.log | head -n 80 || true
        give_up build/test.log "tests failed"
    fi
    # ctest's own summary.
    sed -n '/tests passed,/,/Total Test time/p' build/test.log
    local skipped
    skipped=$(grep -c '(Skipped)$' build/test.log) || true
    if [ "$skipped" != 0 ]; then say "$skipped of them were skipped; the end of build/test.log names them"; fi
}

install_packages build run test package
configure -DFLUOROCUT_TESTS=ON
build
run_main_job
check_format
make_package
quietly build/package-check.log check_package
say "the package: good"
run_tests
[ $format_good = yes ] || give_up build/format.log "all tests passed, but the format is off: run clang-format -i"
say "done"
