# What a person does with the project; `make` alone lists it.
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.installed

.DEFAULT_GOAL := help
.PHONY: help setup reach faults test lint docs bench speed clean

help: ## List the targets.
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 10

setup: $(STAMP) ## Prepare .venv, the pinned packages and the system libraries.

$(STAMP): pyproject.toml constraints.txt scripts/setup.sh scripts/install_packages.sh
	@PYTHON="$(PYTHON)" sh scripts/setup.sh
	@touch $@

reach: $(STAMP) ## Pepper reaches: the main job. ARGS="--live" shows it in a browser.
	@$(BIN)/python apps/reach.py $(ARGS)

faults: $(STAMP) ## Inject every fault into whole reaches; writes docs/faults.md. Takes hours.
	@$(BIN)/python apps/faults.py $(ARGS)
	@cp out/faults/faults.md docs/faults.md

# A process for each core: threads inside them would only wait for one another. Tests of a module
# stay together, as they share what it builds.
test: export OMP_NUM_THREADS = 1
test: export LP_NUM_THREADS = 1
# The processes that tests start find what others have compiled.
test: export PYTHONDONTWRITEBYTECODE =
test: export PEPPER_SCREENSHOTS = $(CURDIR)/out/screenshots
test: $(STAMP) ## Run the tests. ARGS="-k name" picks some.
	@sh scripts/browser.sh
	@$(BIN)/python -m pytest -n auto --dist worksteal $(ARGS)

lint: $(STAMP) ## Check format, lint and types.
	@$(BIN)/ruff format --check .
	@$(BIN)/ruff check .
	@$(BIN)/mypy

# Material for MkDocs announces its successor at each build; that is no warning about our pages.
docs: export NO_MKDOCS_2_WARNING = 1
docs: $(STAMP) ## Build the docs site in out/site; a warning fails it.
	@$(BIN)/mkdocs build --strict --quiet
	@echo "out/site/index.html"

bench: $(STAMP) ## Many scenes, methods side by side. ARGS="--gate": is anything worse than before?
	@$(BIN)/python apps/benchmark.py $(ARGS)

speed: $(STAMP) ## Measure speed, as ratios within one run.
	@$(BIN)/python -m pytest benchmarks --benchmark-enable --benchmark-only $(ARGS)

clean: ## Remove what the targets made.
	rm -rf .venv out .pytest_cache .mypy_cache .ruff_cache
