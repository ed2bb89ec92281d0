.DEFAULT_GOAL := help
PYTHON ?= python3.11
BIN := .venv/bin
export DVC_NO_ANALYTICS := 1

help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-14s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: .venv/.ready ## make the environment (.venv) from pinned versions; nothing the second time

.venv/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt "torch==2.13.0"
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt ".[dev,slurm]"
	@rm -rf build *.egg-info
	@touch $@

test: setup ## the tests (under 12 minutes on 2 cores)
	$(BIN)/python -m pytest -m "not long and not slurm and not browser"

test-long: setup ## the long tests: many kills, long resumes
	$(BIN)/python -m pytest -m long

check: setup ## ruff, mypy and the fast tests
	$(BIN)/ruff check . && $(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -m "not long and not slurm and not browser" tests --ignore=tests/end_to_end

.PHONY: help setup test test-long check
