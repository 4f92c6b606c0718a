# The two commands a newcomer needs are `make run` and `make test`. `make help` lists the rest.
.DEFAULT_GOAL := help
SHELL := /bin/bash
PYTHON ?= python3
BIN := .venv/bin
export PATH := $(CURDIR)/$(BIN):$(PATH)
# Where this is set, every start compiles every module anew: seconds for each process that a test starts.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: wheel release addon playground help run test test-all check check-style check-types check-imports check-pages check-docs check-supply setup setup-test lock format types bench sbom scope load evidence audit house equal screenshots docs api clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-12s %s\n", $$1, $$2}' Makefile

run: setup ## set everything up and start Exp 1-3 in the browser (PORT=8000)
	@$(BIN)/python tools/first_run.py

PYTEST = OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist loadscope --no-loadscope-reorder --rerun-show-tracebacks
test: setup-test ## set everything up and run the tests: Python, TypeScript, Chromium, a slice on PostgreSQL (tests/tiers.toml)
	@cd frontend && npm run --silent test
	@$(PYTEST) -m "not long" $(TESTS)

test-all: setup-test ## run every test, long ones too: Firefox, kill -9, attacks, R, both databases throughout
	@cd frontend && npm run --silent test
	@$(PYTEST) $(TESTS)

check: setup-test ## lint and type-check everything, import rules, lock files, known weaknesses
	@$(MAKE) --no-print-directory --jobs=6 --keep-going check-style check-types check-imports check-pages check-docs check-supply

# The parts of `check`, side by side once `make setup-test` is through; one that fails fails the whole, and make
# names it after the others have ended.
check-style:
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check -q .
	@$(BIN)/python tools/check_names.py
	@$(BIN)/python tools/check_unused.py
	@$(BIN)/python -m tools.check_docstrings
	@$(BIN)/python tools/reference.py --check

check-types:
	@$(BIN)/mypy
	@$(BIN)/mypy --explicit-package-bases --follow-imports=silent tools bench packages/screen_bench/screen_bench packages/blender_addon/addon_build

check-imports:
	@$(BIN)/lint-imports

check-pages:
	@cd frontend && npm run --silent typecheck && npm run --silent lint && npm run --silent api -- --check && npm run --silent size

check-docs: ## words, spelling, reading grades and links of the documentation (`make docs` fails on warnings)
	@$(BIN)/python -W ignore -m tools.check_language --pages

check-supply:
	@$(BIN)/python tools/check_lock_files.py
	@$(BIN)/python tools/sbom.py --check
	@$(BIN)/python tools/audit.py

setup:
	@$(PYTHON) tools/setup.py run

setup-test:
	@$(PYTHON) tools/setup.py test

format: setup-test ## rewrite Python and TypeScript in the house format
	@$(BIN)/ruff format -q . && $(BIN)/ruff check --fix -q .
	@cd frontend && npm run --silent format

RESOLVE = $(BIN)/uv pip compile -q --upgrade --universal --generate-hashes --no-header --no-annotate --python-version 3.11 pyproject.toml
# A checkout and the image have all that needs no account elsewhere.
RUN_EXTRAS = --extra track --extra render --extra deploy --extra parquet
lock: ## resolve the Python dependencies again, with hashes: what runs, what docs, tests and servers add
	@mkdir -p build
	@$(RESOLVE) --all-extras --group dev -o build/all.lock
	@$(RESOLVE) -c build/all.lock $(RUN_EXTRAS) -o requirements.lock
	@$(RESOLVE) -c build/all.lock $(RUN_EXTRAS) --extra s3 -o build/server.lock
	@$(RESOLVE) -c build/all.lock $(RUN_EXTRAS) --group docs -o build/docs.lock
	@$(BIN)/python tools/split_locks.py build/all.lock requirements.lock requirements-dev.lock
	@$(BIN)/python tools/split_locks.py build/docs.lock requirements.lock requirements-docs.lock
	@$(BIN)/python tools/split_locks.py build/server.lock requirements.lock deploy/s3.lock
	@$(BIN)/python tools/check_lock_files.py

bench: setup-test ## speed, memory and accuracy, as figures and ratios (long); goes on after a failure and lists it
	@FACEKIT="$(FACEKIT)" BLINK_SERIES="$(BLINK_SERIES)" $(BIN)/python -m bench $(BENCH)

screenshots: setup-test ## make the pictures of README and docs again (needs the clips of `make run`; PICTURES="builder")
	@PYTHONPATH=. $(BIN)/python tools/screenshots.py $(PICTURES)

scope: setup-test ## what reaches a virtual screen against what is recorded (hours; SCOPE=short, SCOPE="rows --plays 20")
	@$(BIN)/python -m screen_bench $(SCOPE)

load: setup-test ## real servers under load and kill -9, a table at the end (LOAD="--share 0.2 --only sqlite")
	@$(BIN)/python -m bench.load $(LOAD)

evidence: setup-test ## people and programs of every manner take part: who is caught, who is warned (EVIDENCE="--runs 20 --honest 100")
	@$(BIN)/python -m bench.evidence_table $(EVIDENCE)

equal: ## make the program's outputs at BASE=COMMIT and here, and compare them byte for byte (PARTS="help exports")
	@$(BIN)/python -m tools.equal $(BASE) $(PARTS)

house: ## how far the tree is from the plan of its files: counts, cycles, chains, names (HOUSE="--files" lists them)
	@$(PYTHON) -m tools.house $(HOUSE)

sbom: setup-test ## bill of materials (CycloneDX) and licences of all that a server runs: dist/sbom.cdx.json
	@$(BIN)/python tools/sbom.py

addon: setup ## build the Blender add-on: dist/palpebra_blinks-VERSION.zip
	@$(BIN)/python -m addon_build.addon

playground: setup ## build the blink engine's pages that open from a folder: dist/playground.html, dist/vrm.html
	@$(BIN)/python -m addon_build.playground

docs: setup-test ## write the reference pages from the code and build the documentation site, served at /docs
	@$(BIN)/python tools/reference.py
	@$(PYTHON) tools/setup.py docs

wheel: setup-test ## build the wheel and the sdist with pages, docs and the demo: dist/palpebra-VERSION-py3-none-any.whl
	@$(BIN)/python tools/build_wheel.py

release: setup-test ## wheel, sdist, bill of materials, checksums and release notes in dist/, after the upgrade test
	@$(BIN)/python tools/release.py

audit: setup-test ## ask the advisory databases about every locked package; says where none answered
	@$(BIN)/python tools/audit.py

clean: ## remove what the build made (never the data folder)
	@rm -rf frontend/dist frontend/node_modules .mypy_cache .ruff_cache .import_linter_cache build *.egg-info
