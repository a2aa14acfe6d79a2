# `make bench` and `make test` are all that a machine with Rust needs; scripts/setup.sh installs the rest.
#
#   make bench         builders of every kind on a hall, a hill and a city: report/index.html, and structures as engines use
#                      them: report/accel.html; three minutes on two cores, once the driver has compiled the shaders
#   make bench-all     every scene of the folder SCENES (or HEDGEROW_SCENES)
#   make bench-peers   the same on Mesa 26, whose ray queries are a peer, beside CPU crates
#   make stability     where methods give way: report/growth.html, large.html, degenerate.html, greedy.html
#   make test          the test suite, under a bound in time: a shader that hangs would hang with it
#   make test-gpu      what work cut as for a GPU changes of the suite, with subgroups of 4, and a check of builders and tracers with 16
#   make test-lanes    the suite by either tuning on lavapipe with subgroups of 4, 8 and 16, and with one workgroup at a time
#   make test-drivers  every pass on a second driver, SwiftShader, by the tunings of CPUs and of GPUs; a quick check on Mesa 26
#   make test-wgpu     an engine on wgpu: builds it, lets it draw a frame, and compares that with what `hedgerow render` draws
#   make check         formatting, lints and docs, warnings denied
#   make package       the crate that engines depend on, with compiled shaders; builds it with and without the compiler
#   make portable      a folder OUT that runs on any machine with a Vulkan driver: scripts/portable.sh
#   make install-c     hedgerow.h and the libraries for C into PREFIX (/usr/local)
#
#   SETUP=true         go on without scripts/setup.sh       OUT=DIR        where reports go
#   PROFILE=ci         what CI compiles `make check` and the tests by: sooner, as not all is optimised
#   BENCH="…"          further arguments of `hedgerow bench`, such as -b lbvh,ploc or --runs 3
#   ACCEL="…"          the same of `hedgerow accel`, such as gen:city:1000 or --experiments batch,tlas
#   STABILITY="…"      the same of `hedgerow stability growth` and `large`, such as sponza or --no-rays

SETUP ?= scripts/setup.sh
OUT ?= report
SCENES ?= $(HEDGEROW_SCENES)
BENCH ?=
ACCEL ?=
STABILITY ?=
PREFIX ?= /usr/local
CARGO := scripts/cargo.sh
TARGET := $(or $(CARGO_TARGET_DIR),target)
RELEASE := $(TARGET)/release
BIN := $(RELEASE)/hedgerow
# What tests and lints are compiled by; `ci` compiles sooner (.cargo/config.toml).
PROFILE ?= release
TESTED := $(TARGET)/$(PROFILE)/hedgerow
CACHE := $(or $(HEDGEROW_CACHE),$(HOME)/.cache/hedgerow)
MESA := $(CACHE)/mesa26
SWIFTSHADER := $(CACHE)/swiftshader
# Where `make test-wgpu` puts its pictures.
WGPU := $(TARGET)/wgpu
# The ICD file of the second driver; another one may be named.
SECOND_DRIVER := $(or $(HEDGEROW_SECOND_DRIVER),$(SWIFTSHADER)/swiftshader.json)
ON_SECOND = VK_DRIVER_FILES=$(SECOND_DRIVER) VK_ICD_FILENAMES=$(SECOND_DRIVER) $(WITHIN) $(CARGO)
comma := ,
EMBREE_BUILDERS := ,embree-low,embree-medium,embree-high,embree-medium-tree,embree-high-tree
# The CPU peers that can be built here: Embree where it is installed (scripts/setup.sh --peers). The same features
# everywhere, so that nothing is compiled twice.
EMBREE := $(shell PATH="$$PATH:/sbin" ldconfig -p 2>/dev/null | grep -q 'libembree3\.so ' && echo yes)
FEATURES := peer-obvhs$(if $(EMBREE),$(comma)peer-embree)
PEER_BUILDERS ?= lbvh,lbvh:collapse=off,driver-fast-build,driver-fast-trace,obvhs-fastest,obvhs-medium$(if $(EMBREE),$(EMBREE_BUILDERS))
# What `make bench` has time for; the others measure all of it. An interior, what grows outdoors, and over 250,000 triangles.
QUICK := --runs 3 --structures 1024 --instances 10000 --size 80x60 --frames 7
QUICK_SCENES := scenes/hall.glb scenes/pine_hill.inst gen:city:280
# Seconds for the whole suite; compiling does not count, but for that of shaders by a driver that has none in its cache.
TEST_BOUND ?= 3000
WITHIN := $(if $(shell command -v timeout),timeout --kill-after 10 $(TEST_BOUND))
NEXTEST := $(shell cargo nextest --version >/dev/null 2>&1 && echo yes)
SUITE := $(WITHIN) $(if $(NEXTEST),scripts/suite.sh $(PROFILE) $(FEATURES),$(CARGO) test --profile $(PROFILE) --features $(FEATURES))
# What the tuning changes: tests of the library on the device. (Warming tests both tunings by itself; the others named are of the host.)
TUNED_TESTS ?= package(hedgerow) & !test(/^(warming|bvh::heuristics|bvh::host|kdtree::host|kdtree::merge)::/)
TUNED := $(if $(NEXTEST),'$(TUNED_TESTS)')
# What depends on how many lanes a subgroup has: groups of `hedgerow check`.
WIDTH_GROUPS ?= scan,sort,pool,lbvh,codes,hlbvh,ploc,hploc,split,optimise,wide,refit,child-order,ray-counts,kd-build,kd-merge,trace,trace-kd
# Groups that are checked once more with LLVM's optimisations, where GALLIVM_PERF leaves them out (.ci/run).
OPTIMISED_GROUPS ?=
SHARED := $(if $(filter Darwin,$(shell uname -s)),dylib,so)

