# Each target sets up what it needs; `make` alone lists the targets.
PYTHON ?= python3
VENV ?= .venv
RUN := $(VENV)/bin/python
# Modelica compiler of `make fmus`: workbench, or omc (OpenModelica, writes to build/omc)
COMPILER ?= workbench

.PHONY: help simulate tune fmus bench test check clean

help:
	@echo "make simulate   run all estimators on all cases, results in results/simulate"
	@echo "make tune       find the gains whose worst case is best, results in results/tune"
	@echo "make fmus       build the FMUs from modelica/ (Modelica compiler, C cross-compiler);"
	@echo "                COMPILER=omc: with OpenModelica where it is installed, into build/omc"
	@echo "make bench      time calls into the FMUs against plain C, results in results/bench"
	@echo "make test       format, lint, types, import layers, FMUs against sources, tests"
	@echo "make clean      remove the environment and results"

$(VENV)/run.stamp: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(RUN) -m pip install --quiet --constraint constraints.txt --editable .
	@touch $@

$(VENV)/dev.stamp: $(VENV)/run.stamp
	$(RUN) -m pip install --quiet --constraint constraints.txt --editable ".[dev,compiler,cluster]"
	@touch $@

simulate: $(VENV)/run.stamp
	$(RUN) -m workbench simulate --out results/simulate

tune: $(VENV)/run.stamp
	$(RUN) -m workbench tune parameter_estimator --out results/tune/parameter_estimator
	$(RUN) -m workbench tune disturbance_observer --out results/tune/disturbance_observer

fmus: $(VENV)/dev.stamp
	$(RUN) -m workbench fmu build --all --compiler $(COMPILER)

bench: $(VENV)/dev.stamp
	$(RUN) -m workbench bench --json results/bench/bench.json

test: $(VENV)/dev.stamp
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/ruff check .
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports
	$(RUN) -m workbench fmu build --all --check
	$(RUN) -m pytest

clean:
	rm -rf $(VENV) build results
