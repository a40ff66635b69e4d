#!/bin/sh
# Finds what this project needs and this machine lacks, and installs it where it knows how.
#
#   scripts/setup.sh demo    what building and drawing needs
#   scripts/setup.sh test    that, and what the tests need
#
# On Debian and its relatives exactly the missing packages are installed with apt-get: directly as root,
# else through sudo, after saying what and why. On other systems the missing parts are named with the
# command that installs them. Says nothing when nothing is missing. Exit status 0: all is there;
# 1: something is missing and was not installed; 2: wrong usage.
#
# Environment:
#   FEATURES             the cargo flags of the build; with --no-default-features nothing for the window is needed
#   SURFEL_NO_INSTALL=1  never install, only say what is missing
set -eu

what=${1:-}
case $what in
    demo | test) ;;
    *)
        echo "usage: scripts/setup.sh demo|test" >&2
        exit 2
        ;;
esac

cd "$(dirname "$0")/.."
PATH=$PATH:${CARGO_HOME:-${HOME:-/root}/.cargo}/bin:/usr/sbin:/sbin
export PATH

say() { echo "setup: $*" >&2; }
has() { command -v "$1" >/dev/null 2>&1; }

# ---- which system ---------------------------------------------------------------------------------------

# SURFEL_OS_RELEASE names another file in the script's own tests.
os_release=${SURFEL_OS_RELEASE:-/etc/os-release}
family=other
if [ "$(uname -s)" = Darwin ]; then
    family=macos
elif [ -r "$os_release" ]; then
    # Read in a subshell: the file sets many names.
    ids=$(. "$os_release" && echo " ${ID:-} ${ID_LIKE:-} ")
    case $ids in
        *" debian "* | *" ubuntu "*) family=debian ;;
        *" fedora "* | *" rhel "* | *" centos "*) family=fedora ;;
        *" arch "* | *" archlinux "*) family=arch ;;
        *suse*) family=suse ;;
    esac
fi

wants_viewer=yes
case " ${FEATURES:-} " in
    *viewer*) ;;
    *--no-default-features*) wants_viewer=no ;;
esac

# ---- what a part is called here: package names, or nothing where the system brings the part ----------------

packages_of() {
    case $family:$1 in
        debian:compiler) echo g++ ;;
        fedora:compiler) echo gcc-c++ ;;
        arch:compiler) echo gcc ;;
        suse:compiler) echo gcc-c++ ;;

        debian:loader) echo libvulkan1 ;;
        fedora:loader) echo vulkan-loader ;;
        arch:loader) echo vulkan-icd-loader ;;
        suse:loader) echo libvulkan1 ;;
        macos:loader) echo vulkan-loader ;;

        debian:driver) echo mesa-vulkan-drivers ;;
        fedora:driver) echo mesa-vulkan-drivers ;;
        arch:driver) echo vulkan-swrast ;;
        suse:driver) echo libvulkan_lvp ;;
        macos:driver) echo molten-vk ;;

        debian:layer) echo vulkan-validationlayers ;;
        fedora:layer) echo vulkan-validation-layers ;;
        arch:layer) echo vulkan-validation-layers ;;
        suse:layer) echo vulkan-validationlayers ;;
        macos:layer) echo vulkan-validationlayers ;;

        *:cmake) echo cmake ;;
        macos:make) ;;
        *:make) echo make ;;
        debian:pkg-config) echo pkg-config ;;
        fedora:pkg-config) echo pkgconf-pkg-config ;;
        arch:pkg-config) echo pkgconf ;;
        suse:pkg-config) echo pkg-config ;;
        macos:pkg-config) echo pkgconf ;;

        debian:header-x11) echo libx11-dev ;;
        debian:header-xrandr) echo libxrandr-dev ;;
        debian:header-xinerama) echo libxinerama-dev ;;
        debian:header-xcursor) echo libxcursor-dev ;;
        debian:header-xi) echo libxi-dev ;;
        debian:library-x11) echo libx11-6 ;;
        debian:library-xrandr) echo libxrandr2 ;;
        debian:library-xinerama) echo libxinerama1 ;;
        debian:library-xcursor) echo libxcursor1 ;;
        debian:library-xi) echo libxi6 ;;

        fedora:header-x11 | suse:header-x11) echo libX11-devel ;;
        fedora:header-xrandr | suse:header-xrandr) echo libXrandr-devel ;;
        fedora:header-xinerama | suse:header-xinerama) echo libXinerama-devel ;;
        fedora:header-xcursor | suse:header-xcursor) echo libXcursor-devel ;;
        fedora:header-xi | suse:header-xi) echo libXi-devel ;;
        fedora:library-x11) echo libX11 ;;
        fedora:library-xrandr) echo libXrandr ;;
        fedora:library-xinerama) echo libXinerama ;;
        fedora:library-xcursor) echo libXcursor ;;
        fedora:library-xi) echo libXi ;;
        suse:library-x11) echo libX11-6 ;;
        suse:library-xrandr) echo libXrandr2 ;;
        suse:library-xinerama) echo libXinerama1 ;;
        suse:library-xcursor) echo libXcursor1 ;;
        suse:library-xi) echo libXi6 ;;

        arch:*-x11) echo libx11 ;;
        arch:*-xrandr) echo libxrandr ;;
        arch:*-xinerama) echo libxinerama ;;
        arch:*-xcursor) echo libxcursor ;;
        arch:*-xi) echo libxi ;;

        debian:xvfb) echo xvfb ;;
        fedora:xvfb) echo xorg-x11-server-Xvfb ;;
        arch:xvfb) echo xorg-server-xvfb ;;
        suse:xvfb) echo xorg-x11-server-Xvfb ;;
        debian:xauth | suse:xauth) echo xauth ;;
        fedora:xauth | arch:xauth) echo xorg-xauth ;;
    esac
}

