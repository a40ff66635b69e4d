#!/bin/sh
# Measures a machine, with a graphics card or without, in one command: `surfel bench` on every case that can be
# generated, its rows as CSV, what was printed, and what the device is. Then every way to draw, each picture beside that of the
# reference, which draws the same on the processor without Vulkan.
#
#   scripts/gpu-bench.sh [FOLDER] [OPTION...]
#
# FOLDER gets bench.csv, bench.txt, devices.txt, pictures.txt and a folder of pictures (default: bench-HOST-DATE). Options go to
# `surfel bench`, such as --quick, --large, --device NAME or FILE; --device goes to the pictures too. Needs the program alone: no
# display, no models, no compiler; shaders are inside.
#
# Environment:
#   SURFEL         the program (default: surfel beside this script, target/release/surfel, or the one on the search path)
#   SURFEL_MODELS  a folder with thesis/dragon_vrip.ply.gz, for the case of the dragon; without it that case is left out
#   SURFEL_PICTURE the model of the pictures (default: generate:statue:400000); empty for none
#   SURFEL_PICTURE_SIZE their size in pixels (default: 400x400)
#   SURFEL_BESIDE  what they are compared with: reference, or another device as --device has it (default: reference)
#
# Exit status: 0 measured (figures may miss their targets), 1 the run failed or a picture is another one, 2 bad usage or no program.
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
[ "$status" = 0 ] || exit "$status"

device=
before=
for word; do
    [ "$before" = --device ] && device=$word
    case $word in --device=*) device=${word#--device=} ;; esac
    before=$word
done
model=${SURFEL_PICTURE-generate:statue:400000}
[ -n "$model" ] || exit 0
beside=${SURFEL_BESIDE:-reference}
size=${SURFEL_PICTURE_SIZE:-400x400}
pictures=$folder/pictures
mkdir -p "$pictures" || exit 2

# A picture of the model: FILE DEVICE OPTION...
render() {
    file=$1
    on=$2
    shift 2
    # In the light of measurements, unless there is a lamp.
    case " $* " in *" --light "*) ;; *) set -- --light headlight "$@" ;; esac
    "$program" render "$model" -o "$file" --orbit 30,20,1 --size "$size" --samples 16 --ambient-occlusion off --quiet \
        ${on:+--device "$on"} "$@" >/dev/null
}

# Draws it both ways and compares: NAME OPTIONS WAY...
compare() {
    name=$1
    options=$2
    shift 2
    # The options of a picture are words of their own.
    # shellcheck disable=SC2086
    render "$pictures/$name-beside.png" "$beside" $options || exit 1
    for way; do
        case $way in
            auto) how= ;;
            ids) how="--path raster --list-of ids" ;;
            cut) how="--path raster --cut-on device" ;;
            *) how="--path $way" ;;
        esac
        picture=$pictures/$name-$way.png
        # shellcheck disable=SC2086
        render "$picture" "$device" $options $how || {
            # 2: this device cannot draw so, and the program has said why.
            [ $? = 2 ] || exit 1
            printf '%-24s not drawn here\n' "$name $way"
            continue
        }
        said=$("$program" compare "$pictures/$name-beside.png" "$picture" --min-psnr "$least_db") || {
            # 1: they differ by more; else nothing was compared.
            [ $? = 1 ] || exit 1
            apart=$((apart + 1))
        }
        count=$((count + 1))
        printf '%-24s %s\n' "$name $way" "$(echo "$said" | sed -n 's/^\(psnr\|levels\) *//p' | tr '\n' ';')"
    done
}

# Decibels over the whole picture. Two devices that round differently are above it, as single pixels differ where surfaces tie.
least_db=50
apart=0
count=0
{
    echo "$model at 400 x 400 on ${device:-the first device}, beside $beside: PSNR; levels of 255"
    compare triangles "--method triangles" raster
    compare points-2 "--method points --threshold 2" raster
    compare square-0 "--threshold 0" auto raster compute
    compare square-1 "--threshold 1" auto raster compute ids cut
    compare square-4 "--threshold 4" auto raster compute ids cut
    compare square-12 "--threshold 12" auto raster
    compare disc-3 "--splat disc --threshold 3" auto raster compute ids cut
    compare ellipse-3 "--splat ellipse --threshold 3" auto raster compute ids
    compare gauss-3 "--splat gauss --threshold 3" auto raster compute ids
    compare filtered-1 "--splat filtered --threshold 1" auto raster compute
    compare filtered-3 "--splat filtered --threshold 3" auto raster compute
    compare visibility-3 "--splat visibility --threshold 3" auto raster compute ids
    compare splats-3 "--method splats --threshold 3" auto raster
    compare lamp-3 "--threshold 3 --light phong --light-at -60,20" auto raster
    echo "$apart of $count pictures are below $least_db dB"
} >"$folder/pictures.txt"
cat "$folder/pictures.txt"
echo "gpu-bench: $pictures and pictures.txt" >&2
[ "$apart" = 0 ]
