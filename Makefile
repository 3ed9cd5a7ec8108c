# hrg: everything sets itself up in .venv; bare `make` prints this help.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
JOBS ?= 2
TRIALS ?= 20000
FAILURES ?= 200
KILLS ?= 500
GIGABYTES ?= 2
GYROS ?= 2000
PROGRAMMES := PYTHONPATH="$(CURDIR)/tests:$(CURDIR)/tests/helpers:$(CURDIR)/benchmarks" $(BIN)/python -m
READY := $(VENV)/.ready
INSTALLED := $(VENV)/.installed

export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: help run test test-browser study faults mutants bench lint sample-data docs build clean

help:  ## Print this help
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/  make \1\t\2/' | expand -t 22

$(INSTALLED): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet -e '.[all]'
	@touch $@

$(READY): $(INSTALLED)
	$(BIN)/python -m pip install --quiet -e '.[dev]'
	@touch $@

run: $(INSTALLED)  ## Demonstrate: a gyro with two hidden faults, free and forced, through the whole chain; results in build/run
	PATH="$(CURDIR)/$(BIN):$$PATH" bash configs/run_chain.sh build/run

test: $(READY)  ## Run the tests (quick samples of the long studies included)
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m "not slow and not browser" tests

test-browser: $(READY)  ## Test the report page in Debian's chromium (installed where it is missing)
	{ command -v chromium && command -v chromedriver; } >/dev/null || (apt-get update -qq && apt-get install -y -qq chromium chromium-driver >/dev/null)
	CI=1 $(BIN)/python -m pytest -m browser tests

study: $(READY)  ## Run the long statistical studies
	$(BIN)/python -m pytest -n $(JOBS) -m slow tests

faults: $(READY)  ## Damaged inputs, failing calls, kills and large inputs over all commands (TRIALS, FAILURES, KILLS, GIGABYTES, GYROS, HRG_TEST_SEED; PAGE=docs/FAULTS.md keeps the figures)
	$(PROGRAMMES) robustness.faults --trials $(TRIALS) --failures $(FAILURES) --kills $(KILLS)
	$(PROGRAMMES) robustness.sizes --gigabytes $(GIGABYTES) --gyros $(GYROS)
	HRG_TEST_SEED=$${HRG_TEST_SEED:-$$(date +%s)} $(BIN)/python -m pytest -n $(JOBS) -m hypothesis tests
	$(PROGRAMMES) robustness.page $(PAGE)

mutants: $(READY)  ## Change the code on purpose and count the changes that no test sees (ONLY=part of a file's name, RESUME=1, PAGE)
	$(PROGRAMMES) mutants.run $(if $(ONLY),--only $(ONLY)) $(if $(RESUME),--resume)
	$(PROGRAMMES) robustness.page $(PAGE)

bench: $(READY)  ## Measure speed and accuracy now, as one page (PAGE=docs/BENCHMARKS.md keeps it)
	$(BIN)/python benchmarks/page.py $(PAGE)

lint: $(READY)  ## ruff and mypy
	$(BIN)/ruff check .
	$(BIN)/mypy

sample-data: $(READY)  ## Make sample_data/ again from configs/
	PATH="$(CURDIR)/$(BIN):$$PATH" bash configs/make_sample_data.sh

docs: $(READY)  ## Build the documentation as a site into build/site; warnings are errors
	$(BIN)/python -m pip install --quiet -e '.[docs]'
	$(BIN)/python -m docs.handbook README.md docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

build: $(READY)  ## Build wheel and sdist into dist/
	$(BIN)/python -m pip install --quiet build
	$(BIN)/python -m build --outdir dist .

clean:  ## Remove everything that make has made
	rm -rf $(VENV) build dist *.egg-info
