# The habits of the project. Everything happens in .venv, made on first use.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: run test lint bench clean

run: .venv/run.stamp            ## a minute of the watchman's night on the emulated robot
	$(BIN)/khepera-hil --program watchman --scenario night --seed 8 --duration 60

test: .venv/dev.stamp           ## all tests
	$(BIN)/python -m pytest

lint: .venv/dev.stamp           ## ruff and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: .venv/dev.stamp          ## speed; prints, never fails
	$(BIN)/python -m benchmarks

.venv/run.stamp: pyproject.toml constraints.txt
	test -d .venv || $(PYTHON) -m venv .venv || { rm -rf .venv; exit 1; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	touch $@

.venv/dev.stamp: .venv/run.stamp
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev]"
	touch $@

clean:
	rm -rf .venv build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
