# Everything is installed into .venv, at the versions of constraints.txt; Python 3.11 or later, pip and make
# are enough. Stamp files remember what is done: after a change in src/ or pyproject.toml only the wheel is
# built and installed again, after a change in constraints.txt the packages follow.

.SHELLFLAGS := -ec
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

# The first interpreter that runs and is new enough. Another one: make PYTHON=/path/to/python3 ...
PYTHON ?= $(shell for p in python3.11 python3 python3.12 python3.13 python3.14; do \
	if $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then echo $$p; break; fi; done)
WORKERS ?= 2

VENV := .venv
# Where an environment has its programs; the variable is set on Windows alone.
BIN := $(VENV)/$(if $(filter Windows_NT,$(OS)),Scripts,bin)
PIP := $(BIN)/python -m pip --disable-pip-version-check --no-input
INSTALL := $(PIP) install --quiet --progress-bar off

# The environment variable is the one form of constraint that reaches the isolated build of the wheel too;
# since pip 25.3 that build heeds the second variable instead.
export PIP_CONSTRAINT := $(CURDIR)/constraints.txt
export PIP_BUILD_CONSTRAINT := $(PIP_CONSTRAINT)
# A PYTHONPATH from outside could put another chuteflow before the installed one.
unexport PYTHONPATH

# Folders count as well as files, since a file that was removed shows in its folder alone.
SOURCES := $(shell find src -name __pycache__ -prune -o -print 2>/dev/null)
METADATA := pyproject.toml $(wildcard README.md LICENSE)
# Looked up by the shell, not by $(wildcard), which would remember the folder as it was before the build.
WHEEL = $$(echo dist/chuteflow-*.whl)

.PHONY: help demo test test-all lint types unit docs man bench dem-test dem-study wheel dist clean

help: ## show this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' Makefile | expand -t 20

demo: $(VENV)/.compiled ## solve one chute, draw figures 2 and 3 of the paper into demo/
	$(BIN)/chuteflow solve --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6 --flux 3
	$(BIN)/chuteflow figures --only 2,3 --out demo
	@echo "The pictures are in $(CURDIR)/demo:"
	@ls -1 demo

test: lint types unit ## lint, types and the quick tests, against the installed wheel

test-all: lint types $(VENV)/.compiled $(VENV)/.packages-test ## as test, with the slow tests
	$(BIN)/pytest -n $(WORKERS) -m ""

unit: $(VENV)/.compiled $(VENV)/.packages-test ## the quick tests alone
	$(BIN)/pytest -n $(WORKERS) -m "not slow"

# Every system solved is small: more BLAS threads gain nothing, and take the cores from the other test worker.
unit test-all: export OPENBLAS_NUM_THREADS = 1

lint: $(VENV)/.packages-test ## style of the code
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.packages-test ## types of the code
	$(BIN)/basedpyright

docs: $(VENV)/.compiled $(VENV)/.packages-test ## build the documentation into build/docs/, without network
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going docs build/docs
	@echo "The documentation is at $(CURDIR)/build/docs/index.html"

man: $(VENV)/.compiled $(VENV)/.packages-test ## build the manual page build/man/chuteflow.1
	$(BIN)/sphinx-build --quiet -b man -t quick docs build/man

bench: $(VENV)/.compiled $(VENV)/.packages-bench ## time the solver, beside what one would pick instead
	$(BIN)/python benchmarks/run.py

dem-test: $(VENV)/.compiled $(VENV)/.packages-test $(VENV)/.packages-dem ## test simulations of grains with LAMMPS
	$(BIN)/pytest -m "" tests/dem

# What is done is left alone: interrupted or killed, the same command goes on.
dem-study: $(VENV)/.compiled $(VENV)/.packages-dem ## simulate the study of theory against particles; hours
	$(BIN)/chuteflow dem study --out dem-study --data docs/measured/particles
	$(BIN)/chuteflow dem results docs/measured/particles --plot docs/images/particles.png > docs/measured/particles.txt

wheel: dist/.built ## build the wheel into dist/

dist: $(VENV)/.packages-test ## build the source archive and the wheel of a release into dist/, and try both
	rm -rf dist
	$(BIN)/python -m build --outdir dist .
	for file in dist/*; do \
		echo "== trying $$file in an empty environment"; \
		$(PYTHON) -m venv --clear build/empty; \
		build/empty/bin/python -m pip --disable-pip-version-check install --quiet --progress-bar off "$$file"; \
		(cd build && empty/bin/chuteflow solve --slope 0.3 --e 0.8 --ew 0.8 --roughness 0.6 --flux 3); \
	done
	rm -rf build/empty

clean: ## remove the environment and all that was made
	rm -rf $(VENV) dist build demo .hypothesis .pytest_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +

# The folder is emptied first, and through a link that would be somebody else's environment.
$(VENV)/.made:
	@test -n "$(PYTHON)" || { echo "Python 3.11 or later was not found; name one: make PYTHON=..." >&2; exit 1; }
	@test ! -L $(VENV) || { echo "$(VENV) is a link to another environment, which make leaves alone; remove the link" >&2; exit 1; }
	@echo "== creating $(VENV) with $$($(PYTHON) --version)"
	@$(PYTHON) -m venv --clear $(VENV)
	@touch $@

dist/.built: $(SOURCES) $(METADATA) constraints.txt | $(VENV)/.made
	@echo "== building the wheel"
	@rm -rf dist
	@$(PIP) wheel --quiet --no-deps --wheel-dir dist .
	@touch $@

# Installed by force, since pip takes a wheel of the same version for the same wheel.
$(VENV)/.package: dist/.built
	@echo "== installing $(WHEEL)"
	@$(INSTALL) --no-deps --force-reinstall "$(WHEEL)"
	@touch $@

$(VENV)/.packages-run: pyproject.toml constraints.txt | $(VENV)/.package
	@echo "== installing the packages that it runs on"
	@$(INSTALL) "$(WHEEL)[explore,sweep,units]"
	@touch $@

# The loops of searches, of maps and of laws with breaks are compiled at their first call, and kept beside the package.
COMPILE = from chuteflow import Chute, curve, domain; \
	curve(Chute(0.3, 0.8, 0.8, 0.6), points=10); \
	curve(Chute(0.3, 0.8, 0.8, 0.6, closure='extended'), points=10); \
	domain(Chute(0.3, 0.8, 0.8, 0.6), ('slope', 0.25, 0.35), ('roughness', 0.55, 0.65), size=(3, 3), tolerance=0.1)
$(VENV)/.compiled: $(VENV)/.package $(VENV)/.packages-run
	@echo "== compiling the search"
	@$(BIN)/python -W ignore -c "$(COMPILE)" 2>/dev/null
	@touch $@

# After the others, never beside them: with make -j, two pips would write into one environment at once.
$(VENV)/.packages-test: pyproject.toml constraints.txt | $(VENV)/.packages-run
	@echo "== installing the packages that test it"
	@$(INSTALL) "$(WHEEL)[test]"
	@touch $@

$(VENV)/.packages-dem: pyproject.toml constraints.txt | $(VENV)/.packages-run
	@echo "== installing the packages that simulate grains"
	@$(INSTALL) "$(WHEEL)[dem]"
	@touch $@

$(VENV)/.packages-bench: pyproject.toml constraints.txt | $(VENV)/.packages-run
	@echo "== installing the packages that it is compared with"
	@$(INSTALL) "$(WHEEL)[bench]"
	@touch $@
