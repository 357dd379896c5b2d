# Everything runs in a virtual environment of its own, made on first use and refreshed when pyproject.toml changes:
# what tests need first, and more for linters, notebooks and documentation when they are called.
PYTHON ?= $(shell for p in python3 python3.11 python3.12 python3.13 python3.14 python; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && echo $$p && break; done)
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
DEV_READY := $(VENV)/.dev-ready
DOCS_READY := $(VENV)/.docs-ready
DEMO_OUT ?= results/demo
# Samplers for the comparison, and for nothing else.
PEERS ?= .peers

export MPLBACKEND ?= Agg
# Bytecode halves the time that a process takes to start, and tests and notebooks start many.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test notebooks test-lowest test-slow bench coverage calibration shapes recognition misspecification streams trust designs efficiency unknowns samplers images docs dist lint clean

demo: $(READY)
	$(BIN)/tactile-bayes demo --out $(DEMO_OUT)

# Each process takes one core, and tests that follow one another stay in one process as far as possible: they share
# what a file of tests prepares.
test notebooks: export OPENBLAS_NUM_THREADS = 1
test notebooks: export NUMBA_NUM_THREADS = 1
test: $(READY)
	$(BIN)/python -m pytest -n auto --dist worksteal --doctest-modules src tests $(TEST_OPTIONS)

notebooks: $(DEV_READY)
	$(BIN)/python -m pytest -n auto --nbmake --nbmake-timeout=1200 notebooks

# With the lowest versions of the dependencies; their warnings about one another are not errors here.
test-lowest: $(READY)
	$(PYTHON) -m venv --clear .venv-lowest
	$(BIN)/python tools/lowest.py > .venv-lowest/lowest.txt
	.venv-lowest/bin/python -m pip install --quiet --upgrade "pip>=25.1"
	.venv-lowest/bin/python -m pip install --quiet --requirement .venv-lowest/lowest.txt --group test --editable .
	NUMBA_CACHE_DIR=.venv-lowest/numba .venv-lowest/bin/python -m pytest -n auto -o filterwarnings=default

test-slow: notebooks
	$(BIN)/python -m pytest -m slow --doctest-modules src tests

bench: $(READY)
	$(BIN)/python -m benchmarks

coverage: $(READY)
	$(BIN)/python -m benchmarks.contacts

calibration: $(READY)
	$(BIN)/python -m benchmarks.calibration

shapes: $(READY)
	$(BIN)/python -m benchmarks.shapes

recognition: $(READY)
	$(BIN)/python -m benchmarks.recognition

misspecification: $(READY)
	$(BIN)/python -m benchmarks.misspecification

streams: $(READY)
	$(BIN)/python -m benchmarks.stream

trust: $(READY)
	$(BIN)/python -m benchmarks.trust

designs: $(READY)
	$(BIN)/python -m benchmarks.design

efficiency: $(READY)
	$(BIN)/python -m benchmarks.efficiency

unknowns: $(READY)
	$(BIN)/python -m benchmarks.unknowns

samplers: $(READY)
	$(BIN)/python -m pip install --quiet --target $(PEERS) --upgrade --no-deps \
		pints tabulate zeus-mcmc tqdm seaborn scikit-learn joblib
	PYTHONPATH=$(PEERS) $(BIN)/python -m benchmarks.samplers

images: $(READY)
	$(BIN)/python docs/images.py

docs: $(DOCS_READY)
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet -b html docs docs/_build/html
	@echo "The documentation begins at $(CURDIR)/docs/_build/html/index.html"

dist: $(READY)
	$(BIN)/python -m build --outdir dist
	$(BIN)/python -m twine check --strict dist/*

lint: $(DEV_READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

clean:
	rm -rf $(VENV) .venv-lowest results dist docs/_build .pytest_cache .mypy_cache .ruff_cache

$(READY): pyproject.toml
	@test -n "$(PYTHON)" || { echo "tactile_bayes needs Python 3.11 or later: none found. Name one with: make PYTHON=/path/to/python ..." >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --no-compile --editable . --group test
	touch $@

$(DEV_READY): $(READY)
	$(BIN)/python -m pip install --quiet --no-compile --group dev
	touch $@

$(DOCS_READY): $(READY)
	$(BIN)/python -m pip install --quiet --no-compile --group docs
	touch $@
