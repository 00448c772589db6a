# The set-up is tools/workspace.py; every target below calls it first, and a finished set-up is recognised in a second.
PYTHON ?= python3
RUN := .venv/bin/ros-run
# Tests that run against the clock mostly wait, but a crowd of them would disturb one another. One that fails in the crowd
# runs once more with nothing beside it, and both results are printed; it fails if it fails alone.
TEST_JOBS ?= 2
REALTIME_JOBS ?= 3
# Public recordings for evaluation, if they lie beside the repository or where the user says.
export TEXTURE_DATA ?= $(wildcard $(abspath ../shared/data))

.PHONY: setup demo test lint benchmark docs clean

setup:
	@$(PYTHON) tools/workspace.py

demo: setup
	@.venv/bin/texture demo --out out/demo

lint: setup
	@$(RUN) ruff check .
	@$(RUN) ruff format --check .
	@$(RUN) mypy
	@$(RUN) python tools/check_terms.py
	@$(RUN) python tools/check_docstrings.py

test: setup lint
	@$(RUN) python -m pytest -n $(TEST_JOBS) --dist loadfile -m "not realtime" --doctest-modules
	@$(RUN) python -m pytest -n $(REALTIME_JOBS) --dist loadfile -m realtime || { \
	  echo 'Tests against the clock failed beside others; they run again, alone:'; \
	  $(RUN) python -m pytest -m realtime --last-failed --last-failed-no-failures none; }

benchmark: setup
	@.venv/bin/texture benchmark all

docs: setup
	@$(RUN) python docs/build.py out/site

clean:
	rm -rf .venv build install log out .mypy_cache .ruff_cache .pytest_cache
