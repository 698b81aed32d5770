# Every target sets up .venv by itself when it is missing or older than its requirements.
PYTHON ?= python3.11
BIN := .venv/bin
VENV := .venv/.stamp

.PHONY: help table1 test lint benchmark reproduce clean

help:  ## show this list
	@grep -hE '^[a-z0-9]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

$(VENV): pyproject.toml constraints.txt
	$(PYTHON) -m venv --clear .venv
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test,peers,cluster]'
	@touch $@

lint: $(VENV)  ## ruff and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

test: $(VENV)  ## every test that is not marked slow
	$(BIN)/pytest -m "not slow"
