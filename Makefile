# make demo    draw the built-in model with every method; pictures and a contact sheet in out/demo
# make test    everything that must hold: format, lint, tests under the validation layers, documents
# make check   the quick part of it, while working
# make bench   the benchmarks that docs/MEASURING.md quotes
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

.PHONY: help demo test check bench
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
	$(CARGO) clippy --locked --no-default-features --all-targets -- -D warnings
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
