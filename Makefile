# Everything a user or a developer runs. Each target sets up what it needs in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
EXTRAS ?= dev

.PHONY: demo test check bench bench-mcu golden clean

$(VENV)/.run: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --editable .
	touch $@

$(VENV)/.$(EXTRAS): $(VENV)/.run
	$(BIN)/pip install --quiet --editable '.[$(EXTRAS)]'
	touch $@

demo: $(VENV)/.run  ## fake autopilot + daemon + log + error table
	$(BIN)/h2nav demo --log-dir logs

test: $(VENV)/.$(EXTRAS)  ## every test
	$(BIN)/pytest -n auto

check: $(VENV)/.$(EXTRAS)  ## lint, format, types, import rules
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(VENV)/.$(EXTRAS)  ## speed of parser, filter, live loop, next to their peers
	for part in wire filter batch recording live; do $(BIN)/python tools/bench_$$part.py || exit 1; done

bench-mcu: $(VENV)/.$(EXTRAS)  ## instructions, flash and memory of the exported filter on Cortex-M
	$(BIN)/python tools/bench_mcu.py

golden: $(VENV)/.$(EXTRAS)  ## rewrite the golden outputs; the data diff is the review
	$(BIN)/pytest tests/replay --update-golden

clean:
	rm -rf $(VENV) build *.egg-info