describe() {
    case $1 in
        compiler) echo "a C++ compiler (builds the shader compiler)" ;;
        loader) echo "the Vulkan loader (opened when surfel starts)" ;;
        driver) echo "a Vulkan driver (this one draws on the processor)" ;;
        layer) echo "the Vulkan validation layer (the tests run under it)" ;;
        cmake | make | pkg-config) echo "$1 (builds the window library)" ;;
        header-*) echo "X11 headers: ${1#header-} (the window library is built from them)" ;;
        library-*) echo "X11 library: ${1#library-} (opened by the window)" ;;
        xvfb) echo "Xvfb, a display without a screen (the tests open a window in it)" ;;
        xauth) echo "xauth (xvfb-run calls it)" ;;
    esac
}

# ---- is a part here? --------------------------------------------------------------------------------------

# Whether the dynamic linker finds a library: its own list, then the usual folders and LD_LIBRARY_PATH.
has_library() {
    # The list may be older than a removal, so the file it names must exist.
    if has ldconfig; then
        for file in $(ldconfig -p 2>/dev/null | sed -n "s|^[[:space:]]*$1 (.*=> ||p"); do
            if [ -e "$file" ]; then
                return 0
            fi
        done
    fi
    for folder in $(echo "${LD_LIBRARY_PATH:-}" | tr : ' ') /lib /lib64 /usr/lib /usr/lib64 /lib/*-linux-* \
        /usr/lib/*-linux-* /usr/local/lib /usr/local/lib64 /opt/homebrew/lib; do
        if [ -e "$folder/$1" ]; then
            return 0
        fi
    done
    return 1
}

compiler() {
    for name in "${CXX:-c++}" g++ clang++; do
        # CXX may hold flags after the name.
        if has "${name%% *}"; then
            echo "$name"
            return 0
        fi
    done
    return 1
}

# Whether the compiler finds a header (its own folders count, not a guess of ours).
has_header() {
    cxx=$(compiler) || return 1
    # The name may come with flags, so it is split.
    # shellcheck disable=SC2086
    printf '#include <X11/Xlib.h>\n#include <%s>\n' "$1" | $cxx -x c++ -E - >/dev/null 2>&1
}

# The folders in which the loader looks, with /$1 at their ends, one in a line.
vulkan_folders() {
    home=${HOME:-/root}
    {
        echo "${XDG_CONFIG_HOME:-$home/.config}"
        echo "${XDG_CONFIG_DIRS:-/etc/xdg}" | tr : '\n'
        printf '%s\n' /etc /usr/local/etc /opt/homebrew/etc
        echo "${XDG_DATA_HOME:-$home/.local/share}"
        echo "${XDG_DATA_DIRS:-/usr/local/share:/usr/share}" | tr : '\n'
        printf '%s\n' /usr/local/share /usr/share /opt/homebrew/share
    } | sed "s|\$|/vulkan/$1|"
}

# Whether the library that a driver's or layer's JSON file names exists. A file without its library is
# common in containers, and draws nothing.
names_a_library() {
    [ -r "$1" ] || return 1
    library=$(sed -n 's/.*"library_path"[[:space:]]*:[[:space:]]*"\([^"]*\)".*/\1/p' "$1" | head -n 1)
    case $library in
        "") return 1 ;;
        /*) [ -e "$library" ] ;;
        */*) [ -e "$(dirname "$1")/$library" ] ;;
        *) has_library "$library" || [ -e "$(dirname "$1")/$library" ] ;;
    esac
}

