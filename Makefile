# Each target sets up what it needs; `make` alone lists the targets.
PYTHON ?= python3
VENV ?= .venv
RUN := $(VENV)/bin/python
# Modelica compiler of `make fmus`: workbench, or omc (OpenModelica, writes to build/omc)
COMPILER ?= workbench

# One more than processors, as tests wait for programs that they start; with two more, what each
# prepares for itself takes longer. The slowest are listed.
WORKERS := $(shell expr 1 + $$(getconf _NPROCESSORS_ONLN))
PYTEST := $(RUN) -m pytest --numprocesses $(WORKERS) --maxprocesses 4 --dist worksteal --durations 10
.PHONY: help simulate tune diagnose power cases fmus bench docs notebooks figures figures-long fuzz chaos test test-long clean

help:
	@echo "make simulate   run all estimators on all cases, results in results/simulate"
	@echo "make tune       find the gains whose worst case is best, results in results/tune"
	@echo "make diagnose   what the observer model lacks in all cases, results in results/diagnose"
	@echo "make power      how often the diagnosis is right, results in results/power; takes hours,"
	@echo "                and again goes on where it was ended"
	@echo "make cases      make the recordings of cases/ anew on the virtual rig, byte for byte"
	@echo "make fmus       build the FMUs from modelica/ (Modelica compiler, C cross-compiler);"
	@echo "                COMPILER=omc: with OpenModelica where it is installed, into build/omc"
	@echo "make bench      time calls into the FMUs against plain C, results in results/bench"
	@echo "make figures    write the tables of docs/ from the commands that make them;"
	@echo "                minutes. make figures-long: those of tuning, next, power and laws, too, hours; with"
	@echo "                RECORDINGS=FOLDER also those of recordings outside of the repository"
	@echo "make notebooks  the tutorials as notebooks, run on the recordings in RECORDINGS=FOLDER"
	@echo "make docs       the documentation as a site for any static host, in build/site; no network"
	@echo "make fuzz       read 100 000 damaged files of every kind, and report by class; minutes"
	@echo "make chaos      kill, interrupt and starve long commands at random moments, resume and compare"
	@echo "make test       format, lint, types, import layers, FMUs against sources, tests"
	@echo "make test-long  the tests that 'make test' leaves out, most diagnoses and claims on"
	@echo "                multibody models; before a release, and by .ci/run"
	@echo "make clean      remove the environment and results"

INSTALL := $(RUN) -m pip install --quiet --constraint constraints.txt --editable

$(VENV)/pyvenv.cfg:
	$(PYTHON) -m venv $(VENV)

$(VENV)/run.stamp: pyproject.toml constraints.txt | $(VENV)/pyvenv.cfg
	$(INSTALL) .
	@touch $@

$(VENV)/dev.stamp: pyproject.toml constraints.txt | $(VENV)/pyvenv.cfg
	$(INSTALL) ".[dev,compiler,cluster,completion,docs,files]"
	@touch $(VENV)/run.stamp $@

simulate: $(VENV)/run.stamp
	$(RUN) -m workbench simulate --out results/simulate

tune: $(VENV)/run.stamp
	# It can answer a wrong radius by friction alone, and gains little by being asked to.
	$(RUN) -m workbench tune parameter_estimator --out results/tune/parameter_estimator
	$(RUN) -m workbench tune disturbance_observer --out results/tune/disturbance_observer

diagnose: $(VENV)/dev.stamp
	$(RUN) -m workbench diagnose --out results/diagnose

power: $(VENV)/dev.stamp
	$(RUN) -m workbench power --resume --out results/power

cases: $(VENV)/run.stamp
	$(RUN) -m workbench rig --seed 1 --truth-every 4 --out cases

fmus: $(VENV)/dev.stamp
	$(RUN) -m workbench fmu build --all --compiler $(COMPILER)

# The tables of docs/, from the commands that make them; hours with those of power.
# RECORDINGS: folder of recordings that are not part of the repository, for the tables of these.
FIGURES := docs/figures.py $(if $(RECORDINGS),--recordings $(RECORDINGS))

figures: $(VENV)/dev.stamp
	$(RUN) $(FIGURES)

figures-long: $(VENV)/dev.stamp
	$(RUN) $(FIGURES) --long

docs: $(VENV)/dev.stamp
	$(RUN) -m mkdocs build --strict

notebooks: $(VENV)/dev.stamp
	$(INSTALL) ".[notebooks]"
	$(RUN) docs/notebooks.py $(or $(RECORDINGS),$(error RECORDINGS is not set; pass the folder of the published recordings))

bench: $(VENV)/dev.stamp
	$(RUN) -m workbench bench --out results/bench

test: $(VENV)/dev.stamp
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/ruff check .
	$(VENV)/bin/lint-imports
	# Types are checked beside the tests, which leave processors free where they wait for programs.
	$(VENV)/bin/mypy & types=$$!; $(PYTEST) -m "not long"; tests=$$?; wait $$types && exit $$tests

test-long: $(VENV)/dev.stamp
	$(PYTEST) -m long

fuzz: $(VENV)/dev.stamp
	$(RUN) -m tests.fuzz --count 100000

chaos: $(VENV)/dev.stamp
	$(RUN) -m tests.chaos --count 200

clean:
	rm -rf $(VENV) build results
