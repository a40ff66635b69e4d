#!/bin/sh
# Measures a machine, with a graphics card or without, in one command: `surfel bench` on every case that can be
# generated, its rows as CSV, what was printed, and what the device is.
#
#   scripts/gpu-bench.sh [FOLDER] [OPTION...]
#
# FOLDER gets bench.csv, bench.txt and devices.txt (default: bench-HOST-DATE). Options go to `surfel bench`, such as
# --quick, --large, --device NAME or FILE. Needs the program alone: no display, no models, no compiler; shaders are inside.
#
# Environment:
#   SURFEL         the program (default: surfel beside this script, target/release/surfel, or the one on the search path)
#   SURFEL_MODELS  a folder with thesis/dragon_vrip.ply.gz, for the case of the dragon; without it that case is left out
#
# Exit status: 0 measured (figures may miss their targets), 1 the run failed, 2 bad usage or no program.
set -eu

here=$(cd "$(dirname "$0")" && pwd)

case ${1:-} in
    -h | --help)
        sed -n 's/^# \{0,1\}//p; /^$/q' "$0" | sed 1d
        exit 0
        ;;
esac

program=${SURFEL:-}
if [ -z "$program" ]; then
    for candidate in "$here/surfel" "$here/../target/release/surfel" "$(command -v surfel || true)"; do
        if [ -n "$candidate" ] && [ -x "$candidate" ] && ! [ -d "$candidate" ]; then
            program=$candidate
            break
        fi
    done
fi
if [ -z "$program" ] || ! [ -x "$program" ]; then
    echo "gpu-bench: no program: build it with cargo build --release --no-default-features --features rivals, or set SURFEL to it" >&2
    exit 2
fi

# A first argument that is no option is the folder.
case ${1:-} in
    "" | -*) folder=bench-$(uname -n)-$(date -u +%Y-%m-%d) ;;
    *)
        folder=$1
        shift
        ;;
esac
mkdir -p "$folder" || exit 2

{
    date -u +%Y-%m-%dT%H:%M:%SZ
    "$program" --version
    uname -sm
    nproc 2>/dev/null || true
    "$program" devices --self-test --calibrate
} >"$folder/devices.txt" || {
    echo "gpu-bench: the devices could not be asked (see above)" >&2
    exit 1
}
cat "$folder/devices.txt"

# The status of the program, not that of tee.
status=0
{
    "$program" bench --csv "$folder/bench.csv" "$@" || echo $? >"$folder/.status"
} | tee "$folder/bench.txt"
if [ -e "$folder/.status" ]; then
    status=$(cat "$folder/.status")
    rm -f "$folder/.status"
fi
echo "gpu-bench: $folder/bench.csv, bench.txt, devices.txt" >&2
exit "$status"
