# Sourced by run.sh and test.sh: from a bare Debian machine to a build, with a few calm lines on the way.
# Full logs go to build/*.log; what fails shows the end of its log and the log's name.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
mkdir -p build

# Wall time since the start, then the sentence.
say() { printf '%3d:%02d  %s\n' $((SECONDS / 60)) $((SECONDS % 60)) "$*"; }

# give_up LOG SENTENCE...
give_up() {
    local log=$1
    shift
    printf '\n%s\n' "--- the end of $log ---"
    tail -n 60 "$log" 2>/dev/null || true
    printf '%s\n\n' "--- all of it: $PWD/$log ---"
    say "$*"
    exit 1
}

# quietly LOG COMMAND...: nothing on the screen unless it fails.
quietly() {
    local log=$1
    shift
    "$@" >"$log" 2>&1 </dev/null || give_up "$log" "failed: $*"
}

# The packages of the given sections of packages.txt.
packages_of() {
    awk -v wanted=" $* " '
        { sub(/#.*/, "") }
        /^\[/ { gsub(/[][ \t]/, ""); active = index(wanted, " " $0 " "); next }
        active && NF { print $1 }' packaging/packages.txt
}

as_root() {
    if [ "$(id -u)" = 0 ]; then
        env DEBIAN_FRONTEND=noninteractive "$@"
    else
        sudo env DEBIAN_FRONTEND=noninteractive "$@"
    fi
}

apt_update_and_install() {
    as_root apt-get -q -o DPkg::Lock::Timeout=300 -o Acquire::Retries=3 update || return
    as_root apt-get -q -y -o DPkg::Lock::Timeout=300 -o Acquire::Retries=3 install --no-install-recommends "$@"
}

# install_packages SECTION...: what is missing of these sections; takes no time when nothing is.
install_packages() {
    local wanted installed missing
    wanted=$(packages_of "$@" | sort -u)
    installed=$(dpkg-query -W -f='${db:Status-Status} ${Package}\n' $wanted 2>/dev/null | sed -n 's/^installed //p' | sort -u) || true
    missing=$(comm -23 <(echo "$wanted") <(echo "$installed"))
    if [ -z "$missing" ]; then
        say "Debian packages: all there"
        return
    fi
    if ! command -v apt-get >/dev/null; then
        say "These packages are missing and there is no apt-get to install them:" $missing
        exit 1
    fi
    if [ "$(id -u)" != 0 ]; then
        if ! command -v sudo >/dev/null; then
            say "These packages are missing; install them as root, or install sudo:" $missing
            exit 1
        fi
        # Where a password is needed, ask for it here, not inside a log.
        if ! sudo -n true 2>/dev/null && ! sudo -v; then
            say "sudo was refused. Install as root:" $missing
            exit 1
        fi
    fi
    say "Debian packages: installing $(echo "$missing" | wc -l) and what they need"
    quietly build/install.log apt_update_and_install $missing
}

# configure [CMAKE OPTION]...: release, in build/.
configure() {
    # A cache for compiled files even where the home folder cannot be written.
    if [ -z "${CCACHE_DIR:-}" ] && ! mkdir -p "${HOME:-/nonexistent}/.cache/ccache" 2>/dev/null; then
        export CCACHE_DIR=$PWD/build/ccache
    fi
    say "configuring"
    quietly build/configure.log cmake --preset release "$@"
}

# build [TARGET]...: these, or everything.
build() {
    say "building with $(nproc) cores"
    quietly build/build.log cmake --build build --parallel "$(nproc)" ${1:+--target "$@"}
}

make_pictures() {
    local cli=build/bin/fluorocut-cli view
    # errexit does not reach into a function whose outcome is asked for.
    $cli phantom femur -o output/femur.mha || return
    for view in ap lateral; do
        # The origin of the femur's frame: in the shaft, at the lesser trochanter.
        $cli drr --ct output/femur.mha --view "$view" --aim-mm 0 0 0 -o "output/femur-$view.png" || return
    done
}

# The main job. With a screen: pictures to look at, in output/ (the desktop program is opened next). Without one: a whole
# procedure in the virtual operating room, told line by line, with its case and its report in output/.
run_main_job() {
    mkdir -p output
    if [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; then
        say "simulated fluoroscopy of the built-in femur, AP and lateral"
        quietly build/run.log make_pictures
        say "saved: output/femur-ap.png, output/femur-lateral.png (and the CT, output/femur.mha)"
        return
    fi
    say "a simulated procedure: calibrate, register, cut, locate, correct, cut again"
    rm -f output/demo.fluorocut*
    build/bin/fluorocut-cli demo --case output/demo.fluorocut --report output/demo.html 2>&1 | tee build/run.log ||
        give_up build/run.log "the procedure did not come to its end"
    say "saved: output/demo.html (the report), output/demo.fluorocut (the case)"
}

# The Debian package of what has been built, in output/; $package names it.
make_package() {
    say "making the Debian package"
    rm -f build/fluorocut_*.deb
    quietly build/package.log cmake -E chdir build cpack
    mkdir -p output
    package=output/$(basename build/fluorocut_*.deb)
    mv build/fluorocut_*.deb "$package"
    say "saved: $package ($(du -m "$package" | cut -f1) MB)"
}

# Its content and its programs, unpacked somewhere else; with lintian and appstreamcli where they are installed.
check_package() {
    local root=build/package share=build/package/usr/share file
    rm -rf $root
    dpkg-deb -x "$package" $root || return
    for file in bin/fluorocut bin/fluorocut-cli share/fluorocut/{fiducials,implants,phantoms,plates,scenarios,help,icons} \
        share/applications/org.fluorocut.FluoroCut.desktop share/metainfo/org.fluorocut.FluoroCut.metainfo.xml \
        share/icons/hicolor/{scalable/apps/fluorocut.svg,48x48/apps/fluorocut.png,128x128/apps/fluorocut.png} \
        share/man/man1/fluorocut{,-cli}.1.gz share/bash-completion/completions/fluorocut{,-cli} \
        share/mime/packages/fluorocut-case.xml share/doc/fluorocut/{copyright,changelog.gz}; do
        [ -e "$root/usr/$file" ] || { echo "not in the package: $file" && return 1; }
    done
    # Every library that the programs are linked with comes from a package that this one depends on.
    dpkg-deb -f "$package" Depends | tee build/package-depends.txt
    for file in libc6 libqt5widgets5 libvtk9 libdcmtk fonts-dejavu-core; do
        grep -q "\b$file" build/package-depends.txt || { echo "no dependency on $file" && return 1; }
    done
    # The programs find the data that was installed with them, not the sources'.
    echo '{}' >$share/fluorocut/plates/only-here.json
    $root/usr/bin/fluorocut-cli --version || return
    $root/usr/bin/fluorocut-cli fabricate plate --plate no-such-plate -o build/none 2>&1 | tee build/package-plates.txt
    grep -q only-here build/package-plates.txt || { echo "fluorocut-cli does not use the installed data" && return 1; }
    $root/usr/bin/fluorocut --version || return
    if command -v lintian >/dev/null; then
        lintian --allow-root --fail-on error,warning "$package" || return
    fi
    if command -v appstreamcli >/dev/null; then
        appstreamcli validate --no-net $share/metainfo/*.xml || return
    fi
    if command -v desktop-file-validate >/dev/null; then
        desktop-file-validate $share/applications/*.desktop || return
    fi
}
