#!/bin/sh
# Makes the packages twice, installs the .deb on a bare Debian and uses what it brings.
#
#   scripts/package-test.sh         SURFEL_BIN and FEATURES as for scripts/package.sh
#
# As root with debootstrap the bare Debian is made below target/package-test, and the .deb is installed there by apt-get,
# which also proves that its dependencies are there. Else, and then it says so, the .deb is unpacked into an empty folder
# and the program runs from there with a clean environment: that shows the files, not the dependencies.
#
# Environment:
#   SURFEL_DEBIAN      releases, one after the other [default: bookworm trixie]
#   SURFEL_MIRROR      where Debian is [default: http://deb.debian.org/debian]
#   SURFEL_NO_CHROOT=1 the second way in any case
set -eu

cd "$(dirname "$0")/.."
base=$PWD/target/package-test
PATH=$PATH:/usr/sbin:/sbin
say() { echo "package-test: $*"; }
fail() {
    echo "package-test: $*" >&2
    exit 1
}
has() { command -v "$1" >/dev/null 2>&1; }

rm -rf "$base"
mkdir -p "$base"

# ---- twice the same ------------------------------------------------------------------------------------

scripts/package.sh "$base/first"
if [ -z "${SURFEL_BIN:-}" ]; then
    SURFEL_BIN=${CARGO_TARGET_DIR:-target}/release/surfel
    export SURFEL_BIN
fi
scripts/package.sh "$base/second" >/dev/null
for file in "$base/first"/*; do
    cmp "$file" "$base/second/$(basename "$file")" || fail "the second $file is another"
done
say "made twice, the same to the byte"
deb=$(ls "$base/first"/*.deb)
mkdir "$base/archive" "$base/unpacked"
tar -xJf "$base/first"/*.tar.xz -C "$base/archive" --strip-components=1
dpkg-deb -x "$deb" "$base/unpacked"
diff -r "$base/archive" "$base/unpacked/usr" || fail "archive and .deb differ"
say "archive and .deb have the same $(find "$base/archive" -type f | wc -l) files"

# ---- installed -----------------------------------------------------------------------------------------

# Installs the package on a bare Debian of this release, or unpacks it where none is named, and uses it.
use_package() {
    if [ -n "$1" ]; then
        release=$1
        root=$base/root-$release
        debootstrap --variant=minbase "$release" "$root" \
            "${SURFEL_MIRROR:-http://deb.debian.org/debian}" >"$base/debootstrap-$release.log" ||
            fail "no Debian: see $base/debootstrap-$release.log"
        cp "$deb" "$root/"
        inside() { chroot "$root" /usr/bin/env -i PATH=/usr/bin:/bin:/usr/sbin:/sbin HOME=/root LC_ALL=C.UTF-8 "$@"; }
        get() {
            inside apt-get -o Debug::NoLocking=1 install -y --no-install-recommends "$@" >>"$base/apt-$release.log" 2>&1 ||
                fail "apt-get does not install $*: see $base/apt-$release.log"
        }
        get "/$(basename "$deb")"
        say "installed on a bare Debian $release, with $(inside dpkg-query -W | wc -l) packages in all"
        at=
    else
        say "NOT on a bare Debian (that needs root and debootstrap): unpacked, and run with a clean environment"
        root=$base/unpacked
        mkdir -p "$root/tmp"
        at=$root
        inside() { (cd "$root/tmp" && env -i PATH="$root/usr/bin:/usr/bin:/bin" HOME="$root/tmp" LC_ALL=C.UTF-8 "$@"); }
        get() { :; }
    fi

    is_png() { # is_png FILE SIDE
        wanted=$(printf '89504e470d0a1a0a0000000d49484452%08x%08x' "$2" "$2")
        got=$(od -An -tx1 -N24 "$root/tmp/$1" | tr -d ' \n')
        [ "$got" = "$wanted" ] || fail "$1 is no picture of $2 x $2"
    }

    say "$(inside surfel --version)"
    inside surfel render generate:statue:20000 --backend cpu --size 200x200 -q -o "$at/tmp/statue.png" ||
        fail "no picture of the built-in model"
    is_png statue.png 200
    inside surfel generate torus --triangles 20000 -q -o "$at/tmp/a torus.ply" || fail "no model"
    line=$(sed -n 's/^Exec=//p' "$root/usr/share/thumbnailers/surfel.thumbnailer")
    line=$(echo "$line" | sed 's/%sx%s/128x128/; s|%o|"$1"|; s|%i|"$2"|')
    spoken=$(inside sh -c "$line" thumbnailer "$at/tmp/thumb nail.png" "$at/tmp/a torus.ply" 2>&1) ||
        fail "the thumbnailer fails: $spoken"
    [ -z "$spoken" ] || fail "the thumbnailer says: $spoken"
    is_png "thumb nail.png" 128
    say "drew the built-in model on the processor, and a thumbnail"

    # What checks it is not there on a bare system.
    get man-db desktop-file-utils libxml2-utils shared-mime-info bash-completion file
    pages=0
    for page in "$root"/usr/share/man/man1/surfel*.1.gz; do
        name=$(basename "$page")
        if has man || [ -z "$at" ]; then
            inside man --warnings -l "$at/usr/share/man/man1/$name" >"$base/page" 2>"$base/page-says" || fail "man -l $name"
            [ ! -s "$base/page-says" ] || fail "man says of $name: $(cat "$base/page-says")"
            grep -q '^NAME' "$base/page" || fail "$name has no name"
            pages=$((pages + 1))
        fi
    done
    say "$pages manual pages read without a warning"
    for check in "desktop-file-validate $at/usr/share/applications/surfel.desktop" \
        "xmllint --noout $at/usr/share/mime/packages/surfel.xml $at/usr/share/icons/hicolor/scalable/apps/surfel.svg" \
        "bash -n $at/usr/share/bash-completion/completions/surfel"; do
        if [ -z "$at" ] || has "${check%% *}"; then
            # shellcheck disable=SC2086 # words of a command
            inside $check || fail "$check"
            say "$check: nothing to say"
        else
            say "not checked, no ${check%% *} here: $check"
        fi
    done
    if [ -z "$at" ]; then
        cp -r tests/fuzz/corpus "$root/corpus"
        for pair in ply/little.ply=model/x-ply obj/faces.obj=model/obj las/plain.las=application/vnd.las \
            e57/two.e57=model/e57 pcd/binary.pcd=model/x-pcd qsplat/sphere.qs=model/x-qsplat \
            gltf/scene.glb=model/gltf-binary tree/sphere.surfel=model/x-surfel; do
            get libglib2.0-bin
            told=$(inside gio info -a standard::content-type "/corpus/${pair%%=*}" | sed -n 's/.*content-type: //p')
            [ "$told" = "${pair#*=}" ] || fail "${pair%%=*} is $told, not ${pair#*=}"
        done
        say "types of files are told by the desktop's own library"
        inside dpkg -r surfel >>"$base/apt-$release.log" 2>&1
        left=$(inside find /usr /etc /var/cache -xdev -name '*surfel*')
        [ -z "$left" ] || fail "left after removal: $left"
        say "removed, and nothing is left"
    fi
}

if [ "${SURFEL_NO_CHROOT:-}" != 1 ] && [ "$(id -u)" = 0 ] && has debootstrap; then
    for release in ${SURFEL_DEBIAN:-bookworm trixie}; do
        use_package "$release"
    done
else
    use_package ""
fi
say "all is as it should be"