# Whether one of the lines of standard input is, or is the folder of, such a JSON file matching $1.
any_names_a_library() {
    while IFS= read -r place; do
        if [ -f "$place" ]; then
            if names_a_library "$place"; then
                return 0
            fi
        elif [ -d "$place" ]; then
            # $1 is a pattern.
            # shellcheck disable=SC2231
            for file in "$place"/$1; do
                if names_a_library "$file"; then
                    return 0
                fi
            done
        fi
    done
    return 1
}

has_driver() {
    # The loader takes these instead of its folders.
    instead=${VK_DRIVER_FILES:-${VK_ICD_FILENAMES:-}}
    if [ -n "$instead" ]; then
        echo "$instead" | tr : '\n' | any_names_a_library '*.json'
        return
    fi
    {
        echo "${VK_ADD_DRIVER_FILES:-}" | tr : '\n'
        vulkan_folders icd.d
    } | any_names_a_library '*.json'
}

has_layer() {
    {
        echo "${VK_LAYER_PATH:-}:${VK_ADD_LAYER_PATH:-}" | tr : '\n'
        vulkan_folders explicit_layer.d
    } | any_names_a_library 'VkLayer_khronos_validation.json'
}

is_here() {
    case $1 in
        compiler) compiler >/dev/null ;;
        loader) has_library libvulkan.so.1 || has_library libvulkan.1.dylib ;;
        driver) has_driver ;;
        layer) has_layer ;;
        cmake | make) has "$1" ;;
        pkg-config) has pkg-config || has pkgconf ;;
        header-x11) has_header X11/XKBlib.h ;;
        header-xrandr) has_header X11/extensions/Xrandr.h ;;
        header-xinerama) has_header X11/extensions/Xinerama.h ;;
        header-xcursor) has_header X11/Xcursor/Xcursor.h ;;
        header-xi) has_header X11/extensions/XInput2.h ;;
        library-x11) has_library libX11.so.6 ;;
        library-xrandr) has_library libXrandr.so.2 ;;
        library-xinerama) has_library libXinerama.so.1 ;;
        library-xcursor) has_library libXcursor.so.1 ;;
        library-xi) has_library libXi.so.6 ;;
        xvfb) has Xvfb ;;
        xauth) has xauth ;;
    esac
}

# ---- what is needed, and what of it is missing ------------------------------------------------------------

needed="compiler loader driver"
viewer_parts=""
if [ "$wants_viewer" = yes ]; then
    viewer_parts="cmake make pkg-config"
    # On macOS the window needs no X11.
    if [ "$family" != macos ]; then
        for part in x11 xrandr xinerama xcursor xi; do
            viewer_parts="$viewer_parts header-$part library-$part"
        done
        if [ "$what" = test ]; then
            viewer_parts="$viewer_parts xvfb xauth"
        fi
    fi
fi
if [ "$what" = test ]; then
    needed="$needed layer"
fi

# Sets `missing` (part names), `packages` and `viewer_missing`.
find_missing() {
    missing=""
    packages=""
    viewer_missing=no
    for part in $needed $viewer_parts; do
        if is_here "$part"; then
            continue
        fi
        missing="$missing $part"
        case " $viewer_parts " in
            *" $part "*) viewer_missing=yes ;;
        esac
        for package in $(packages_of "$part"); do
            case " $packages " in
                *" $package "*) ;;
                *) packages="$packages $package" ;;
            esac
        done
    done
}

say_missing() {
    say "missing:"
    for part in $missing; do
        say "  - $(describe "$part")"
    done
}

say_headless() {
    if [ "$viewer_missing" = yes ]; then
        say "Without the window it needs less: make $what FEATURES=--no-default-features"
    fi
}

