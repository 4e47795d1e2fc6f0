# Two commands need nothing but Python >= 3.11, cargo and make: `make demo` and `make test`.
# Each prepares a virtual environment of its own under .venv; the second time that costs nothing.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt
RUST_SOURCES := Cargo.toml Cargo.lock $(shell find crates -name '*.rs' -o -name Cargo.toml)
# A build is for the machine it stands on; MRWORK_BUILD_SETS=all builds every instruction set, and MRWORK_BUILD_SETS=avx2
# that one (crates/mrwork-dynamics/build.rs). A build for other sets than the last one is a new build.
SETS := $(VENV)/.sets-$(or $(MRWORK_BUILD_SETS),of-this-machine)
# The virtual environment is chosen here, whatever else is active in the shell.
export VIRTUAL_ENV := $(abspath $(VENV))
unexport CONDA_PREFIX
# Compiled Python files are kept: a hundred tests start a process, which would compile the package anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test quick sentences faults lint format bench docs docs-check dist licences clean

demo: $(VENV)/.built
	$(BIN)/mrwork identify synthetic:spencer1997 --out out/demo

test: $(VENV)/.built $(VENV)/.dev
	cargo test --quiet --release --workspace
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal

# After a change of wording: `tests/sentences.toml` anew, to be read as a diff.
sentences: $(VENV)/.built $(VENV)/.dev
	MRWORK_TESTS=all MRWORK_SENTENCES=write $(BIN)/python -m pytest

# What a user may do wrong, in the long form: planted faults, every property twenty times.
faults: $(VENV)/.built $(VENV)/.dev
	for each in motions rigs studies; do $(BIN)/python -m tools.faults.planted $$each || exit; done
	MRWORK_EXAMPLES=20 $(BIN)/python -m pytest --numprocesses 2 --dist worksteal -m hypothesis tests

lint: $(VENV)/.built $(VENV)/.dev
	cargo fmt --check
	cargo clippy --quiet --release --workspace --all-targets -- -D warnings
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy
	$(BIN)/basedpyright
	$(BIN)/lint-imports
	cd python && MYPYPATH=. ../$(BIN)/stubtest --mypy-config-file ../.ci/stubtest.toml mrwork._rust

format: $(VENV)/.dev
	cargo fmt
	$(BIN)/ruff format
	$(BIN)/ruff check --fix

bench: $(VENV)/.built $(VENV)/.dev
	$(BIN)/python studies/speed.py kernels
	$(BIN)/python studies/speed.py models

# The pages, and first the code blocks in them and in the README; notebooks and blocks that have not changed are not run again.
docs: $(VENV)/.built $(VENV)/.docs
	$(BIN)/python docs/run_blocks.py
	$(BIN)/python -m sphinx --quiet --fail-on-warning --keep-going --nitpicky --doctree-dir out/docs/trees docs out/docs/html
	@echo "out/docs/html/index.html"

# Links within the pages, pictures without words, and what would be fetched from elsewhere.
docs-check: docs
	$(BIN)/python docs/quoted.py
	$(BIN)/python docs/check.py out/docs/html
	$(BIN)/python docs/searches.py out/docs/html

# A source distribution and a wheel in dist/, checked, and used where there is no Rust, no compiler and no font.
dist: $(VENV)/.dist
	.ci/dist

licences: $(VENV)/.dev $(VENV)/.docs $(VENV)/.dist
	$(BIN)/python .ci/licences.py

clean:
	rm -rf $(VENV) target out dist

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "mrwork needs Python >= 3.11; set PYTHON=")'
	$(PYTHON) -m venv $(VENV)

# The package in editable form: Python files are used where they lie, only Rust changes need a build.
$(VENV)/.installed: pyproject.toml constraints.txt | $(BIN)/python
	$(PIP) maturin
	$(PIP) --no-build-isolation --editable .
	touch $@

$(SETS): | $(BIN)/python
	rm -f $(VENV)/.sets-*
	touch $@

$(VENV)/.built: $(VENV)/.installed $(SETS) $(RUST_SOURCES)
	$(BIN)/maturin develop --quiet --release --skip-install
	touch $@

# For work on the crate: the first build takes as long as any, then a change of one file a third of the time or less; the
# module is up to a quarter slower.
quick: $(VENV)/.installed
	$(BIN)/maturin develop --quiet --profile quick --skip-install

$(VENV)/.dev: pyproject.toml constraints.txt | $(VENV)/.installed
	$(PIP) --no-build-isolation --editable '.[dev]'
	touch $@

$(VENV)/.docs: pyproject.toml constraints.txt | $(VENV)/.installed
	$(PIP) --no-build-isolation --editable '.[docs]'
	touch $@

$(VENV)/.dist: pyproject.toml constraints.txt | $(VENV)/.installed
	$(PIP) --no-build-isolation --editable '.[dist]'
	touch $@
