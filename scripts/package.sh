#!/bin/sh
# Makes the packages of the program: a .deb and a .tar.xz archive.
#
#   scripts/package.sh [FOLDER]     writes into FOLDER, else into target/package
#
# Both have the program, its manual pages, completions for bash, fish and zsh, the desktop entry, types of files, the
# thumbnailer, icons, README and licenses. The archive has the folders of /usr: unpack it there, or below ~/.local.
# The same program gives the same packages to the byte. Needs cargo, and dpkg-deb for the .deb; without it only the archive
# is made, and said so.
#
# Environment:
#   SURFEL_BIN          the program to pack; else one is built with --release
#   FEATURES            the cargo flags of that build
#   SOURCE_DATE_EPOCH   time of all files, seconds [default: that of the last commit, else 0]
#   DEBFULLNAME, DEBEMAIL   who answers for the .deb [default: the maintainers named by the last commit, else nobody]
set -eu

cd "$(dirname "$0")/.."
out=${1:-target/package}
version=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml | head -n 1)

if [ -z "${SURFEL_BIN:-}" ]; then
    # shellcheck disable=SC2086 # several flags
    cargo build --release --locked ${FEATURES:-}
    SURFEL_BIN=${CARGO_TARGET_DIR:-target}/release/surfel
fi
[ -x "$SURFEL_BIN" ] || {
    echo "package: $SURFEL_BIN is no program" >&2
    exit 2
}
told=$("$SURFEL_BIN" -V)
[ "$told" = "surfel $version" ] || {
    echo "package: $SURFEL_BIN is '$told', and these sources are $version" >&2
    exit 2
}
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2>/dev/null || echo 0)}
export SOURCE_DATE_EPOCH

mkdir -p "$out"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
umask 022

# ---- the folders of /usr -------------------------------------------------------------------------------

usr=$work/usr
share=$usr/share
put() { # put MODE FILE TARGET
    mkdir -p "$(dirname "$3")"
    cp "$2" "$3"
    chmod "$1" "$3"
}
put 755 "$SURFEL_BIN" "$usr/bin/surfel"
# Names of functions stay, for reports of crashes.
if command -v strip >/dev/null 2>&1; then strip --strip-debug "$usr/bin/surfel"; fi
mkdir -p "$share/man/man1" "$share/bash-completion/completions" \
    "$share/fish/vendor_completions.d" "$share/zsh/vendor-completions"
"$SURFEL_BIN" man --output "$share/man/man1"
gzip -9n "$share/man/man1"/*.1
"$SURFEL_BIN" completions bash >"$share/bash-completion/completions/surfel"
"$SURFEL_BIN" completions fish >"$share/fish/vendor_completions.d/surfel.fish"
"$SURFEL_BIN" completions zsh >"$share/zsh/vendor-completions/_surfel"
put 644 packaging/surfel.desktop "$share/applications/surfel.desktop"
put 644 packaging/surfel.thumbnailer "$share/thumbnailers/surfel.thumbnailer"
put 644 packaging/mime.xml "$share/mime/packages/surfel.xml"
put 644 packaging/icon.svg "$share/icons/hicolor/scalable/apps/surfel.svg"
for side in 48 256; do
    put 644 "packaging/icon-$side.png" "$share/icons/hicolor/${side}x$side/apps/surfel.png"
done
for file in README.md CHANGELOG.md SECURITY.md LICENSE-MIT LICENSE-APACHE docs/METHODS.md docs/TRUST.md; do
    put 644 "$file" "$share/doc/surfel/$(basename "$file")"
done
cat >"$share/doc/surfel/copyright" <<END
Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: surfel

Files: *
Copyright: the authors of surfel
License: MIT or Apache-2.0
 The texts are in LICENSE-MIT and LICENSE-APACHE beside this file.
END

# Times and order are those of the sources, not of this run.
find "$work" -exec touch -h -d "@$SOURCE_DATE_EPOCH" {} +
pack() { # pack FOLDER NAME
    tar -C "$1" --sort=name --owner=0 --group=0 --numeric-owner --mtime="@$SOURCE_DATE_EPOCH" -cf - "$2"
}

# ---- archive -------------------------------------------------------------------------------------------

machine=$(uname -m)
name=surfel-$version-$(uname -s | tr '[:upper:]' '[:lower:]')-$machine
cp -a "$usr" "$work/$name"
pack "$work" "$name" | xz -6 -T1 >"$out/$name.tar.xz"
echo "$out/$name.tar.xz"

# ---- .deb ----------------------------------------------------------------------------------------------

if ! command -v dpkg-deb >/dev/null 2>&1; then
    echo "package: no dpkg-deb here, so no .deb" >&2
    exit 0
fi
architecture=$(dpkg --print-architecture)
maintainer=${DEBFULLNAME:-$(git log -1 --format=%cn 2>/dev/null || true)}
email=${DEBEMAIL:-$(git log -1 --format=%ce 2>/dev/null || true)}
# The C library that the program needs, by the newest of its symbols.
libc=$(grep -ao 'GLIBC_2\.[0-9]*' "$usr/bin/surfel" | sort -Vu | tail -n 1)
root=$work/deb
mkdir -p "$root/DEBIAN"
cp -a "$usr" "$root/usr"
cat >"$root/DEBIAN/control" <<END
Package: surfel
Version: $version
Architecture: $architecture
Maintainer: ${maintainer:-nobody} <${email:-nobody@localhost}>
Section: graphics
Priority: optional
Installed-Size: $(du -ks --apparent-size "$usr" | cut -f1)
Depends: libc6 (>= ${libc#GLIBC_}), libgcc-s1, libstdc++6 (>= 12)
Recommends: libvulkan1, mesa-vulkan-drivers | vulkan-icd, libx11-6, libxcursor1, libxi6, libxinerama1, libxrandr2
Suggests: vulkan-validationlayers
Description: viewer and renderer of enormous meshes and scans
 Orders a model into a tree once, and draws from it what each view needs:
 triangles where they are large on screen, points where they are small.
 Reads PLY, OBJ, STL, OFF, glTF, LAS, LAZ, E57, PCD and text clouds.
END
(cd "$root" && find usr -type f | LC_ALL=C sort | xargs md5sum) >"$root/DEBIAN/md5sums"
find "$root" -exec touch -h -d "@$SOURCE_DATE_EPOCH" {} +
deb=$out/surfel_${version}_$architecture.deb
dpkg-deb --root-owner-group -Zxz --build "$root" "$deb" >/dev/null
echo "$deb"
