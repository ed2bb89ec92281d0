.DEFAULT_GOAL := help
BIN := .venv/bin
export DVC_NO_ANALYTICS := 1

# The environment that is there goes on to serve; without one, the newest Python that can. PYTHON=python3.12 chooses.
ifndef PYTHON
  PYTHON := $(shell for each in $(BIN)/python python3.13 python3.12 python3.11 python3 python; do \
    $$each tools/suitable.py >/dev/null 2>&1 && echo $$each && break; done)
endif
WANTED := $(shell $(PYTHON) tools/suitable.py 2>/dev/null)
BUILT := $(shell $(BIN)/python -c 'import pip, sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)

help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-14s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: .venv/.ready ## make the environment (.venv) from pinned versions; nothing the second time

.venv/.ready: pyproject.toml constraints.txt $(if $(filter-out $(WANTED),$(BUILT)),another-version)
	@$(if $(PYTHON),$(PYTHON) tools/suitable.py >/dev/null,echo "no Python 3.11, 3.12 or 3.13 with venv was found; install one, or PYTHON=/path/to/python" >&2; exit 2)
	$(if $(filter $(WANTED),$(BUILT)),,$(PYTHON) -m venv --clear .venv)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt "torch==2.13.0"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt ".[dev,slurm,video]"
	@rm -rf build *.egg-info
	$(BIN)/python -m src.engine.compile
	@touch $@

another-version:

demo: setup ## train a small real grid (12 runs of 3,000 steps), write the report, watch one policy
	$(BIN)/python -m src.run sweeps=demo logger=none
	$(BIN)/python -m analysis report results/demo
	$(BIN)/python -m src.watch results/demo/runs/td3/hopper/bptsan/poisson/seed_0

test: setup ## the tests (under 12 minutes on 2 cores)
	$(BIN)/python -m pytest -m "not long and not slurm and not browser and not latex"

test-long: setup ## the long tests: kills and resumes by the dozen
	$(BIN)/python -m pytest -m long

test-browser: setup ## the report in headless Chromium and its article in LaTeX (Debian: chromium, texlive-latex-recommended, texlive-fonts-recommended)
	$(BIN)/python -m pytest -m "browser or latex"

test-slurm: setup ## a real one-node Slurm from Debian's packages (root: installs slurm-wlm and munge where missing)
	command -v sbatch >/dev/null && command -v munged >/dev/null || apt-get install -y --no-install-recommends slurm-wlm munge
	$(BIN)/python -m pytest -m slurm tests/slurm

benchmark: setup ## speed against the floor and against others, on an idle machine (under 15 minutes)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt ".[benchmarks]"
	@rm -rf build *.egg-info
	$(BIN)/python -m benchmarks

check: setup ## ruff and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

test-fast: setup ## the tests but those that train in processes of their own
	$(BIN)/python -m pytest -m "not long and not slurm and not browser and not latex" --ignore=tests/end_to_end

clean: ## remove caches (never results)
	rm -rf .pytest_cache .mypy_cache .ruff_cache .hypothesis build *.egg-info

.PHONY: help setup another-version demo test test-fast test-long test-browser test-slurm benchmark check clean
