# Everything a user or a developer runs. Each target sets up what it needs in .venv.
PYTHON ?= python3
EXTRAS ?= dev
VENV := .venv
BIN := $(VENV)/bin
# A third of the time would go into the bytecode of modules that nothing imports.
INSTALL = $(BIN)/pip install --quiet --disable-pip-version-check --no-compile --editable
comma := ,
# The installation follows its declaration and what its compiled part is made from.
SOURCES := pyproject.toml setup.py $(wildcard native/*.[ch] h2nav/translate/*.py h2nav/attitude/record.py $(shell $(PYTHON) h2nav/attitude/kernel_files.py))
FOR_DEMO := $(VENV)/.installed
FOR_TESTS := $(VENV)/.installed-$(subst $(comma),-,$(EXTRAS))

.PHONY: help demo test test-thorough check install bench bench-mcu fuzz mutants soak attack image deb arm64 wheels golden clean python
# Without bytecode on disk each of the hundreds of processes that the tests start compiles anew.
unexport PYTHONDONTWRITEBYTECODE
# Two targets at once would install into one environment; pytest uses all cores by itself.
.NOTPARALLEL:

help:  ## this list
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / { printf "make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: $(FOR_DEMO)  ## fake autopilot + daemon + log + error table; needs nothing but Python
	@$(BIN)/h2nav demo --log-dir logs

test: $(FOR_TESTS)  ## the tests, but for the long proofs
	@$(BIN)/pytest -n auto --dist worksteal -m 'not thorough'

test-thorough: $(FOR_TESTS)  ## the long proofs: microcontrollers, recorded flights, browsers, an attacked daemon, ...
	@$(BIN)/pytest -n auto --dist worksteal -m thorough

check: $(FOR_TESTS)  ## lint, format, types, import rules
	@$(BIN)/ruff check --quiet .
	@$(BIN)/ruff format --quiet --check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports

install: $(FOR_TESTS)  ## .venv with the extras of EXTRAS=dev,...

bench: $(FOR_TESTS)  ## speed of parser, filter, log, live loop, next to their peers
	@for part in wire filter batch recording live; do $(BIN)/python tools/bench_$$part.py || exit 1; done

bench-mcu: $(FOR_TESTS)  ## instructions, flash and memory of the exported filter on Cortex-M and AVR
	@$(BIN)/python tools/bench_mcu.py

soak: $(FOR_TESTS)  ## 24 simulated hours through the whole pipeline: does anything grow?
	@$(BIN)/python tools/soak.py

attack: $(FOR_TESTS)  ## every known attack on the daemon as a process, some 15 minutes
	@$(BIN)/python tools/attack

image: python  ## the container, built without Docker and tried; needs root, buildah and mmdebstrap
	@$(PYTHON) tools/image.py

deb: python  ## Debian packages for SUITE=bookworm ARCH=amd64, built and tried in clean roots; needs root and mmdebstrap
	@$(PYTHON) tools/debian_package.py build $(if $(SUITE),--suite $(SUITE)) $(if $(ARCH),--arch $(ARCH))
	@$(PYTHON) tools/debian_package.py check $(if $(SUITE),--suite $(SUITE)) $(if $(ARCH),--arch $(ARCH))

arm64:  ## the same for arm64, under qemu-user
	@$(MAKE) --no-print-directory deb ARCH=arm64

wheels: python  ## the wheels of a release for ARCH=amd64 and every machine, and the source archive; needs the same
	@$(PYTHON) tools/wheels.py $(if $(ARCH),--arch $(ARCH))

fuzz: $(FOR_TESTS)  ## made-up input for everything that takes any, for MINUTES=5
	@$(BIN)/python tools/fuzz.py explore --minutes $(or $(MINUTES),5)

mutants: $(FOR_TESTS)  ## N=300 small faults put into ROOMS=service,reviews,recordings,...: which does no test notice?
	@$(BIN)/python tools/mutants.py -n $(or $(N),300) --seed $(or $(SEED),1) $(if $(ROOMS),--rooms $(ROOMS))

golden: $(FOR_TESTS)  ## rewrite the golden outputs; the data diff is the review
	@$(BIN)/pytest tests/replay --update-golden

clean:  ## remove what the other targets made, logs excepted
	@rm -rf $(VENV) build *.egg-info h2nav/attitude/_native*.so

# What a tool needs beyond Python it asks for itself (tools/programs.py).
python:
	@command -v $(PYTHON) >/dev/null || { echo "not installed: $(PYTHON); apt-get install -y python3-venv" >&2; exit 1; }
	@$(PYTHON) tools/programs.py

$(BIN)/python: | python
	@$(PYTHON) tools/programs.py ensurepip
	@$(PYTHON) -m venv $(VENV)

$(FOR_DEMO): $(SOURCES) | $(BIN)/python
	@echo "installing into $(VENV), half a minute the first time"
	@$(INSTALL) .
	@touch $@

$(FOR_TESTS): $(SOURCES) | $(BIN)/python
	@echo "installing into $(VENV) with $(EXTRAS), a few minutes the first time"
	@$(INSTALL) '.[$(EXTRAS)]'
	@touch $@ $(FOR_DEMO)
