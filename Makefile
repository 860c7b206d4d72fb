# Set-up and main jobs of infoplan. `make` lists the targets.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
ARGS ?=
# What meets other libraries: detectors, missions and their tables, tracking.
OLDEST := tests/detect tests/test_mission.py tests/test_tracking.py

.DEFAULT_GOAL := help
.PHONY: help run figures test test-long test-oldest test-browser coverage bench check package docs derived pictures paper \
  detectors faults growth kernels loop maps models multiverse outliers planners survey clean

help: ## list the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 16

run: $(VENV)/.installed ## set up and run the paper's method: ten missions (ARGS="rho=0.05 seeds=3" changes it)
	$(BIN)/infoplan run planner=puct detector=copod rho=0.1 $(ARGS)

figures: $(VENV)/.installed ## run what is missing of the paper's Fig. 5, then draw all figures (BUDGET=400 SEEDS=2 for a short one)
	$(BIN)/python scripts/make_figures.py $(if $(BUDGET),budget=$(BUDGET)) $(if $(SEEDS),seeds=$(SEEDS)) $(ARGS)

test: $(VENV)/.installed-dev ## set up and run the tests
	$(BIN)/python -m pytest --numprocesses auto $(ARGS)

test-long: $(VENV)/.installed-dev ## set up and run the tests that take minutes: kills, benchmarks, real elevation models
	$(BIN)/python -m pytest -m long $(ARGS)

test-browser: $(VENV)/.installed-dev ## test the pages in Chromium (Debian: apt-get install chromium chromium-driver)
	$(BIN)/python -m pytest -m browser tests/browser $(ARGS)

test-oldest: $(VENV)-oldest/.installed ## set up the oldest allowed dependencies beside the others, and run what they matter to (PYTHON=python3.11)
	$(VENV)-oldest/bin/python -m pytest $(if $(ARGS),$(ARGS),$(OLDEST))

coverage: $(VENV)/.installed-dev ## run the tests and tell which lines they reach, workers left out (htmlcov/index.html)
	$(BIN)/python -m pytest --numprocesses auto --cov --cov-report=term --cov-report=html $(ARGS)

bench: $(VENV)/.installed-bench ## set up and measure every speed figure (half an hour; ARGS=--quick for a look)
	$(BIN)/python -m benchmarks.run $(ARGS)

check: $(VENV)/.installed-dev ## set up and run the linter, the type checker and the check of imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

package: $(VENV)/.installed-dev ## build dist/, check it, and fly a mission from the wheel that the source distribution makes
	rm -rf dist build/dist
	$(BIN)/check-manifest
	$(BIN)/python -m build --outdir dist
	$(BIN)/twine check --strict dist/*
	$(BIN)/python -m pip install --quiet --no-deps --target build/dist dist/infoplan-*.whl
	cd build/dist && PYTHONPATH=$$PWD $(abspath $(BIN))/python -P -m infoplan.cli run experiment=smoke \
	  terrain=volcano seeds=1 results_dir=results

docs: $(VENV)/.installed-docs ## build the site of docs/ into docs/_build/html; it fetches nothing
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet -b html docs docs/_build/html
	@echo docs/_build/html/index.html

derived: $(VENV)/.installed ## write conf/ and the tables in docs/ again, from the code that defines them
	$(BIN)/python scripts/derive.py

pictures: detectors faults kernels loop maps models multiverse outliers planners survey paper growth ## draw all pictures of docs/ again

paper: figures ## draw what docs/ shows of the paper's study: Fig. 5, an animation, where errors come from, the errors of vecchia
	cp results/figures/fig5.png docs/fig5.png
	$(BIN)/infoplan claims --csv > docs/replication.csv
	$(BIN)/infoplan animate puct-copod-helens-rho0.1-batch seed=0
	cp results/figures/puct-copod-helens-rho0.1-batch-*-seed0.gif docs/puct-copod-helens.gif
	for method in uct-none uct-copod puct-copod; do \
	  $(BIN)/infoplan explain $$method-helens-rho0.1-batch seeds=6 || exit 1; done
	$(BIN)/infoplan figures explain
	cp results/figures/explain.png results/figures/explain.csv docs/
	$(BIN)/python -m benchmarks.accuracy results -rho0.1-batch-

growth: bench ## draw what docs/ shows of make bench
	$(BIN)/python -m benchmarks.growth_picture

detectors: $(VENV)/.installed ## draw the picture of docs/detectors.md again
	$(BIN)/python scripts/draw_detectors.py

faults: $(VENV)/.installed ## draw the pictures of docs/faults.md again
	$(BIN)/python scripts/draw_faults.py

kernels: $(VENV)/.installed ## draw the picture of docs/kernels.md again
	$(BIN)/python scripts/draw_kernels.py

loop: $(VENV)/.installed ## draw the picture of how the parts go together again
	$(BIN)/python scripts/draw_loop.py

maps: $(VENV)/.installed ## draw the picture of docs/maps.md again
	$(BIN)/python scripts/draw_maps.py

models: $(VENV)/.installed ## draw the picture of docs/models.md again
	$(BIN)/python scripts/draw_models.py

multiverse: $(VENV)/.installed ## draw docs/multiverse.md again (TABLE=results/multiverse.parquet: with its universes)
	$(BIN)/python scripts/draw_multiverse.py $(TABLE)

outliers: $(VENV)/.installed ## draw docs/outliers.md again (RESULTS=folder: from another run of experiment=outliers)
	$(BIN)/python scripts/draw_outliers.py $(RESULTS)

planners: $(VENV)/.installed-dev ## draw the picture of docs/planners.md again
	$(BIN)/python scripts/draw_planners.py

survey: $(VENV)/.installed-dev ## draw the picture of docs/after_a_survey.md again
	$(BIN)/python scripts/draw_survey.py

clean: ## remove the virtual environments and all caches; results stay
	rm -rf $(VENV) $(VENV)-oldest build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis htmlcov .coverage* docs/_build
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "infoplan needs Python 3.11 or newer: make PYTHON=python3.12 ...")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	touch $@

$(VENV)/.installed-dev: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@ $(VENV)/.installed

$(VENV)-oldest/.installed: pyproject.toml constraints-oldest.txt
	$(PYTHON) -m venv $(VENV)-oldest
	$(VENV)-oldest/bin/python -m pip install --quiet --disable-pip-version-check \
	  --constraint constraints-oldest.txt --editable '.[cmaes,dask,geo,survey,sweep,tracking]' \
	  pytest hypothesis shapely gpxpy psutil
	touch $@

$(VENV)/.installed-bench: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	touch $@ $(VENV)/.installed

$(VENV)/.installed-docs: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	touch $@ $(VENV)/.installed
