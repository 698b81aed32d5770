# Every target sets up .venv by itself when it is missing or older than its requirements.
PYTHON ?= python3.11
BIN := .venv/bin
VENV := .venv/.stamp

.PHONY: help table1 test slow lint benchmark stability reproduce

help:  ## show this list
	@grep -hE '^[a-z0-9]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

$(VENV): pyproject.toml constraints.txt
	$(PYTHON) -m venv --clear .venv
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test,compiled,peers,cluster]'
	@touch $@

# Into a folder of its own: numbers of this machine must not mix with the committed ones.
table1: $(VENV)  ## run HDC and the baselines on the simulated touch scene, show Table I
	RESULTS_DIR=results/mine $(BIN)/python -m experiments.run experiment=table1
	RESULTS_DIR=results/mine $(BIN)/python -m experiments.report

benchmark: $(VENV)  ## time every route of the classifier beside its peers
	$(BIN)/python -m experiments.run experiment=benchmark

stability: $(VENV)  ## numbers at their limits, training as a stiff problem, what each scene loads
	$(BIN)/python -m experiments.run experiment=stability
	$(BIN)/python -m experiments.run experiment=numerics
	$(BIN)/python -m experiments.run experiment=stiffness
	$(BIN)/python -m experiments.run experiment=softmax_methods
	$(BIN)/python -m experiments.run experiment=footprint
	$(BIN)/python -m experiments.report

reproduce: $(VENV)  ## everything that lies in results/ (hours; QUICK=1: fewer seeds)
	$(BIN)/python -m experiments.reproduce $(if $(QUICK),--quick)
	$(BIN)/python -m experiments.readme

slow: $(VENV)  ## the tests that are marked slow
	$(BIN)/pytest -m slow

test: $(VENV)  ## every test but the slow ones
	$(BIN)/pytest -m "not slow"

lint: $(VENV)  ## ruff and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
