# `make demo` and `make test` do all their own set-up on a fresh machine.
SHELL := /bin/bash
BIN := .venv/bin

.PHONY: help setup demo test test-slow lint clean

help:
	@echo "make demo       set up, then run the example (uwsim demo)"
	@echo "make test       set up, then run the tests that are not slow"
	@echo "make test-slow  set up, then run the slow tests"
	@echo "make lint       check style and formatting"
	@echo "make setup      make .venv and see to libLLVM (again: does nothing)"
	@echo "make clean      remove .venv, caches and build products"

setup:
	@scripts/setup.sh

demo: setup
	$(BIN)/uwsim demo --show

test: setup
	$(BIN)/python -m pytest -m "not slow"

test-slow: setup
	$(BIN)/python -m pytest -m slow

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

clean:
	rm -rf .venv build dist .pytest_cache .ruff_cache *.egg-info
	find uwsim tests -name __pycache__ -type d -prune -exec rm -rf {} +
