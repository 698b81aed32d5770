# Every target sets up .venv by itself when it is missing or older than its requirements.
PYTHON ?= python3.11
BIN := .venv/bin
VENV := .venv/.stamp

.PHONY: help table1 test lint benchmark reproduce

help:  ## show this list
	@grep -hE '^[a-z0-9]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

$(VENV): pyproject.toml constraints.txt
	$(PYTHON) -m venv --clear .venv
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test,peers,cluster]'
	@touch $@

table1: $(VENV)  ## run HDC and the baselines on the simulated touch scene, show Table I
	$(BIN)/python -m experiments.run experiment=table1
	$(BIN)/python -m experiments.report

benchmark: $(VENV)  ## time every route of the classifier beside its peers
	$(BIN)/python -m experiments.run experiment=benchmark

reproduce: $(VENV)  ## everything that lies in results/, slow tests included (hours: the CNNs dominate)
	$(BIN)/python -m experiments.run experiment=benchmark
	$(BIN)/python -m scenes.sensor.check
	$(BIN)/python -m scenes.sensor.calibrate
	$(BIN)/python -m scenes.sensor.pictures
	$(BIN)/python -m experiments.run experiment=table1 stop=paper model=hdc,softmax seed.run=0,1,2,3,4
	$(BIN)/python -m experiments.run experiment=table1 stop=paper model=cnn1,cnn3 seed.run=0,1,2
	$(BIN)/python -m experiments.run experiment=table1_extended
	$(BIN)/python -m experiments.run experiment=accuracy_vs_n
	$(BIN)/python -m experiments.run experiment=accuracy_vs_n_cnn
	$(BIN)/python -m experiments.run experiment=accuracy_vs_d
	$(BIN)/python -m experiments.run experiment=work_precision
	$(BIN)/python -m experiments.report
	$(BIN)/python -m experiments.readme
	$(BIN)/pytest -m slow

test: $(VENV)  ## every test that is not marked slow
	$(BIN)/pytest -m "not slow"

lint: $(VENV)  ## ruff and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
