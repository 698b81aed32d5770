# Every target first sets up .venv, if it is missing or older than its requirements, with the packages
# that the target needs: the harness, or everything.
# Your results go to results/mine, or to the folder RESULTS_DIR; results/reference has the committed ones.
#
# PYTHON is the first of these that starts and is new enough. `make PYTHON=…` names another one.
PYTHONS := python3.11 python3.12 python3.13 python3
FITS := -c 'import sys; sys.exit(sys.version_info < (3, 11))'
PYTHON ?= $(shell for name in $(PYTHONS); do $$name $(FITS) 2>/dev/null && echo $$name && break; done)
BIN := .venv/bin
# Modules are compiled when they are imported, so that the first table is there sooner.
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

table1: $(HARNESS)  ## train HDC, softmax and networks on simulated touches, show Table I (4 minutes)
	$(BIN)/python -m experiments.table1

benchmark: $(VENV)  ## time each step of the classifier and of other libraries
	$(BIN)/python -m tests.benchmark

stability: $(VENV)  ## test extreme inputs, stiff training, and what each scene loads
	$(BIN)/python -m experiments.run experiment=stability
	$(BIN)/python -m experiments.run experiment=stiffness
	$(BIN)/python -m experiments.run experiment=footprint
	$(BIN)/python -m experiments.report

report: $(HARNESS)  ## write tables, figures and a page of your results and the reference
	$(BIN)/python -m experiments.report

reproduce: $(VENV)  ## measure everything again (hours; QUICK=1: in small; CLAIM=NAME: one claim; LIST=1: list the steps)
	$(BIN)/python -m experiments.reproduce $(if $(QUICK),--quick) $(if $(CLAIM),--claim $(CLAIM)) $(if $(LIST),--list)

reference: reproduce  ## for maintainers: reproduce, and make the results the committed reference (hours)
	$(BIN)/python -m experiments.reference

docs: $(VENV)  ## build the documentation into site/; any warning is an error
	$(BIN)/python -m sphinx -q -W --keep-going -b html -d site/.doctrees docs site/html

slow: $(VENV)  ## run the tests that are marked slow
	$(BIN)/pytest -m slow

# On one thread, because a forked process has no other.
mutants: $(VENV)  ## test the tests: make 300 small changes of the code, count those that a test notices (40 minutes)
	$(INSTALL) '.[mutation]'
	OMP_NUM_THREADS=1 OMP_THREAD_LIMIT=1 $(BIN)/python -m tests.mutants

test: $(VENV)  ## run every test but the slow ones, on all cores
	OMP_NUM_THREADS=1 $(BIN)/pytest -n auto -m "not slow"

lint: $(VENV)  ## run ruff, mypy and the check of imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
