# `make` lists the targets. Everything goes into .venv; nothing is installed elsewhere but by `make browser`, by
# `make dreal`, and by `make setup` where a Debian system lacks Python's venv.

PYTHON ?= python3
WORKERS ?= $(shell n=$$(nproc 2>/dev/null || echo 2); [ $$n -lt 8 ] || n=8; echo $$n)
BIN := .venv/bin
READY := .venv/.ready
PYTEST := $(BIN)/python -m pytest -q -p no:cacheprovider --dist worksteal
LINTED := scenicq cli tests sample_data
FASTEST := tests/units/syntax tests/units/forest tests/units/compiler tests/test_language.py tests/test_layers.py tests/units/match/search/test_backtracking.py

# The tests start hundreds of processes: without bytecode each compiles 300 files of ours, which takes 0.7 s.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup demo lint docs check test test-all test-versions test-oldest test-newest golden bench bench-scale conformance conformance-random conformance-time fuzz oracle-frames oracle-time mutate browser dreal clean

help: ## List the targets
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | while IFS="$$(printf '\t')" read -r name text; do \
		printf '  make %-16s %s\n' "$$name" "$$text"; done

setup: $(READY) ## Make .venv with scenicq and all that its development needs

$(READY): pyproject.toml
	@$(call ensure_venv)
	$(BIN)/python -m pip install -qq --disable-pip-version-check --upgrade pip
	$(BIN)/python -m pip install -qq --disable-pip-version-check --editable '.[dev]'
	@touch $@

demo: $(READY) ## Ingest the sample data into demo/ and find two crossing cars in it
	@mkdir -p demo
	$(BIN)/scenicq ingest sample_data/crossroads demo/crossroads --force
	$(BIN)/scenicq match sample_data/scenarios/02_crossing_cars.scenic demo/crossroads --format table --summary

lint: $(READY) ## Format, lint, types and layers
	$(BIN)/ruff format --check $(LINTED)
	$(BIN)/ruff check $(LINTED)
	$(BIN)/pyright --warnings
	$(BIN)/lint-imports --no-cache

docs: $(READY) ## Make the documentation site in build/docs; a link that leads nowhere is an error
	$(BIN)/sphinx-build -q -W --keep-going -c scenicq/docs -d build/doctrees . build/docs

check: lint ## What lint does, and the fastest tests: under two minutes
	$(PYTEST) -n $(WORKERS) -m 'not slow' $(FASTEST)

test: $(READY) ## All tests but the slow ones
	$(PYTEST) -n $(WORKERS) -m 'not slow'

test-all: $(READY) ## All tests
	$(BIN)/python -m pip install -qq --disable-pip-version-check --editable '.[dev,notebook]'
	$(PYTEST) -n $(WORKERS) --hypothesis-profile=anew
	$(BIN)/python tests/tools/dependencies/versions.py oldest
	$(BIN)/python tests/tools/dependencies/versions.py newest --pre

test-versions: $(READY) ## What test-oldest and test-newest do, side by side
	$(BIN)/python tests/tools/dependencies/versions.py oldest newest

test-oldest: $(READY) ## The lowest versions of dependencies that pyproject.toml allows, without pandas: the same output
	$(BIN)/python tests/tools/dependencies/versions.py oldest

test-newest: $(READY) ## The newest versions of dependencies, without pandas: the same output
	$(BIN)/python tests/tools/dependencies/versions.py newest

golden: $(READY) ## Rewrite the golden files that tests compare with
	$(PYTEST) --update-golden -m 'not slow'

bench: $(READY) ## Measure queries, start-up, ingest, pictures and what each step of matching is worth; numbers go to bench-results/ (SCENIC=a checkout and DATASETS= add its programs)
	$(BIN)/python tests/tools/bench/queries.py
	$(BIN)/python tests/tools/bench/jointly.py
	$(BIN)/python tests/tools/bench/scalability.py --patience 5
	$(BIN)/python tests/tools/bench/ingest.py
	$(BIN)/python tests/tools/bench/pictures.py
	$(BIN)/python tests/tools/bench/evaluation.py
	$(BIN)/python tests/tools/bench/planted.py --page
	$(BIN)/python tests/tools/bench/steps.py
	$(BIN)/python tests/tools/bench/by_hand.py
	$(BIN)/python tests/tools/bench/maps.py
	$(BIN)/python tests/tools/bench/intervals_by_hand.py
	$(BIN)/python tests/tools/bench/intervals.py
	$(BIN)/python tests/tools/bench/deadlines.py
	$(BIN)/python tests/tools/bench/verdicts.py record bench-results/verdicts.jsonl
ifdef SCENIC
	$(BIN)/python tests/tools/bench/published.py $(SCENIC) $(DATASETS)
endif

FRAMES ?= 10000 100000
bench-scale: $(READY) ## Measure queries over stores of growing size (FRAMES=1000000 is the largest bar)
	$(BIN)/python tests/tools/bench/scale.py --frames $(FRAMES)

MAP ?= Town01.xodr
RANDOM ?= 200
SEED ?=
ONE = $(or $(SEED),1)
FRESH := $(or $(SEED),$(shell date +%s))
conformance: $(READY) ## Compare with Scenic 3.1.1 and 2.1.0 (MAP=an OpenDRIVE file, RANDOM=, SEED=; or SCENIC=a checkout)
ifdef SCENIC
	$(BIN)/python tests/tools/conformance/published.py $(SCENIC)
	$(BIN)/python tests/tools/conformance/map_questions.py $(SCENIC)
