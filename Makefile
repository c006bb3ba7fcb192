# Everything a user or contributor runs; needs only Python (3.11+), git and make.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo test lint format bench clean

demo: .venv/plot.stamp ## shapes in several poses, their canonical forms, and a picture of both
	$(BIN)/unbend demo

test: .venv/test.stamp lint ## the whole suite: lint, types, tests, doctests, coverage
	NUMBA_DISABLE_JIT=1 $(BIN)/pytest tests -m kernels -n auto --cov --cov-report= --cov-fail-under=0
	$(BIN)/pytest -n auto --cov --cov-append --cov-report=term

lint: .venv/test.stamp ## ruff and mypy, changing nothing
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: .venv/test.stamp ## ruff, in place
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: .venv/bench.stamp ## times against other libraries; BENCH=--large adds a million vertices
	$(BIN)/python benchmarks/engine.py $(BENCH)

clean: ## remove the environment and all caches
	rm -rf .venv .mypy_cache .pytest_cache .ruff_cache .hypothesis .coverage*

.venv/%.stamp: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[$*]"
	touch $@
