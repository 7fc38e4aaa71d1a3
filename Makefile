# SPDX-License-Identifier: GPL-3.0-or-later
# Every target does the set-up and the build that it needs. `make` alone lists the targets.

SCENE ?= blender_scenes/atrium.blend
DEVICE ?=
ARGS ?=
BLENDER := /usr/bin/blender --background
PYTHON := PYTHONPATH=build .venv/bin/python
CPP_FILES = find native tests/native tests/fuzz tests/sanitize -name '*.h' -o -name '*.cpp' -o -name '*.cl'

# The same files in every run of the tests; `make fuzz` takes others.
FUZZ_CORE = build-sanitize/fuzz_core -max_len=512 -timeout=60 -rss_limit_mb=4096 -artifact_prefix=out/fuzz/
SECONDS_A_TARGET ?= 60
SEED ?= $(shell date +%s)

export SCENE DEVICE
.NOTPARALLEL:
.PHONY: help setup build compare test lint test-native test-python test-bpy test-blender test-ui \
	test-files test-sanitize test-fuzz fuzz format test-scenes bench bench-cycles study stability paper zip scenes clean check-scene

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "make %-13s %s\n", $$1, $$2}' Makefile

setup: ## install what is needed on Debian 12 or 13 (as root or with sudo), and the .venv
	@scripts/setup.sh

build: setup ## build the native module; PYTHONPATH=build finds the package bvh_lab then
	@cmake --preset release --log-level=WARNING
	@cmake --build build

compare: check-scene build ## compare BVHs on SCENE=file (.blend, .npz, .obj, .ply), with DEVICE=opencl, ARGS="--builders lbvh,sah"
	@name=$$(basename "$$SCENE"); out="out/$${name%.*}"; case "$$SCENE" in \
	*.blend) $(BLENDER) --factory-startup "$$SCENE" --python-exit-code 1 --python addon/cli.py -- compare --out "$$out" $${DEVICE:+--device "$$DEVICE"} $(ARGS);; \
	*) $(PYTHON) -m bvh_lab compare "$$SCENE" --out "$$out" $${DEVICE:+--device "$$DEVICE"} $(ARGS);; esac

check-scene:
	$(if $(shell test -f "$(SCENE)" && echo yes),,$(error no such scene file: $(SCENE)))@:

test: lint test-native test-python test-files test-bpy test-blender test-ui test-fuzz test-sanitize ## run every test, fast ones first; stops at the first layer that fails

lint: build ## check format, style and types
	@$(CPP_FILES) | xargs .venv/bin/clang-format --dry-run -Werror
	@.venv/bin/ruff check .
	@.venv/bin/ruff format --check .
	@MYPYPATH=build .venv/bin/mypy --strict -p bvh_lab.study

test-native: build ## tests of the C++ core
	@ctest --test-dir build --parallel 2 --no-tests=error --output-on-failure --timeout 600

test-python: build ## tests of the Python API and of the study, without Blender
	@$(PYTHON) -m pytest -n 2 --dist loadfile tests/python

test-bpy: build ## tests of the Blender side in the newest Blender, as the bpy module
	@$(PYTHON) -m pytest -n 2 tests/blender

test-blender: build ## the same tests in Debian's Blender
	@$(BLENDER) --factory-startup --python-exit-code 1 --python tests/blender/run.py

test-ui: build ## tests of the panel in a Blender with a window (Xvfb)
	@$(PYTHON) -m pytest tests/ui

# Without OpenCL: drivers and the code they make are not instrumented.
test-sanitize: setup ## the C++ tests under address, undefined behaviour and thread sanitizer
	@for preset in sanitize sanitize-thread; do \
		cmake --preset $$preset --log-level=WARNING && cmake --build --preset $$preset && \
		ctest --test-dir build-$$preset --parallel 2 --no-tests=error --output-on-failure --timeout 600 || exit 1; done

test-fuzz: setup ## build trees of mutated bytes under sanitizers for about a minute, the same in every run
	@cmake --preset sanitize --log-level=WARNING && cmake --build --preset sanitize --target fuzz_core
	@rm -rf out/fuzz/first && mkdir -p out/fuzz/first
	@$(FUZZ_CORE) -seed=1 -runs=30000 -max_total_time=120 out/fuzz/first tests/fuzz/corpus/core >out/fuzz/core.log 2>&1 || \
		{ tail -n 60 out/fuzz/core.log; echo "make test-fuzz: the bytes are in out/fuzz/"; exit 1; }
	@echo "core: $$(tail -n 1 out/fuzz/core.log)"

test-files: build ## read mutated files for about a minute, the same in every run
	@$(PYTHON) tests/fuzz/fuzz_files.py --runs 2000 --seconds 20

fuzz: build ## the same with new bytes, SECONDS_A_TARGET=60 for each target, SEED=number
	@cmake --preset sanitize --log-level=WARNING && cmake --build --preset sanitize --target fuzz_core
	@mkdir -p out/fuzz/core && $(FUZZ_CORE) -seed=$(SEED) -max_total_time=$(SECONDS_A_TARGET) out/fuzz/core tests/fuzz/corpus/core
	@$(PYTHON) tests/fuzz/fuzz_files.py --seed $(SEED) --seconds $(SECONDS_A_TARGET)

test-scenes: build ## the test that all variants agree, with a million rays in each of ../shared/scenes (an hour or two)
	@BVHLAB_TEST_ALL=1 BVHLAB_TEST_RAYS=1000000 $(PYTHON) -m pytest --timeout 0 tests/python/test_core_scenes.py

format: setup ## format all sources
	@$(CPP_FILES) | xargs .venv/bin/clang-format -i
	@.venv/bin/ruff check --fix .
	@.venv/bin/ruff format .

bench: build ## time builders and tracing against Embree and mathutils.bvhtree, and the path tracer against Cycles; with DEVICE=opencl, that device
	@if [ -n "$$DEVICE" ]; then $(PYTHON) scripts/bench_device.py --device "$$DEVICE" --out out/bench $(ARGS); else \
	$(PYTHON) scripts/bench.py --out out/bench $(ARGS) && $(PYTHON) scripts/bench_cycles.py --out out/bench; fi

bench-cycles: build ## the last part of bench alone, with ARGS="--resolution 320x240"
	@$(PYTHON) scripts/bench_cycles.py --out out/bench $(ARGS)

study: build ## the paper's tables and figures from blender_scenes/ into out/study, with ARGS="--builders lbvh,sah"
	@$(PYTHON) scripts/study.py --out out/study $(ARGS)

stability: build ## errors and speed of all precision choices on hard cases into out/stability (twenty minutes; ARGS="--quick")
	@$(PYTHON) scripts/stability.py --out out/stability $(ARGS)

paper: check-scene build ## compare costs with the paper's on SCENE=file (.npz, .obj, .ply) into out/paper, with ARGS="--metrics"
	@$(PYTHON) scripts/paper.py "$$SCENE" --out out/paper $(ARGS)

zip: build ## make the add-on's installable zip in dist/
	@.venv/bin/python scripts/make_zip.py

scenes: setup ## make the .blend files of blender_scenes/ anew
	@$(BLENDER) --factory-startup --python-exit-code 1 --python blender_scenes/make_scenes.py -- $(ARGS)

clean: ## remove what was built (not the .venv)
	rm -rf build build-sanitize build-sanitize-thread dist out
