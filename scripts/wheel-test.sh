#!/bin/sh
# Builds the Python package into a wheel, installs it in an environment of its own, and tests it there.
#
#   scripts/wheel-test.sh [FOLDER]     the wheel goes to FOLDER, else to target/wheel
#
# Needs Python 3.10 or newer with venv, cargo, a C++ compiler, and PyPI for maturin, numpy and, to compare with, trimesh
# with rtree, and pyrender, which draws by OpenGL (EGL, or as PYOPENGL_PLATFORM says). Without those the tests say what
# they did not compare. mypy's stubtest holds the stubs to the package.
#
# Environment:
#   SURFEL_BIN      the program to compare with; without, that part is left out and said
#   WHEEL_PROFILE   cargo's profile [default: release]
#   WHEEL_CARGO     more words for cargo, such as --config KEY=VALUE
#   PYTHON          the interpreter [default: python3]
set -eu

cd "$(dirname "$0")/.."
out=${1:-target/wheel}
mkdir -p "$out"
out=$(cd "$out" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if [ -n "${SURFEL_BIN:-}" ]; then
    SURFEL_BIN=$(cd "$(dirname "$SURFEL_BIN")" && pwd)/$(basename "$SURFEL_BIN")
    export SURFEL_BIN
fi
# One folder for both, so that libraries are built once.
CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}
export CARGO_TARGET_DIR

"${PYTHON:-python3}" -m venv "$work/build"
"$work/build/bin/pip" install -q --disable-pip-version-check 'maturin>=1.9,<2'
rm -f "$out"/surfel-*.whl
# shellcheck disable=SC2086 # several words
"$work/build/bin/maturin" build -m python/Cargo.toml --locked --profile "${WHEEL_PROFILE:-release}" \
    -o "$out" ${WHEEL_CARGO:-}
wheel=$(ls "$out"/surfel-*.whl)

# A fresh environment: what the wheel does not say that it needs is not there.
"${PYTHON:-python3}" -m venv "$work/use"
"$work/use/bin/pip" install -q --disable-pip-version-check "$wheel"
(cd "$work" && "$work/use/bin/python" -c 'import surfel; print("wheel-test: surfel", surfel.__version__, surfel.devices())')
"$work/use/bin/pip" install -q --disable-pip-version-check trimesh rtree ||
    echo "wheel-test: no trimesh, so nothing is compared with it" >&2
"$work/use/bin/pip" install -q --disable-pip-version-check pyrender ||
    echo "wheel-test: no pyrender, so nothing is compared with it" >&2
(cd "$work" && "$work/use/bin/python" "$OLDPWD/python/tests/test_surfel.py")
# The stubs say what the package has.
"$work/use/bin/pip" install -q --disable-pip-version-check mypy
(cd "$work" && "$work/use/bin/python" -m mypy.stubtest surfel --ignore-missing-stub)
echo "wheel-test: $(basename "$wheel") is as it should be"
