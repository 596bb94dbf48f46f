# Two commands on a fresh machine: `make demo` and `make test`. Needs git, make and Python 3.11+ with venv.
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin
WORKERS ?= 2
# Modules are compiled when they are first imported: most of what is installed never is.
PIP = $(BIN)/python -m pip --disable-pip-version-check install --quiet --no-compile -c constraints.txt

.PHONY: help demo test golden golden-freeze trials nightly mutants accuracy bench lint docs docs-figures docs-trade firmware clean

help:
	@echo "make demo     from two old recordings to Table 1 and a report"
	@echo "make test     the tests, in two processes (WORKERS=n for others): 3 minutes on two cores"
	@echo "make golden   every frozen output against today's, as a table of what moved: 1 minute"
	@echo "make golden-freeze  freeze the outputs that moved; the commit's message says what moved and why"
	@echo "make trials   what many seeds, kills and long runs show (TRIALS=200 KILLS=100, or others): an hour"
	@echo "make nightly  trials, docs, firmware, smallest versions, planted faults and checks of the project's files: two hours"
	@echo "make mutants  planted faults, and whether tests and goldens notice them: a quarter of an hour"
	@echo "make accuracy what the estimates must reach, over 2000 seeds (SEEDS=n for others)"
	@echo "make bench    speed, as ratios to named references"
	@echo "make lint     ruff, mypy, import contracts, names, spelling"
	@echo "make firmware the rangefinder's hex, as it travels in the package (Debian: gcc-avr avr-libc arduino-core-avr)"
	@echo "make docs     the pages and the reference of the Python API as a site, docs/_build/index.html"

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "springmass needs Python 3.11 or newer, $(PYTHON) is $$($(PYTHON) --version); call make PYTHON=python3.11" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

# A stamp per set of packages: the second call of any target installs nothing.
$(VENV)/.installed: pyproject.toml constraints.txt | $(BIN)/python
	$(PIP) -e .
	@touch $@

$(VENV)/.installed-dev: pyproject.toml constraints.txt | $(BIN)/python
	$(PIP) 'pip>=25.1'  # the first that installs dependency groups
	$(PIP) -e '.[dask]' --group dev
	@touch $@ $(VENV)/.installed

demo: $(VENV)/.installed
	$(BIN)/springmass demo -o demo-output

test: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -m "not trials" -n $(WORKERS) --dist loadfile

golden: $(VENV)/.installed-dev
	$(BIN)/python -m tests.golden

golden-freeze: $(VENV)/.installed-dev
	$(BIN)/python -m tests.golden --freeze

trials: $(VENV)/.installed-dev
	SPRINGMASS_TRIALS=$(or $(TRIALS),200) SPRINGMASS_KILLS=$(or $(KILLS),100) SPRINGMASS_EXAMPLES=nightly \
	$(BIN)/python -m pytest -m trials -n $(WORKERS) --dist loadfile

nightly: $(VENV)/.installed-dev
	bash .ci/nightly

mutants: $(VENV)/.installed-dev
	$(BIN)/python -m tests.mutants

accuracy: $(VENV)/.installed-dev
	$(BIN)/python benchmarks/accuracy --seeds $(or $(SEEDS),2000)

bench: $(VENV)/.installed-dev
	$(BIN)/python benchmarks/ratios.py
	$(BIN)/python benchmarks/dynamics.py
	$(BIN)/python benchmarks/formats.py
	$(BIN)/python benchmarks/many.py
	$(BIN)/python benchmarks/course.py

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python benchmarks/names.py
	git ls-files -z | xargs -0 $(BIN)/codespell

docs: $(VENV)/.installed-dev
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs docs/_build

# The screenshots need chromium; Debian: apt-get install chromium.
docs-figures: $(VENV)/.installed-dev
	$(BIN)/python docs/figures/draw.py
	$(BIN)/python docs/figures/gallery.py
	$(BIN)/python docs/figures/wiring.py
	$(BIN)/python docs/figures/screenshots.py

docs-trade: $(VENV)/.installed-dev
	$(BIN)/python benchmarks/trade.py

# Needs no network and no .venv. The tests build it anew and compare it with the one that travels.
firmware:
	@command -v avr-g++ >/dev/null && test -d /usr/share/arduino/hardware/arduino/avr || \
	  { echo "make firmware needs avr-g++ and Arduino's core; Debian: apt-get install gcc-avr avr-libc arduino-core-avr" >&2; exit 1; }
	$(MAKE) --no-print-directory -C firmware hex size
	cp firmware/build/springmass_rangefinder.hex acquisition/live/firmware/

clean:
	rm -rf firmware/build $(VENV) demo-output dist build docs/_build .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