else
	$(BIN)/python tests/tools/conformance/run_conformance.py --map $(MAP) --random $(RANDOM) --seed $(ONE)
endif

PROGRAMS ?= 3000
conformance-random: $(READY) ## Match scenes that Scenic 3.1.1 draws from random programs on five towns (MAPS=folders of OpenDRIVE maps, PROGRAMS=, SEED= (a fresh one))
	$(BIN)/python tests/tools/conformance/random_scenes.py --maps $(MAPS) --programs $(PROGRAMS) --seed $(FRESH)

TRACES ?= 2
conformance-time: $(READY) ## Match what Scenic 3.1.1 simulates over time (MAP=an OpenDRIVE file; or SCENIC=a checkout; TRACES= of each program)
	$(BIN)/python tests/tools/conformance/traces.py $(if $(SCENIC),--checkout $(SCENIC),--map $(MAP)) --seeds $(TRACES)

MINUTES ?= 60
fuzz: $(READY) ## Attack with hostile programs, datasets, sources and kills, MINUTES=60 of each
	$(BIN)/python tests/tools/fuzz/hostile_programs.py --minutes $(MINUTES) --seed $(ONE)
	$(BIN)/python tests/tools/fuzz/hostile_datasets.py --minutes $(MINUTES) --seed $(ONE)
	$(BIN)/python tests/tools/source_mutations/fuzz.py --minutes $(MINUTES) --seed $(ONE)
	$(BIN)/python tests/tools/fuzz/kills.py --minutes $(MINUTES) --seed $(ONE)
	$(BIN)/python tests/tools/fuzz/differential.py --minutes $(MINUTES) --seed $(ONE)

oracle-frames: $(READY) ## Judge random programs over random labels by the definition, MINUTES=60, SEED= (a fresh one)
	$(BIN)/python tests/oracles/labels/frames_attack.py --minutes $(MINUTES) --seed $(FRESH)

oracle-time: $(READY) ## Judge random programs with choices over time by the definition, MINUTES=60, SEED= (a fresh one)
	$(BIN)/python tests/oracles/runs/test_choices.py --minutes $(MINUTES) --seed $(FRESH)

MUTATIONS ?= 200
mutate: $(READY) ## Change the code in MUTATIONS=200 small ways and count which the fast tests notice
	$(BIN)/python -m pip install -qq --disable-pip-version-check --editable '.[dev,mutation]'
	$(BIN)/python tests/tools/mutation/mutate.py --count $(MUTATIONS) --seed $(ONE)

browser: ## Install the Chromium that the tests of reports are driven in, where the system has it
	@$(call install_browser)

dreal: $(READY) ## Install what dReal needs besides its package, where the system has it
	@$(call install_dreal)
	$(BIN)/scenicq doctor

clean: ## Remove what the targets made, except .venv
	rm -rf demo bench-results build dist *.egg-info .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find scenicq cli tests sample_data -name __pycache__ -type d -exec rm -rf {} +

# Debian keeps `venv` in a package of its own; `python3 -m venv` then leaves half an environment behind.
define ensure_venv
	if $(BIN)/python -m pip --version >/dev/null 2>&1; then exit 0; fi; \
	if ! $(PYTHON) -m venv .venv >/dev/null 2>&1; then \
		rm -rf .venv; \
		if [ "$$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then \
			echo "$(PYTHON) cannot make a virtual environment: install Python 3.11 to 3.13 with venv" >&2; \
			echo "(on Debian and Ubuntu: apt-get install python3 python3-venv)" >&2; exit 1; \
		fi; \
		apt-get update -q && apt-get install -y -q --no-install-recommends python3 python3-venv && \
		$(PYTHON) -m venv .venv || exit 1; \
	fi; \
	$(BIN)/python -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' || { \
		rm -rf .venv; echo "scenicq needs Python 3.11 to 3.13: make PYTHON=python3.11 setup" >&2; exit 1; }
endef

# The tests that need a browser skip without one, so that a missing one is told, but is no failure.
define install_browser
	if command -v chromedriver >/dev/null && { command -v chromium || command -v google-chrome; } >/dev/null; then exit 0; fi; \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		apt-get update -q && apt-get install -y -q --no-install-recommends chromium chromium-driver fonts-dejavu-core && exit 0; \
		echo "apt-get cannot install Chromium: the tests of reports in a browser will be skipped" >&2; \
	else \
		echo "not root, or not Debian: the tests of reports in a browser need chromium and chromedriver on PATH" >&2; \
		echo "(on Debian: apt-get install chromium chromium-driver fonts-dejavu-core)" >&2; \
	fi
endef

# dReal's own fork of IBEX is in no registry but its package archive for Ubuntu.
define install_dreal
	id=none; [ -r /etc/os-release ] && id=$$(. /etc/os-release && echo "$$ID"); \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		apt-get update -q && \
		apt-get install -y -q --no-install-recommends libnlopt0 coinor-libclp1 liblapack3 libblas3 || exit 1; \
		if [ "$$id" = ubuntu ]; then \
			apt-get install -y -q software-properties-common && add-apt-repository -y ppa:dreal/dreal && \
			apt-get install -y -q libibex-dev || exit 1; \
		fi; \
	else \
		echo "not root, or not Debian: dReal needs the packages libnlopt0 coinor-libclp1 liblapack3 libblas3"; \
	fi; \
	if ! [ -e /opt/libibex/2.7.4/lib/libibex.so ]; then \
		echo "missing: libibex.so 2.7.4 of dReal's own IBEX in /opt/libibex/2.7.4/lib; without it the portable solver is used"; \
	fi
endef
