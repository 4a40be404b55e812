# `make reproduce` and `make test` do all the set-up on a fresh machine: Python 3.11 or newer is all
# they need.

PYTHON ?= python3
BIN := .venv/bin
RUNS ?= 20
INPUTS ?= 1000000
KILLS ?= 1000
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: help reproduce test coverage bounds fuzz crash test-matlab test-sb3 octave gazebo lint \
	benchmark records release clean
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
	@echo "make records     all recorded results again, into docs/, two hours; goes on where it stopped"
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
	$(BIN)/python benchmarks/one_source.py --output docs/one-source.md

# What agents reached. Stores keep the runs; those of other code are not used.
TABLE := $(BIN)/upright table --runs 100 --format markdown
GAPS := $(BIN)/upright table --runs 100 --noises none --settings as-published \
  --store docs/results/report-settings.sqlite
OTHER_BOXES := --set 'x_edges=(-1.6,1.6)' --set 'x_dot_edges=(0.0,)' \
  --set 'theta_edges=(-0.0524,-0.0175,0.0175,0.0524)' \
  --set 'theta_dot_edges=(-0.873,-0.524,-0.209,0.0,0.209,0.524,0.873)'
RECORDS := $(addprefix docs/, leaderboard.md robust.md first-hour.md pictures/sweep.png pictures/watch.png \
  pictures/play.gif) \
  $(addprefix docs/results/, report.md reinforce-600000.md ndp-zero.md ndp-random.md \
  all-measurements-zero.md all-measurements-random.md report-settings.md matlab.md gazebo.md)

.PHONY: $(RECORDS)
records: $(RECORDS)

docs/leaderboard.md docs/robust.md: .venv/developed
	$(BIN)/upright $(basename $(@F)) --output $@ --store docs/results/$(basename $(@F)).sqlite

docs/first-hour.md: .venv/developed
	$(BIN)/python tools/record_transcript.py $@

docs/pictures/sweep.png: .venv/developed
	$(BIN)/upright table --agents adaptive-lqr,q-learning,random-search --noises none \
	  --parameter half_length=0.25:2:8:log --runs 20 --store docs/results/sweep.sqlite \
	  --format json --output docs/results/sweep.json
	$(BIN)/upright plot sweep docs/results/sweep.sqlite --output $@

docs/pictures/watch.png: .venv/developed
	$(BIN)/python tools/record_page.py docs/pictures

docs/pictures/play.gif: .venv/developed
	$(BIN)/upright learn reinforce --noise gaussian-0.2 --seed 1 --save docs/results/policy.npz --quiet
	$(BIN)/upright play docs/results/policy.npz --start wide --seed 24 --steps 220 --video $@

docs/results/report.md: .venv/developed
	$(BIN)/upright reproduce --runs 100 --output docs/results

docs/results/reinforce-600000.md: .venv/developed
	$(TABLE) --agents reinforce,random-search --steps 600000 --output $@

docs/results/ndp-zero.md docs/results/ndp-random.md: docs/results/ndp-%.md: .venv/developed
	$(TABLE) --agents ndp --settings as-published --steps 600000 --start $* --output $@

docs/results/all-measurements-zero.md docs/results/all-measurements-random.md: \
  docs/results/all-measurements-%.md: .venv/developed
	$(TABLE) --agents adaptive-lqr,random-search --noises all-5,all-10 --steps 600000 \
	  --start $* --output $@

docs/results/report-settings.md: .venv/developed
	$(GAPS) --agents reinforce --set init_std=0.5,1.0 --set baseline=mean,fitted \
	  --set beta1=0.0,0.9 --set episodes=1,8
	$(GAPS) --agents reinforce --set learning_rate=0.01,0.03,0.1,0.3
	$(GAPS) --agents reinforce --set x_scale=2.4 --set x_dot_scale=1.5 \
	  --set theta_scale=0.2094 --set theta_dot_scale=2.0
	$(GAPS) --agents q-learning --set mirrored=False,True --set jitter=1e-06,0.001
	$(GAPS) --agents q-learning --set mirrored=False,True $(OTHER_BOXES)
	$(BIN)/upright show docs/results/report-settings.sqlite --format markdown --output $@

docs/results/matlab.md: .venv/developed octave
	$(BIN)/upright matlab table --runs 100 --format markdown --output $@

docs/results/gazebo.md: .venv/developed gazebo
	$(BIN)/upright table --plant gazebo --agents reinforce,adaptive-lqr,random-search \
	  --noises none,gaussian-0.1 --runs 10 --format markdown --output $@

release: .venv/developed
	$(BIN)/python tools/release.py

clean:
	rm -rf .venv results dist benchmarks/build .mypy_cache .pytest_cache .ruff_cache .hypothesis fuzz-failures