.PHONY: bench bench-all bench-peers stability test test-gpu test-lanes test-wgpu check package portable install-c setup test-drivers

bench: setup
	$(CARGO) build --release -p hedgerow-lab --features $(FEATURES)
	$(BIN) accel $(QUICK) -o $(OUT) $(ACCEL)
	$(BIN) bench $(QUICK_SCENES) -o $(OUT) $(or $(BENCH),--runs 3)

bench-all: setup
	@test -d "$(SCENES)" || { echo "make bench-all: SCENES=DIR (or HEDGEROW_SCENES) names the folder of scenes" >&2; exit 2; }
	$(CARGO) build --release -p hedgerow-lab --features $(FEATURES)
	$(BIN) accel -o $(OUT) $(ACCEL)
	$(BIN) bench --all --scenes-dir "$(SCENES)" -o $(OUT) $(BENCH)

bench-peers: setup
	scripts/peer-lavapipe.sh $(MESA)
	$(CARGO) build --release -p hedgerow-lab --features $(FEATURES)
	scripts/with-lavapipe.sh $(MESA) $(BIN) accel -o $(OUT) $(ACCEL)
	scripts/with-lavapipe.sh $(MESA) $(BIN) bench $(if $(SCENES),--all --scenes-dir "$(SCENES)") -b $(PEER_BUILDERS) \
		-o $(OUT) $(BENCH)

stability: setup
	$(CARGO) build --release -p hedgerow-lab --features $(FEATURES)
	$(BIN) stability growth -o $(OUT) $(STABILITY)
	$(BIN) stability large -o $(OUT) $(STABILITY)
	$(BIN) stability degenerate -o $(OUT)
	$(BIN) stability greedy -o $(OUT)

test: setup
	$(CARGO) test --profile $(PROFILE) --features $(FEATURES) --no-run
	$(SUITE)
	$(if $(NEXTEST),$(WITHIN) $(CARGO) test --profile $(PROFILE) --features $(FEATURES) --doc)

