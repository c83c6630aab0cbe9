# Everything runs in a virtual environment that is made when it is first needed.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
# Names of what pip fetches; its failures are not hidden by the pipe.
FETCHED := sed -un 's/^ *Downloading \(.*\)/  fetching \1/p; s/^Installing collected.*/  installing/p'
SHELL := bash
# Compiled modules and rewritten tests are kept, whatever the caller's environment says.
unexport PYTHONDONTWRITEBYTECODE
.SHELLFLAGS := -o pipefail -c
# Files in their order: the long ones would come last where those of most tests come first.
PARALLEL ?= --numprocesses auto --dist loadfile --no-loadscope-reorder

.PHONY: demo test test-slow lint docs package notebooks bench robots browser pinocchio-casadi clean

demo: $(READY)  ## analyse the bundled recording; results go to geodesic_ocp_demo/
	$(BIN)/geodesic-ocp demo

# There is a process for every core: linear algebra in threads would compete with them.
test test-slow: export OPENBLAS_NUM_THREADS ?= 1

test: $(READY)  ## the test suite, without its slow part
	$(BIN)/python -m pytest $(PARALLEL) -m "not slow"

test-slow: $(READY)  ## the slow part of the test suite
	$(BIN)/python -m pytest $(PARALLEL) -m slow

lint: $(READY)  ## style and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(VENV)/.docs  ## the documentation site, into docs/_build/html; warnings and dead links are errors
	$(BIN)/python -m sphinx -q -E -W --keep-going -b html docs docs/_build/html
	$(BIN)/python docs/check_links.py docs/_build/html

package: $(READY)  ## wheel and source distribution, into dist/, checked
	rm -rf dist
	$(BIN)/python -m build --quiet --outdir dist .
	$(BIN)/python -m twine check --strict dist/*

notebooks: $(READY)  ## execute the notebooks, keeping their output
	$(BIN)/jupyter-execute --inplace notebooks/*.ipynb

bench: $(READY)  ## speed and accuracy next to other solvers, into benchmarks/results/; ARGS=--quick
	$(BIN)/python benchmarks/run.py $(ARGS)

robots: $(VENV)/.robots  ## descriptions of robots, 190 MB, for load_model and its tests

browser:  ## a Chromium from the system's packages, in which the viewer's pages are tested
	@for name in "$$GEODESIC_OCP_CHROMIUM" chromium chromium-browser google-chrome; do \
	  command -v "$$name" && exit 0; \
	done; \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium; \
	else \
	  echo "no Chromium: install one (as root: apt-get install chromium), put one into the"; \
	  echo "environment (playwright install chromium), or name one in GEODESIC_OCP_CHROMIUM"; exit 1; \
	fi

pinocchio-casadi: $(READY)  ## build Pinocchio's CasADi interface: half a minute, once; ARGS=--remove
	@$(BIN)/python -m geodesic_ocp.model.casadi_interface.build $(ARGS)

clean:  ## remove the environment and caches
	rm -rf $(VENV) .mypy_cache .pytest_cache .ruff_cache .hypothesis dist docs/_build

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; assert sys.version_info >= (3, 10)' 2>/dev/null || \
	  { echo "needs Python 3.10 or later, found: $$($(PYTHON) --version 2>&1); set PYTHON=..."; exit 1; }
	@echo "creating $(VENV) with all dependencies (once, about a minute)"
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --disable-pip-version-check --editable '.[dev]' | $(FETCHED)
	@touch $@

$(VENV)/.docs $(VENV)/.robots: $(VENV)/.%: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[$*]'
	@touch $@
