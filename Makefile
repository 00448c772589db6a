# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
# The set-up is tools/workspace.py; every target below calls it first, and a finished set-up is recognised in a second.
# `make setup PYTHON=python3.12` makes the environment of that Python; later calls keep it, whatever python3 is.
PYTHON ?= python3
RUN := .venv/bin/ros-run
# Compiled modules are kept, whatever the environment says: the tests start a thousand processes.
unexport PYTHONDONTWRITEBYTECODE
# Tests that run against the clock mostly wait, but a crowd of them would disturb one another. One that fails in the crowd
# runs once more with nothing beside it, and both results are printed; it fails if it fails alone.
TEST_JOBS ?= 3
REALTIME_JOBS ?= 3
BENCHMARK_JOBS ?= 2
TESTS := $(RUN) python -m pytest --dist loadfile
# In the order of conftest.py: the files with the longest tests begin early, those with the most tests need not.
CLOCKED := $(TESTS) --no-loadscope-reorder
ALONE = { echo 'Tests against the clock failed beside others; they run again, alone:'; \
	$(RUN) python -m pytest -m "$(1)" --last-failed --last-failed-no-failures none; }
# Public recordings for evaluation, if they lie beside the repository or where the user says.
export TEXTURE_DATA ?= $(wildcard $(abspath ../shared/data))

.PHONY: setup demo test test-pure test-benchmarks lint benchmark peers docs clean

# The Python that is asked for comes first; a name on the path that does not run, such as the shim of a version manager, is passed over.
setup:
	@for python in $(PYTHON) python3 python3.13 python3.12 python3.11 python3.10; do \
		if $$python -c '' 2> /dev/null; then \
			[ "$$python" = "$(PYTHON)" ] || echo "set-up: $(PYTHON) does not run here; trying $$python"; \
			exec $$python tools/workspace.py $(if $(filter file,$(origin PYTHON)),,--python); \
		fi; \
	done; echo 'set-up: no Python runs here; install one from 3.10 to 3.13 (on Debian and Ubuntu: python3-venv python3-dev)' >&2; exit 2

demo: setup
	@.venv/bin/texture demo --out out/demo

lint: setup
	@$(RUN) ruff check .
	@$(RUN) ruff format --check . || { echo 'to format all files: $(RUN) ruff format .'; exit 1; }
	@echo 'lint: types'
	@$(RUN) mypy
	@echo 'lint: figures of the pages, a minute or more'
	@$(RUN) python tools/figures.py --check
	@$(RUN) python tools/words.py > /dev/null || $(RUN) python tools/words.py

# The checks run beside the tests that need no clock: most of them use one core.
test: setup
	@$(MAKE) --no-print-directory -j 2 lint test-pure
	@$(CLOCKED) -n $(REALTIME_JOBS) -m "realtime and not benchmark" || $(call ALONE,realtime and not benchmark)

test-pure: setup
	@$(TESTS) -n $(TEST_JOBS) -m "not realtime and not benchmark" --doctest-modules

# Benchmarks and experiments in reduced size, endurance, pages whose every line is run, and large files.
test-benchmarks: setup
	@$(TESTS) -n $(BENCHMARK_JOBS) -m "benchmark and not realtime"
	@$(CLOCKED) -n $(BENCHMARK_JOBS) -m "benchmark and realtime" || $(call ALONE,benchmark and realtime)

# Those that take minutes and explain how well and how fast surfaces are recognised.
BENCHMARKS := latency papers learning

benchmark: setup
	@failed=; for name in $(BENCHMARKS); do .venv/bin/texture benchmark $$name || failed="$$failed $$name"; done; \
		test -z "$$failed" || { echo "failed:$$failed"; exit 1; }

# General classifiers of time series, in packages of their own, on the slides on which the recipes are compared.
peers: setup
	@test -d out/peers || .venv/bin/python -m venv out/peers
	@out/peers/bin/pip install --quiet aeon torch
	@TEXTURE_PEERS=$$(out/peers/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))') \
		sh -c '.venv/bin/texture benchmark overview && .venv/bin/texture benchmark generalisation'

docs: setup
	@$(RUN) python docs/build.py out/site

clean:
	rm -rf .venv build install log out .mypy_cache .ruff_cache .pytest_cache
