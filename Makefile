# Every verb makes its own environment first: Python 3.11 or newer, make and a network for pip are enough.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
DOCS_VENV ?= .venv-docs
DOCS_READY := $(DOCS_VENV)/.ready
OUT ?= out/demo
JOBS ?= 2
TESTS ?=
COUNT ?= 100
SEED ?= 0
FUZZ ?= 20000
CALLS ?= 1600
SOURCE ?=

.PHONY: demo test test-slow lint types bench coverage mutants fuzz fuzz-calls docs dist clean help
.DEFAULT_GOAL := help

help:            ## the verbs
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 14

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "intervis needs Python 3.11 or newer; set PYTHON=/path/to/python3.11")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-input -c constraints.txt -e '.[dev]'
	@touch $@

demo: $(READY)   ## the main job on the built-in world: tables, pictures and a page
	$(BIN)/intervis demo --out $(OUT)

test: lint types $(READY)   ## lint, types, tests, doctests
	$(BIN)/python -m pytest -n $(JOBS) -m 'not slow'

test-slow: $(READY)   ## the slow cases
	$(BIN)/python -m pytest -n $(JOBS) -m slow

lint: $(READY)   ## ruff
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)   ## mypy, strict on the package
	$(BIN)/mypy

coverage: $(READY)  ## lines and branches that the tests run; TESTS="tests/method ..." for some of them
	$(BIN)/python -m pytest -n $(JOBS) -m 'not slow' --cov --cov-report=term --cov-report=html:out/coverage/html $(TESTS)

mutants: $(READY) ## how many of COUNT small changes of the code the tests notice; goes on where it stopped
	$(BIN)/python tools/mutants.py --count $(COUNT) --seed $(SEED) --jobs $(JOBS)

fuzz: $(READY)    ## changed files for every reader: each is read, or refused in one sentence
	$(BIN)/python tools/fuzz_readers.py --count $(FUZZ) --seed $(SEED) --jobs $(JOBS)

fuzz-calls: $(READY)  ## odd arguments for every public call: each is answered, or refused in one sentence
	$(BIN)/python tools/fuzz_calls.py --count $(CALLS) --seed $(SEED) --jobs $(JOBS)

bench: $(READY)   ## our times beside those of other tools; SOURCE=drive for a real one
	$(BIN)/intervis bench $(SOURCE) --json out/bench.json

# An environment of its own: the tests need no Sphinx.
$(DOCS_READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "intervis needs Python 3.11 or newer; set PYTHON=/path/to/python3.11")'
	$(PYTHON) -m venv $(DOCS_VENV)
	$(DOCS_VENV)/bin/python -m pip install --quiet --disable-pip-version-check --no-input -c constraints.txt -e '.[docs]'
	@touch $@

docs: $(DOCS_READY) ## the documentation site, in out/site; warnings are errors
	$(DOCS_VENV)/bin/python -m sphinx -W --keep-going -n -q -c tools/docs_site docs out/site
	@echo out/site/index.html

dist: $(READY)   ## source distribution and wheel, in dist/
	rm -rf dist
	$(BIN)/python -m build

clean:           ## the environment and everything made
	rm -rf $(VENV) $(DOCS_VENV) out build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
