# Each target sets up what it needs; `make` alone lists the targets.
PYTHON ?= python3
VENV ?= .venv
RUN := $(VENV)/bin/python

.PHONY: help simulate fmus test check clean

help:
	@echo "make simulate   run all estimators on all cases, results in results/simulate"
	@echo "make fmus       build the FMUs from modelica/ (Modelica compiler, C cross-compiler)"
	@echo "make test       format, lint, types, import layers, FMUs against sources, tests"
	@echo "make clean      remove the environment and results"

$(VENV)/run.stamp: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(RUN) -m pip install --quiet --constraint constraints.txt --editable .
	@touch $@

$(VENV)/dev.stamp: $(VENV)/run.stamp
	$(RUN) -m pip install --quiet --constraint constraints.txt --editable ".[dev,compiler]"
	@touch $@

simulate: $(VENV)/run.stamp
	$(RUN) -m workbench simulate --out results/simulate

fmus: $(VENV)/dev.stamp
	$(RUN) -m workbench fmu build --all

test: $(VENV)/dev.stamp
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/ruff check .
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports
	$(RUN) -m workbench fmu build --all --check
	$(RUN) -m pytest

clean:
	rm -rf $(VENV) results
