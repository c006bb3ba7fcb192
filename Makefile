# Everything a user or contributor runs; needs only Python (3.11+), git and make.
PYTHON ?= python3
BIN := .venv/bin

# One worker more than processors: some wait for a browser, or for a process they started. Every
# worker computes with one thread of BLAS: with more, they wait for each other. Workers begin
# with neighbouring tests, which share shapes, and Python keeps what it compiles, for all of them.
WORKERS = $(shell $(BIN)/python -c "from unbend._parallel import n_cores; print(n_cores() + 1)")
PYTEST = PYTHONDONTWRITEBYTECODE= OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n $(WORKERS) --dist worksteal

.PHONY: app demo reproduce quick test test-tools test-kernels coverage test-browser browser test-portable test-matrix test-blender fuzz \
	mutants lint format bench docs blender clean

demo: .venv/plot.stamp ## shapes in several poses, their canonical forms, and a picture of both
	$(BIN)/unbend demo

app: .venv/app.stamp ## a window in the browser; ARGS="FILES" to begin with
	$(BIN)/unbend app $(ARGS)

reproduce: .venv/test.stamp ## the paper's experiments, into reproduction/; ARGS="--quick", ARGS="table1 --data DIR"
	$(BIN)/python -m paper $(ARGS)

# What most changes could break, without what runs commands, computes for long, or tests tests.
QUICK := $(addprefix tests/,alignment canonical correspondence deformation distances io linalg mesh \
	preparation spectral test_api.py test_arrays.py test_layout.py)

quick: .venv/test.stamp ## the numerics and the readers, in less than a minute; no lint
	$(PYTEST) $(QUICK)

# What is not of the package: the paper's experiments, benchmarks, their shapes, fuzzing, endurance.
TOOLS := paper testshapes $(addprefix tests/,paper testshapes test_benchmarks.py \
	test_match_benchmark.py test_endurance.py test_fuzz.py)

test: .venv/test.stamp ## the package: lint, types, tests, doctests
	$(MAKE) --jobs=2 lint test-kernels
	$(PYTEST) src tests $(addprefix --ignore=,$(filter tests/%,$(TOOLS)))

test-tools: .venv/test.stamp ## tests of experiments, benchmarks and what makes their shapes
	$(PYTEST) $(TOOLS)

coverage: .venv/test.stamp ## which lines of src the tests run; measuring it takes a third longer
	$(MAKE) test-kernels KERNEL_COVERAGE="--cov --cov-report= --cov-fail-under=0"
	$(PYTEST) --cov --cov-append --cov-report=term

# Only files with kernels are read: many others make shapes, which takes long uncompiled.
KERNELS = $(shell grep -rl mark.kernels tests --include="test_*.py")

test-kernels: .venv/test.stamp ## tests of kernels, uncompiled
	NUMBA_DISABLE_JIT=1 $(PYTEST) -n 0 $(KERNELS) -m kernels $(KERNEL_COVERAGE)

# What rounds differently on another x86 processor: the kernels of OpenBLAS, the loops of NumPy,
# the functions of the C library, and what Numba compiles for. Each run has those of one generation
# of processors; NEWEST_BLAS is one that this processor can run. The first is of all tests, in one
# thread. The others leave out files, the command line, figures and experiments, whose arithmetic is
# the library's; the second gives unbend and BLAS two threads each, the third unbend alone.
NEWEST_BLAS := $(if $(shell grep -w avx512dq /proc/cpuinfo 2>/dev/null),SkylakeX,Sandybridge)
ARITHMETIC := $(addprefix --ignore=tests/,app cli io report paper test_benchmarks.py)

test-portable: .venv/test.stamp ## the tests again under what rounds differently on other processors
	OPENBLAS_CORETYPE=Nehalem OMP_NUM_THREADS=1 \
	NPY_DISABLE_CPU_FEATURES="X86_V3 X86_V4 AVX512_ICL AVX512_SPR" \
	GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2,-FMA \
	NUMBA_CPU_NAME=generic NUMBA_CPU_FEATURES= NUMBA_CACHE_DIR=$(CURDIR)/.venv/numba-generic \
	$(PYTEST)
	OPENBLAS_CORETYPE=Haswell OMP_NUM_THREADS=2 OPENBLAS_THREAD_TIMEOUT=4 \
	NPY_DISABLE_CPU_FEATURES="X86_V4 AVX512_ICL AVX512_SPR" \
	$(BIN)/pytest -n 1 $(ARITHMETIC)
	OPENBLAS_CORETYPE=$(NEWEST_BLAS) OMP_NUM_THREADS=2 $(PYTEST) $(ARITHMETIC)

test-browser: .venv/test.stamp browser ## the pages in Chromium; what they look like is kept in screenshots/
	UNBEND_BROWSER_NEEDED=1 UNBEND_SCREENSHOTS=$(CURDIR)/screenshots \
	$(BIN)/pytest tests/report/pages/test_browser*.py tests/app/test_browser_app.py

CHROMIUM = $(UNBEND_BROWSER) $(shell command -v chromium chromium-browser google-chrome google-chrome-stable)

browser: ## installs Chromium where there is none and we may
	@test -n "$(strip $(CHROMIUM))" || { test "$$(id -u)" = 0 && command -v apt-get >/dev/null \
	&& timeout 300 sh -c "apt-get update -qq && apt-get install -qq -y chromium" >/dev/null; } || { echo \
	"no Chromium was found: install it, or name a browser like it in UNBEND_BROWSER" >&2; exit 1; }

test-matrix: .venv/release.stamp ## what would be released, in empty environments; CASES="--extra none"
	$(BIN)/python release/matrix.py $(CASES)

test-blender: .venv/test.stamp .venv/blender.stamp ## the Blender extension, in Blender's own Python module
	$(BIN)/pytest tests/blender

FUZZ_SECONDS ?= 600

fuzz: .venv/test.stamp .venv/fuzz.stamp ## each family of inputs for FUZZ_SECONDS; what is found is kept in fuzz-finds
	for family in meshes maps values archives shapes; do \
	PYTHONPATH=tests $(BIN)/python -m fuzz $$family --seconds $(FUZZ_SECONDS) || exit 1; done

mutants: .venv/test.stamp ## small errors put into MUTANTS, files below src/unbend: which does no test see?
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.mutants $(MUTANTS)

lint: .venv/test.stamp ## ruff and mypy, changing nothing
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: .venv/test.stamp ## ruff, in place
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: .venv/bench.stamp ## times against other libraries; BENCH=--large adds a million vertices
	$(BIN)/python benchmarks/engine.py $(BENCH)

docs: .venv/docs.stamp ## the documentation site, into docs/_build/html; warnings are errors
	rm -rf docs/api/generated
	$(BIN)/sphinx-build -W --keep-going docs docs/_build/html

blender: .venv/test.stamp ## the Blender extension with its wheels, into dist/; ARGS="--platform macos-arm64 --python 3.13"
	$(BIN)/python release/extension.py $(ARGS)

clean: ## remove the environment, all caches, and the built site
	rm -rf .venv dist .mypy_cache .pytest_cache .ruff_cache .hypothesis .coverage*
	rm -rf docs/_build docs/api/backreferences docs/api/generated docs/commands docs/gallery

.venv/%.stamp: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -e ".[$*]"
	touch $@