# The command that installs $packages here, for a person to type; $1 goes before what needs root.
command_for() {
    case $family in
        debian) echo "$1""apt-get update && $1""apt-get install -y --no-install-recommends$packages" ;;
        fedora) echo "$1""dnf install$packages" ;;
        arch) echo "$1""pacman -S --needed$packages" ;;
        suse) echo "$1""zypper install$packages" ;;
        macos) echo "brew install$packages" ;;
    esac
}

# Names the missing parts and the command, and gives up.
give_up() {
    if [ -n "$packages" ] && [ "$family" != other ]; then
        if [ "$(id -u)" = 0 ]; then
            say "install them with: $(command_for '')"
        elif has sudo; then
            say "install them with: $(command_for 'sudo ')"
        else
            say "install them as root with: $(command_for '')"
        fi
    fi
    case $family:" $missing " in
        macos:*" compiler "*) say "the compiler comes with: xcode-select --install" ;;
        other:*) say "this system is not known here: install them with its package manager" ;;
    esac
    say_headless
    exit 1
}

# Not failing: lists that cannot all be refreshed may still be good enough for what is missing.
apt() {
    "$@" apt-get -q -o Acquire::Retries=3 -o DPkg::Lock::Timeout=300 update >&2 ||
        say "the package lists could not all be refreshed; going on with those there are"
    # Names of packages, split.
    # shellcheck disable=SC2086
    "$@" env DEBIAN_FRONTEND=noninteractive apt-get -q -y -o Acquire::Retries=3 -o DPkg::Lock::Timeout=300 \
        -o Dpkg::Use-Pty=0 install --no-install-recommends $packages >&2 </dev/null
}

install() {
    if [ "${SURFEL_NO_INSTALL:-}" = 1 ] || [ "$family" != debian ] || ! has apt-get; then
        give_up
    fi
    if [ "$(id -u)" = 0 ]; then
        say "installing with apt-get:$packages"
        apt || {
            say "apt-get failed (above)"
            give_up
        }
        return
    fi
    if ! has sudo; then
        say "only root can install packages, and there is no sudo"
        give_up
    fi
    # Without a terminal sudo could not ask.
    if ! sudo -n true 2>/dev/null && ! [ -t 0 ]; then
        say "only root can install packages, and sudo wants a password, which nobody can type here"
        give_up
    fi
    say "installing packages needs root; sudo may ask for your password. It will run:"
    say "  $(command_for 'sudo ')"
    apt sudo || {
        say "that failed (above)"
        give_up
    }
}

# ---- Rust: never from the system's packages, which are too old --------------------------------------------

check_rust() {
    wanted=$(sed -n 's/^rust-version *= *"\(.*\)"/\1/p' Cargo.toml)
    if ! has cargo || ! version=$(cargo --version 2>/dev/null); then
        say "missing: Rust $wanted or newer"
        say "install it with: curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh"
        exit 1
    fi
    # "cargo 1.95.0 (...)" against "1.90": major and minor.
    version=$(echo "$version" | sed 's/^cargo \([0-9]*\.[0-9]*\).*/\1/')
    if [ "${version%%.*}" -lt "${wanted%%.*}" ] ||
        { [ "${version%%.*}" -eq "${wanted%%.*}" ] && [ "${version#*.}" -lt "${wanted#*.}" ]; }; then
        say "Rust is $version; $wanted or newer is needed. With rustup: rustup update stable"
        exit 1
    fi
    if [ "$what" = demo ]; then
        return
    fi
    components=""
    for pair in "fmt rustfmt" "clippy clippy"; do
        if ! cargo "${pair% *}" --version >/dev/null 2>&1; then
            components="$components ${pair#* }"
        fi
    done
    if [ -z "$components" ]; then
        return
    fi
    if [ "${SURFEL_NO_INSTALL:-}" = 1 ] || ! has rustup; then
        say "missing parts of Rust:$components"
        say "with rustup they are installed with: rustup component add$components"
        exit 1
    fi
    say "adding to the Rust toolchain:$components"
    # Names, split.
    # shellcheck disable=SC2086
    rustup component add $components >&2
}

check_rust
find_missing
if [ -n "$missing" ]; then
    say_missing
    install
    find_missing
    if [ -n "$missing" ]; then
        say "after installing there is still something"
        say_missing
        give_up
    fi
    say "everything is there now"
fi
