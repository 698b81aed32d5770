# Every target sets up .venv by itself when it is missing or older than its requirements, with what
# the target needs: the harness, or everything.
# Results go to results/mine, or to RESULTS_DIR; the committed ones in results/reference are read.
#
# PYTHON is the first of these that starts and is new enough. `make PYTHON=…` names another one.
PYTHONS := python3.11 python3.12 python3.13 python3
FITS := -c 'import sys; sys.exit(sys.version_info < (3, 11))'
PYTHON ?= $(shell for name in $(PYTHONS); do $$name $(FITS) 2>/dev/null && echo $$name && break; done)
BIN := .venv/bin
# Modules are compiled as they are imported: the first table is there sooner.
INSTALL := $(BIN)/pip install --quiet --no-compile --disable-pip-version-check -c constraints.txt -e
HARNESS := .venv/.harness
VENV := .venv/.everything

.PHONY: help table1 test slow lint benchmark stability report reproduce reference docs mutants

help:  ## show this list
	@grep -hE '^[a-z0-9]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

$(HARNESS): pyproject.toml constraints.txt
	$(if $(PYTHON),,$(error Python: expected 3.11 or newer, found none of $(PYTHONS); name one: make PYTHON=/path/to/python))
	$(PYTHON) -m venv --clear .venv
	$(INSTALL) '.[harness]'
	@touch $@

$(VENV): $(HARNESS)
	$(INSTALL) '.[harness,test,compiled,peers,cluster]'
	@touch $@

table1: $(HARNESS)  ## run HDC and the baselines on the simulated touch scene, show Table I
	$(BIN)/python -m experiments.table1

benchmark: $(VENV)  ## time every route of the classifier beside its peers
	$(BIN)/python -m tests.benchmark

stability: $(VENV)  ## numbers at their limits, training as a stiff problem, what each scene loads
	$(BIN)/python -m experiments.run experiment=stability
	$(BIN)/python -m experiments.run experiment=numerics
	$(BIN)/python -m experiments.run experiment=stiffness
	$(BIN)/python -m experiments.run experiment=footprint
	$(BIN)/python -m experiments.report

report: $(HARNESS)  ## tables, figures and the page from own results and the reference
	$(BIN)/python -m experiments.report

reproduce: $(VENV)  ## everything again, into results/mine (hours; QUICK=1: fewer seeds; CLAIM=name: of one claim; LIST=1: the steps alone)
	$(BIN)/python -m experiments.reproduce $(if $(QUICK),--quick) $(if $(CLAIM),--claim $(CLAIM)) $(if $(LIST),--list)

reference: reproduce  ## for maintainers: the reproduction becomes results/reference
	$(BIN)/python -m experiments.reference

docs: $(VENV)  ## the documentation, into site/; any warning stops it
	$(BIN)/python -m sphinx -q -W --keep-going -b html -d site/.doctrees docs site/html

slow: $(VENV)  ## the tests that are marked slow
	$(BIN)/pytest -m slow

# One of ten: those with a number that ends in 0. One thread, for a process that was forked has no others.
mutants: $(VENV)  ## weigh the tests: change the code line by line, count what they notice (40 minutes)
	$(INSTALL) '.[mutation]'
	OMP_NUM_THREADS=1 OMP_THREAD_LIMIT=1 $(BIN)/mutmut run --max-children 2 '*0'
	$(BIN)/mutmut results

test: $(VENV)  ## every test but the slow ones, as many at a time as there are cores
	OMP_NUM_THREADS=1 $(BIN)/pytest -n auto -m "not slow"

lint: $(VENV)  ## ruff, mypy, and the direction of imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
