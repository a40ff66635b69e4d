#!/bin/sh
# Tests of setup.sh that install nothing: what it says and how it ends when something is missing.
set -eu
cd "$(dirname "$0")/.."

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
SURFEL_NO_INSTALL=1
export SURFEL_NO_INSTALL
unset FEATURES VK_ICD_FILENAMES VK_DRIVER_FILES
failures=0

# check NAME STATUS PATTERN COMMAND...: the command ends with that status, and says a line with the pattern
# (or nothing at all, for an empty pattern).
check() {
    name=$1 status=$2 pattern=$3
    shift 3
    found=0
    "$@" >"$folder/out" 2>&1 </dev/null || found=$?
    if [ "$found" != "$status" ]; then
        echo "setup-test: $name: status $found, not $status" >&2
    elif [ -z "$pattern" ] && [ -s "$folder/out" ]; then
        echo "setup-test: $name: is not silent" >&2
    elif [ -n "$pattern" ] && ! grep -q -e "$pattern" "$folder/out"; then
        echo "setup-test: $name: does not say '$pattern'" >&2
    else
        return 0
    fi
    sed 's/^/    /' "$folder/out" >&2
    failures=$((failures + 1))
}

for script in scripts/*.sh .ci/run; do
    check "syntax of $script" 0 "" sh -n "$script"
done
check "no word" 2 "usage:" scripts/setup.sh
check "a wrong word" 2 "usage:" scripts/setup.sh everything
check "no second driver" 2 "usage:" scripts/second-driver.sh

# `make test` has just installed everything, so the script must be silent, and must name exactly what is
# then taken away.
if scripts/setup.sh test >/dev/null 2>&1; then
    check "all is there" 0 "" scripts/setup.sh test
    check "no driver" 1 "a Vulkan driver" env VK_DRIVER_FILES="$folder/none.json" scripts/setup.sh demo

    # A driver's file without the driver's library is no driver; with it, it is one.
    echo '{"ICD": {"library_path": "./libdriver.so", "api_version": "1.3.0"}}' >"$folder/icd.json"
    check "a file alone" 1 "a Vulkan driver" env VK_DRIVER_FILES="$folder/icd.json" scripts/setup.sh demo
    : >"$folder/libdriver.so"
    check "file and library" 0 "" env VK_DRIVER_FILES="$folder/icd.json" scripts/setup.sh demo
    check "in a list" 0 "" env VK_ICD_FILENAMES="$folder/none.json:$folder/icd.json" scripts/setup.sh demo

    while read -r id command; do
        echo "ID=$id" >"$folder/os-release"
        check "on $id" 1 "$command" env VK_DRIVER_FILES="$folder/none.json" \
            SURFEL_OS_RELEASE="$folder/os-release" scripts/setup.sh demo
    done <<'SYSTEMS'
debian apt-get install -y --no-install-recommends mesa-vulkan-drivers$
ubuntu apt-get install -y --no-install-recommends mesa-vulkan-drivers$
fedora dnf install mesa-vulkan-drivers$
arch pacman -S --needed vulkan-swrast$
"opensuse-tumbleweed" zypper install libvulkan_lvp$
plan9 package manager
SYSTEMS
else
    echo "setup-test: the parts for the window and the tests are not all installed; their checks are skipped" >&2
fi

# The window's parts are asked for only where the window is built. An empty folder as the only program
# folder hides them all, and Rust with them, so Rust is a stand-in.
mkdir "$folder/bin"
for program in sh env dirname uname sed tr grep id head cat echo printf; do
    found=$(command -v "$program") && case $found in /*) ln -s "$found" "$folder/bin/$program" ;; esac
done
printf '#!/bin/sh\necho "cargo 1.999.0"\n' >"$folder/bin/cargo"
printf '#!/bin/sh\nexit 0\n' >"$folder/bin/c++"
chmod +x "$folder/bin/cargo" "$folder/bin/c++"
if ! PATH=/usr/sbin:/sbin command -v cmake >/dev/null; then
    check "no cmake" 1 "cmake (builds" env PATH="$folder/bin" scripts/setup.sh demo
    check "the way without" 1 "make demo FEATURES=--no-default-features" env PATH="$folder/bin" scripts/setup.sh demo
    if [ -e /usr/share/vulkan/icd.d/lvp_icd.x86_64.json ]; then
        check "without window" 0 "" env PATH="$folder/bin" FEATURES=--no-default-features scripts/setup.sh demo
    fi
fi
printf '#!/bin/sh\necho "cargo 1.63.0"\n' >"$folder/bin/cargo"
check "old Rust" 1 "rustup update" env PATH="$folder/bin" scripts/setup.sh demo
printf '#!/bin/sh\nexit 1\n' >"$folder/bin/cargo"
check "no Rust" 1 "rustup.rs" env PATH="$folder/bin" scripts/setup.sh demo

if [ "$failures" != 0 ]; then
    echo "setup-test: $failures failed" >&2
    exit 1
fi
