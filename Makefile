# make demo    draw the built-in model with every method; pictures and a contact sheet in out/demo
# make test    everything that must hold: format, lint, tests under the validation layers, documents
# make check   the quick part of it, while working
# make bench   the benchmarks that docs/MEASURING.md quotes
# and what can be relied on, with figures in docs/TRUST.md:
# make fuzz-replay   kept files of every reader, and the same damage to them as ever (seconds)
# make fuzz          damaged files without end: RUNS=1000000 SEED=1
# make faults        each call of Vulkan, and each system call of each writer, fails once (an hour)
# make soak          random input for the window: MINUTES=60 SEED=1
# make package-test  packages, installed on a bare Debian (as root): SURFEL_DEBIAN="bookworm trixie"
# make wheel-test    the Python package, in an environment of its own
#
# Each first installs what is missing, or says what to install (scripts/setup.sh). Without the window, which
# needs cmake and X11 headers to build:   make demo FEATURES=--no-default-features

CARGO ?= cargo
FEATURES ?=
OUT ?= out/demo
ARGS ?=

BIN = $(or $(CARGO_TARGET_DIR),target)/release/surfel

# rustup's folder, for shells that have not read its profile yet.
export PATH := $(PATH):$(or $(CARGO_HOME),$(HOME)/.cargo)/bin
export FEATURES

.PHONY: help demo test check bench fuzz-replay fuzz faults soak package-test wheel-test
.NOTPARALLEL:

help:
	@sed -n 's/^# \{0,1\}//p; /^$$/q' Makefile

demo:
	@scripts/setup.sh demo
	$(CARGO) build --release --locked $(FEATURES)
	$(BIN) demo -o $(OUT) $(ARGS)

# A device that is missing is a failure here, not a reason to skip.
test: export SURFEL_REQUIRE_DEVICE = 1
test:
	@scripts/setup.sh test
	scripts/setup-test.sh
	$(CARGO) fmt --all -- --check
	$(CARGO) clippy --locked $(FEATURES) --features rivals --all-targets -- -D warnings
	$(CARGO) clippy --locked --no-default-features --lib --bins -- -D warnings
	$(CARGO) test --locked $(FEATURES) --features rivals --no-fail-fast
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --locked $(FEATURES) --no-deps

check:
	@scripts/setup.sh test
	$(CARGO) fmt --all -- --check
	$(CARGO) clippy --locked $(FEATURES) --all-targets -- -D warnings
	$(CARGO) test --locked $(FEATURES) --lib

bench:
	@scripts/setup.sh demo
	$(CARGO) bench --locked $(FEATURES) $(ARGS)

RUNS ?= 1000000
SEED ?= 1
MINUTES ?= 60

fuzz-replay:
	$(CARGO) test --locked $(FEATURES) --test fuzz -- --nocapture

fuzz:
	SURFEL_FUZZ_RUNS=$(RUNS) SURFEL_FUZZ_SEED=$(SEED) \
		$(CARGO) test --locked $(FEATURES) --test fuzz -- --nocapture campaign

faults: export SURFEL_FAULTS = all
faults:
	$(CARGO) test --locked $(FEATURES) --test faults -- --nocapture
	$(CARGO) test --locked $(FEATURES) --test cli -- --nocapture write_faults

# The C library is told to give freed memory back: what is left is what the program holds.
# The C library of Linux keeps memory that was freed; jemalloc (Debian's libjemalloc2) gives it back, where it is there.
JEMALLOC ?= $(firstword $(wildcard /usr/lib/*/libjemalloc.so.2))

soak:
	$(CARGO) build --release --locked $(FEATURES)
	LD_PRELOAD=$(JEMALLOC) MALLOC_CONF=narenas:1,tcache:false,dirty_decay_ms:0,muzzy_decay_ms:0 \
		MALLOC_ARENA_MAX=2 MALLOC_MMAP_THRESHOLD_=131072 \
		$(BIN) soak --minutes $(MINUTES) --seed $(SEED) $(ARGS)

package-test:
	scripts/package-test.sh

wheel-test:
	scripts/wheel-test.sh
