# SPDX-License-Identifier: GPL-3.0-or-later
# Every target does the set-up and the build that it needs. `make` alone lists the targets.

SCENE ?= blender_scenes/atrium.blend
ARGS ?=
BLENDER := /usr/bin/blender --background
PYTHON := PYTHONPATH=build .venv/bin/python
CPP_FILES = find native tests/native -name '*.h' -o -name '*.cpp'

export SCENE
.NOTPARALLEL:
.PHONY: help setup build compare test lint test-native test-python test-bpy test-blender test-ui \
	format test-scenes bench bench-cycles study paper zip scenes clean check-scene

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "make %-13s %s\n", $$1, $$2}' Makefile

setup: ## install what is needed on Debian 12 or 13 (as root or with sudo), and the .venv
	@scripts/setup.sh

build: setup ## build the native module; PYTHONPATH=build finds the package bvh_lab then
	@cmake --preset release --log-level=WARNING
	@cmake --build build

compare: check-scene build ## compare BVHs on SCENE=file (.blend, .npz, .obj, .ply), with ARGS="--builders lbvh,sah"
	@name=$$(basename "$$SCENE"); out="out/$${name%.*}"; case "$$SCENE" in \
	*.blend) $(BLENDER) --factory-startup "$$SCENE" --python-exit-code 1 --python addon/cli.py -- compare --out "$$out" $(ARGS);; \
	*) $(PYTHON) -m bvh_lab compare "$$SCENE" --out "$$out" $(ARGS);; esac

check-scene:
	$(if $(shell test -f "$(SCENE)" && echo yes),,$(error no such scene file: $(SCENE)))@:

test: lint test-native test-python test-bpy test-blender test-ui ## run every test, fast ones first; stops at the first layer that fails

lint: build ## check format, style and types
	@$(CPP_FILES) | xargs .venv/bin/clang-format --dry-run -Werror
	@.venv/bin/ruff check .
	@.venv/bin/ruff format --check .
	@MYPYPATH=build .venv/bin/mypy --strict -p bvh_lab.study

test-native: build ## tests of the C++ core
	@ctest --test-dir build --parallel 2 --no-tests=error --output-on-failure --timeout 600

test-python: build ## tests of the Python API and of the study, without Blender
	@$(PYTHON) -m pytest tests/python

test-bpy: build ## tests of the Blender side in the newest Blender, as the bpy module
	@$(PYTHON) -m pytest tests/blender

test-blender: build ## the same tests in Debian's Blender
	@$(BLENDER) --factory-startup --python-exit-code 1 --python tests/blender/run.py

test-ui: build ## tests of the panel in a Blender with a window (Xvfb)
	@$(PYTHON) -m pytest tests/ui

test-scenes: build ## the test that all variants agree, with a million rays in each of ../shared/scenes (an hour or two)
	@BVHLAB_TEST_ALL=1 BVHLAB_TEST_RAYS=1000000 $(PYTHON) -m pytest --timeout 0 tests/python/test_core_scenes.py

format: setup ## format all sources
	@$(CPP_FILES) | xargs .venv/bin/clang-format -i
	@.venv/bin/ruff check --fix .
	@.venv/bin/ruff format .

bench: build ## time builders and tracing against Embree and mathutils.bvhtree, and the path tracer against Cycles
	@$(PYTHON) scripts/bench.py --out out/bench $(ARGS)
	@$(PYTHON) scripts/bench_cycles.py --out out/bench

bench-cycles: build ## the last part of bench alone, with ARGS="--resolution 320x240"
	@$(PYTHON) scripts/bench_cycles.py --out out/bench $(ARGS)

study: build ## the paper's tables and figures from blender_scenes/ into out/study, with ARGS="--builders lbvh,sah"
	@$(PYTHON) scripts/study.py --out out/study $(ARGS)

paper: check-scene build ## compare costs with the paper's on SCENE=file (.npz, .obj, .ply) into out/paper, with ARGS="--metrics"
	@$(PYTHON) scripts/paper.py "$$SCENE" --out out/paper $(ARGS)

zip: build ## make the add-on's installable zip in dist/
	@.venv/bin/python scripts/make_zip.py

scenes: setup ## make the .blend files of blender_scenes/ anew
	@$(BLENDER) --factory-startup --python-exit-code 1 --python blender_scenes/make_scenes.py -- $(ARGS)

clean: ## remove what was built (not the .venv)
	rm -rf build dist out
