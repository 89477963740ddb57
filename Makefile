# Every target sets up its environment on first use: `make paper` one with what the package needs (.venv-run,
# requirements.lock), all others one with everything (.venv, requirements-dev.lock). Both have the same versions.
PYTHON ?= python3
ENV := .venv
BIN := $(ENV)/bin
RUN := .venv-run
UV := .uv/bin/uv
OUT ?= out/paper
MINUTES ?= 60
TESTS ?= not study and not slow
WHERE ?= notebooks tests
# Functions of arrays or bytes alone, and every command once.
QUICK := $(addprefix tests/,identify/motion identify/rigid_body identify/motion/serial_arm identify/signals rig/devices rig/mcap \
    uq/monte_carlo/coverage uq/cli/test_every_command.py)

.PHONY: env paper quick test test-all check unit axe bench study docs fuzz lock dist clean

# Bytecode is made here: where Python may not write it later, every start would compile what it imports, which takes
# longer than to run it. Ours each time, since `.ready` does not know of a module that was edited; what is edited
# since is compiled in memory.
env: $(ENV)/.ready
	$(BIN)/python -m compileall -q uq identify rig

paper: $(RUN)/.ready
	$(RUN)/bin/python -m compileall -q uq identify rig
	$(RUN)/bin/inertia paper --out $(OUT)

$(UV): requirements-uv.lock
	$(PYTHON) -m venv .uv
	.uv/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-uv.lock
	touch $@

$(ENV)/.ready: requirements-dev.lock
$(RUN)/.ready: requirements.lock
$(ENV)/.ready $(RUN)/.ready: $(UV) pyproject.toml
	test -x $(@D)/bin/python || $(PYTHON) -m venv --without-pip $(@D)
	$(UV) pip sync --quiet --compile-bytecode --python $(@D)/bin/python --require-hashes $(filter %.lock,$^)
	$(UV) pip install --quiet --python $(@D)/bin/python --no-deps --no-build-isolation --editable .
	touch $@

# Before each commit: what `test` does, with the tests of QUICK alone.
quick: export WHERE = $(QUICK)
quick: test

# Lint, types, direction of imports, tests, notebooks: side by side, since some tests wait for clocks.
test: env
	$(MAKE) --no-print-directory --jobs 2 check unit

# The same with the slow tests, repeats for statistics above all: whatever is no study.
test-all: export TESTS = not study
test-all: test

check: env
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# What is compiled is kept for the next run, in a folder of the tests' own, bytecode too. Matrices are small here: two
# threads of BLAS would wait for each other. A file's tests run in one worker, which makes once what they share; the
# notebooks, the longest, start first.
unit: export INERTIA_TEST_CACHE ?= $(CURDIR)/$(ENV)/compiled
unit: export OPENBLAS_NUM_THREADS = 1
unit: export PYTHONDONTWRITEBYTECODE =
unit: env
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder -m "$(TESTS)" $(WHERE)

# The pages judged by axe-core, which is fetched by npm for this alone; needs Chromium (Debian: apt-get install chromium).
axe: export AXE_CORE = $(CURDIR)/out/axe/node_modules/axe-core/axe.min.js
axe: env
	test -f $(AXE_CORE) || npm install --silent --no-save --prefix out/axe axe-core
	$(BIN)/python -m pytest -k axe tests/uq/report/test_accessibility.py tests/uq/cli/test_design.py tests/test_site.py

# The paper's campaign against its references, then what whole commands take.
bench: env
	$(BIN)/python -m benchmarks
	$(BIN)/python -m benchmarks.answers

# The site of the documentation, in out/docs; a warning, such as a link that leads nowhere, is an error.
docs: env
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs out/docs

# Mutated files of every kind for an hour; `tests/test_fuzz.py` is the short form.
fuzz: env
	$(BIN)/python -m tests.helpers.fuzz --minutes $(MINUTES)

# Slow statistical studies; their results are kept in docs/.
study: env
	$(BIN)/python -m pytest -m study -n 0 tests notebooks

# All that is installed, by hash and without an index's address. What the package needs is a part of everything, at the
# same versions; with setuptools, which installs the checkout.
lock: PIN = $(UV) pip compile --quiet --universal --generate-hashes --no-header --python-version 3.11
lock: $(UV)
	$(PIN) --upgrade --extra dev pyproject.toml --output-file requirements-dev.lock
	printf 'setuptools\n' | $(PIN) --upgrade --constraint requirements-dev.lock pyproject.toml - \
	    --output-file requirements.lock
	printf 'uv\n' | $(PIN) --upgrade - --output-file requirements-uv.lock

# Wheel and source distribution in dist/, looked at by two tools from throw-away environments.
dist: $(UV)
	rm -rf dist
	$(UV) build --quiet --out-dir dist
	$(UV) tool run --quiet twine check --strict dist/*
	$(UV) tool run --quiet check-wheel-contents dist/*.whl

clean:
	rm -rf .venv .venv-run .uv out build dist *.egg-info