# What `make test` has on a CPU is its tuning, and subgroups of 8 on most machines. Every branch for GPUs runs here, and other
# subgroups: lavapipe alone reads the width.
test-gpu: setup
	$(CARGO) test --profile $(PROFILE) --features $(FEATURES) --no-run
	HEDGEROW_TUNING=gpu LP_NATIVE_VECTOR_WIDTH=128 $(SUITE) $(TUNED)
	LP_NATIVE_VECTOR_WIDTH=512 $(TESTED) check --quick --tuning gpu --groups $(WIDTH_GROUPS)

# lavapipe alone reads these variables.
test-lanes: setup
	$(CARGO) test --profile $(PROFILE) --features $(FEATURES) --no-run
	for tuning in cpu gpu; do for lanes in LP_NATIVE_VECTOR_WIDTH=128 LP_NATIVE_VECTOR_WIDTH=256 LP_NATIVE_VECTOR_WIDTH=512 LP_NUM_THREADS=1; do \
		env HEDGEROW_TUNING=$$tuning $$lanes $(SUITE) || exit 1; done; done

# Not a part of `make test`: wgpu is a hundred crates. Where the validation layers are installed, what they say is wrong, too.
test-wgpu: setup
	$(CARGO) build --release -p hedgerow-lab --features $(FEATURES)
	$(CARGO) build --release -p hedgerow-on-wgpu
	mkdir -p $(WGPU)
	$(WITHIN) $(BIN) render knot -b lbvh --view normals --size 640x480 -o $(WGPU)/render.png
	VK_INSTANCE_LAYERS=VK_LAYER_KHRONOS_validation $(WITHIN) $(RELEASE)/hedgerow-on-wgpu scenes/knot.ply $(WGPU)/wgpu.png \
		$(WGPU)/render.png > $(WGPU)/output 2>&1; status=$$?; cat $(WGPU)/output; \
		! grep -q VUID $(WGPU)/output && exit $$status
	$(CARGO) clippy --release -p hedgerow-on-wgpu -- -D warnings

# A process for each tuning: SwiftShader compiles every pipeline anew in each, one at a time. Small builds that share dispatches have a
# run of their own.
test-drivers: setup
	$(if $(HEDGEROW_SECOND_DRIVER),,scripts/second-driver.sh $(SWIFTSHADER))
	$(CARGO) test --profile $(PROFILE) --features $(FEATURES) --test main --no-run
	$(ON_SECOND) $(if $(NEXTEST),nextest run --cargo-profile $(PROFILE) --features $(FEATURES) --test main --run-ignored only \
		--success-output immediate --final-status-level slow -E 'test(/^drivers::/)',test --profile $(PROFILE) \
		--features $(FEATURES) --test main -- drivers:: --ignored --nocapture --test-threads 1)
	$(ON_SECOND) test --profile $(PROFILE) --features $(FEATURES) --test main -- accel::arguments
	scripts/peer-lavapipe.sh $(MESA)
	scripts/with-lavapipe.sh $(MESA) $(TESTED) check --quick
	$(if $(OPTIMISED_GROUPS),GALLIVM_PERF= scripts/with-lavapipe.sh $(MESA) $(TESTED) check --quick --groups $(OPTIMISED_GROUPS))

check: setup
	cargo fmt --all --check
	$(CARGO) clippy --profile $(PROFILE) --all-targets --features $(FEATURES) -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --profile $(PROFILE) --no-deps --lib --examples --features $(FEATURES)

package: setup
	scripts/package.sh $(PROFILE)

portable: setup
	@test "$(OUT)" != report || { echo "make portable: OUT=DIR names the folder to make" >&2; exit 2; }
	scripts/portable.sh "$(OUT)"

install-c:
	$(CARGO) build --release -p hedgerow-capi
	mkdir -p "$(DESTDIR)$(PREFIX)/include" "$(DESTDIR)$(PREFIX)/lib"
	install -m 644 $(RELEASE)/include/hedgerow.h "$(DESTDIR)$(PREFIX)/include"
	install -m 644 $(RELEASE)/libhedgerow_capi.a $(RELEASE)/libhedgerow_capi.$(SHARED) "$(DESTDIR)$(PREFIX)/lib"

setup:
	@$(SETUP)
