# Everything needs nothing but Python 3.11 or newer:   make run   make test
# Another interpreter:  make PYTHON=python3.12 run     Arguments:  make test ARGS="-x -k batch"

PYTHON ?= python3
ARGS ?=
# One more than there are cores: tests with real processes, ports and browsers wait for much of their time.
JOBS ?= $(shell expr $$(getconf _NPROCESSORS_ONLN 2>/dev/null || echo 1) + 1)

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

.PHONY: help run test fuzz check format bench install clean

help:
	@echo "make run      daemon, a virtual ElVinto mill and a sample program; the dashboard's address is printed"
	@echo "make test     all tests; ARGS=--long tries ten times as many examples, seeds and crash points"
	@echo "make check    format, lint, types, import rules, docs against code"
	@echo "make fuzz     the parsers for minutes: make fuzz ARGS=\"grbl --minutes 5\""
	@echo "make bench    benchmarks; ARGS=load runs one, ARGS=\"load --only pause\" a part of it"
	@echo "make install  the environment in $(VENV), with the tools for development"
	@echo "make format   put the format right"
	@echo "make clean    remove the environment and all caches"

run: $(VENV)/.installed
	@$(BIN)/millstream demo $(ARGS)

test: $(VENV)/.installed-dev
	@$(BIN)/python -m pytest -n $(JOBS) $(ARGS)

# Apart from each other, so that `make --jobs 2 check` does them side by side; the longest first.
CHECKS := check-types check-clients check-js check-docs check-imports check-lint check-format
.PHONY: $(CHECKS)

check: $(CHECKS)

$(CHECKS): $(VENV)/.installed-dev

check-types:
	$(BIN)/mypy

check-clients:
	.ci/check-clients $(VENV)

check-js:
	.ci/check-js

check-docs:
	$(BIN)/python -m pytest tests/docs

check-imports:
	$(BIN)/lint-imports

check-lint:
	$(BIN)/ruff check .

check-format:
	$(BIN)/ruff format --check .

format: $(VENV)/.installed-dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

fuzz: $(VENV)/.installed-dev
	@$(BIN)/python -m tests.fuzz $(ARGS)

bench: $(VENV)/.installed
	@$(BIN)/python -m bench $(ARGS)

install: $(VENV)/.installed-dev

clean:
	rm -rf $(VENV) $(VENV).new .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache .coverage dist build
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The stamps make the second time quick; a change of the dependencies installs again.
$(VENV)/.installed: pyproject.toml .ci/make-venv
	@echo "millstream: installing into $(VENV) (the first time only)"
	@.ci/make-venv "$(PYTHON)" $(VENV)
	@$(PIP) install --editable .
	@touch $@

# `pip install --group` came with pip 25.1; older ones take the same list as a requirements file.
$(VENV)/.installed-dev: $(VENV)/.installed
	@$(BIN)/python -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["dependency-groups"]["dev"], sep="\n")' > $(VENV)/dev-requirements.txt
	@$(PIP) install --requirement $(VENV)/dev-requirements.txt
	@touch $@
