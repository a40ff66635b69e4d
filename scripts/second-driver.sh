#!/bin/sh
# Draws the test pictures on another Vulkan driver, and says which tests differ there.
#
# usage: scripts/second-driver.sh MANIFEST.json [TEST...]
#
# MANIFEST.json is the file by which the Vulkan loader finds the driver (its ICD manifest). Tests are files of
# tests/device by name; without any, those that compare pictures. What they print is kept in out/second-driver. Ends
# with 1 if a test fails. docs/MEASURING.md says what is known to differ, and why.
set -eu

if [ $# -lt 1 ] || [ ! -f "$1" ]; then
    sed -n 's/^# \(usage: .*\)/\1/p' "$0" >&2
    exit 2
fi
driver=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
shift
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || set -- golden oracle paths visibility overdraw splats by_id device_cut

out=out/second-driver
mkdir -p "$out"
# The second name is what older loaders know.
export VK_DRIVER_FILES="$driver" VK_ICD_FILENAMES="$driver" SURFEL_REQUIRE_DEVICE=1
cargo run --locked --quiet -- devices

status=0
for test in "$@"; do
    log=$out/$test.txt
    echo "$test"
    if ! cargo test --locked --test device "$test::" -- --show-output >"$log" 2>&1; then
        status=1
    fi
    # Names of the tests that fail, then what the driver lacks, each once.
    sed -n 's/^test \(.*\) \.\.\. FAILED$/  differs: \1/p' "$log"
    sed -n 's/^\(the device has no .*\)$/  not tested: \1/p' "$log" | sort -u
    grep -q '^test result: .* [1-9][0-9]* passed\|^test result: FAILED' "$log" || echo "  did not run, see $log"
done
exit "$status"
