# `make bench` and `make test` are all that a machine with Rust needs; scripts/setup.sh installs the rest.
#
#   make bench         scenes/ with the default builders: report/index.html, at most three minutes on two cores
#   make bench-all     every scene of the folder SCENES (or HEDGEROW_SCENES)
#   make bench-peers   the same on Mesa 26, whose ray queries are a peer, beside CPU crates
#   make test          the test suite, under a bound in time: a shader that hangs would hang with it
#   make check         formatting, lints and docs, warnings denied
#   make prebuilt      compiles glsl/ into glsl/prebuilt/, for builds without the feature compile-shaders
#
#   SETUP=true         go on without scripts/setup.sh       OUT=DIR        where reports go
#   BENCH="…"          further arguments of `hedgerow bench`, such as -b lbvh,ploc or --runs 3

SETUP ?= scripts/setup.sh
OUT ?= report
SCENES ?= $(HEDGEROW_SCENES)
BENCH ?=
CARGO := scripts/cargo.sh
BIN := $(or $(CARGO_TARGET_DIR),target)/release/hedgerow
CACHE := $(or $(HEDGEROW_CACHE),$(HOME)/.cache/hedgerow)
MESA := $(CACHE)/mesa26
comma := ,
EMBREE_BUILDERS := ,embree-low,embree-medium,embree-high
# Embree is linked where it is installed (scripts/setup.sh --peers).
EMBREE := $(shell PATH="$$PATH:/sbin" ldconfig -p 2>/dev/null | grep -q 'libembree3\.so ' && echo yes)
PEERS := peer-obvhs$(if $(EMBREE),$(comma)peer-embree)
PEER_BUILDERS ?= lbvh,lbvh:collapse=off,driver-fast-build,driver-fast-trace,obvhs-fastest,obvhs-medium$(if $(EMBREE),$(EMBREE_BUILDERS))
# Seconds for the whole suite; compiling does not count.
TEST_BOUND ?= 1200
WITHIN := $(if $(shell command -v timeout),timeout --kill-after 10 $(TEST_BOUND))
NEXTEST := $(shell cargo nextest --version >/dev/null 2>&1 && echo yes)

.PHONY: bench bench-all bench-peers test check prebuilt setup

bench: setup
	$(CARGO) build --release
	$(BIN) bench -o $(OUT) $(BENCH)

bench-all: setup
	@test -d "$(SCENES)" || { echo "make bench-all: SCENES=DIR (or HEDGEROW_SCENES) names the folder of scenes" >&2; exit 2; }
	$(CARGO) build --release
	$(BIN) bench --all --scenes-dir "$(SCENES)" -o $(OUT) $(BENCH)

bench-peers: setup
	scripts/peer-lavapipe.sh $(MESA)
	$(CARGO) build --release --features $(PEERS)
	scripts/with-lavapipe.sh $(MESA) $(BIN) bench $(if $(SCENES),--all --scenes-dir "$(SCENES)") -b $(PEER_BUILDERS) \
		-o $(OUT) $(BENCH)

test: setup
	$(CARGO) test --release --features peer-obvhs --no-run
ifeq ($(NEXTEST),yes)
	$(WITHIN) $(CARGO) nextest run --release --features peer-obvhs
	$(WITHIN) $(CARGO) test --release --features peer-obvhs --doc
else
	$(WITHIN) $(CARGO) test --release --features peer-obvhs
endif

check: setup
	cargo fmt --check
	$(CARGO) clippy --release --all-targets --features peer-obvhs -- -D warnings
	$(CARGO) clippy --release --no-default-features --lib -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --release --no-deps --features peer-obvhs

prebuilt: setup
	HEDGEROW_UPDATE_PREBUILT=1 $(CARGO) test --release --test prebuilt

setup:
	@$(SETUP)
