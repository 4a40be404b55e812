# `make reproduce` and `make test` do all the set-up on a fresh machine: Python 3.11 or newer is all
# they need.

PYTHON ?= python3
BIN := .venv/bin
RUNS ?= 20
INPUTS ?= 1000000
KILLS ?= 1000
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: help reproduce test coverage bounds fuzz crash test-matlab test-sb3 octave gazebo lint \
	benchmark release clean
help:
	@echo "make reproduce   the published tables again, with pictures, into results/ (RUNS=20)"
	@echo "make test        all checks: lint, format, types, tests"
	@echo "make coverage    what the quick tests execute of each package, in lines and branches"
	@echo "make bounds      the tests of compiled code with every index checked, some minutes"
	@echo "make fuzz        damaged inputs for everything that parses, hours (INPUTS=1000000)"
	@echo "make crash       kill every command that writes, an hour (KILLS=1000)"
	@echo "make octave      install GNU Octave for the MATLAB twin (Debian, Ubuntu)"
	@echo "make gazebo      bring Gazebo 11 into your cache, 0.3 GB to download (Debian)"
	@echo "make test-matlab the tests of the MATLAB twin alone"
	@echo "make test-sb3    the environments and the protocol with Stable-Baselines3, some gigabytes"
	@echo "make benchmark   speed beside C, Gymnasium and NumPy, into docs/"
	@echo "make release     check, build and try a release, into dist/; nothing is published"
	@echo "make clean       remove the environment and everything made"

.venv/used: pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed")'
	$(PYTHON) -m venv .venv
	$(INSTALL) -e .
	@touch $@

.venv/developed: .venv/used
	$(INSTALL) -e '.[dev]'
	@touch $@

reproduce: .venv/used
	$(BIN)/upright reproduce --runs $(RUNS)

lint: .venv/developed
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/mh_lint --brief matlab benchmarks

# A worker on each core, then alone what balances by the wall clock. Tests start hundreds of programs,
# which find their bytecode even where PYTHONDONTWRITEBYTECODE is set.
test: lint
	$(BIN)/python -m compileall -q src
	$(BIN)/pytest --numprocesses auto -m "not timing"
	$(BIN)/pytest -m timing $$(grep -rl --include=*.py mark.timing tests)

coverage: .venv/developed
	$(BIN)/python tools/measure_coverage.py

# Compiled code reads arrays without looking at their sizes; here it looks.
bounds: .venv/developed
	NUMBA_BOUNDSCHECK=1 $(BIN)/pytest --numprocesses auto -m "not slow and not timing" \
	  tests/core tests/agents tests/environments tests/policies

fuzz: .venv/developed
	$(BIN)/python tools/fuzz.py --inputs $(INPUTS) --record docs/results/reliability.json
	$(BIN)/python tools/reliability.py

crash: .venv/developed
	$(BIN)/python tools/crash.py --kills $(KILLS) --record docs/results/reliability.json
	$(BIN)/python tools/reliability.py

octave:
	matlab/install-octave.sh --window

gazebo: .venv/used
	$(BIN)/upright gazebo install

test-matlab: .venv/developed
	UPRIGHT_REQUIRE_OCTAVE=1 $(BIN)/pytest -m octave

test-sb3: .venv/developed
	$(INSTALL) stable-baselines3
	$(BIN)/pytest tests/environments/test_stable_baselines3.py

benchmark: .venv/developed
	$(BIN)/python benchmarks/speed.py --output docs/performance.md
	$(BIN)/python benchmarks/environments.py --output docs/environment.md
	$(BIN)/python benchmarks/matlab.py --output docs/matlab.md
	$(BIN)/python benchmarks/ros2.py --output docs/ros2.md
	$(BIN)/python benchmarks/gazebo.py --output docs/gazebo.md
	$(BIN)/python benchmarks/transfer.py --output docs/transfer.md
	$(BIN)/python benchmarks/disturbances.py --output docs/disturbances.md
	$(BIN)/python benchmarks/scale.py --output docs/scale.md

release: .venv/developed
	$(BIN)/python tools/release.py

clean:
	rm -rf .venv results dist benchmarks/build .mypy_cache .pytest_cache .ruff_cache .hypothesis fuzz-failures
