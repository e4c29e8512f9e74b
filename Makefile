# make setup   .venv with everything in it, kernels compiled (once; again when the requirements change)
# make test    the tests                    make demo    the main job: table, plots; 3 to 8 minutes
# make check   format, lint and types       make format  put the format and imports right
# make docs    the site of docs/ and the docstrings, in build/site
# make build   the wheel, tried alone       make bench   time the parts of a control tick
# make clean   remove what was built (not .venv)
# make release   the wheel and the sdist, checked, and tried alone on each of PYTHONS; notes, and
#                the leaderboard's data for an archive such as Zenodo (.zenodo.json)
# make weekly  the tests that are marked so, which `make test` leaves out for time; then the examples that
#              need TorchRL, RLlib, RL Zoo, MoviePy, Optuna or Minari, each in a fresh environment;
#              EXTRAS="zoo video" some of them alone, EXTRAS= none
# make test-processors   the tests as other processors would run them, three times each: hours
# make lock    requirements.lock from constraints.txt      make audit   known holes in either
# make fleet   public humanoids of wheels: read, checked, stood and pushed; an hour; the table: docs/log/fleet.md
# make fuzz    malformed input of all kinds, MINUTES=30 WORKERS=1 SEED=number
#
# PYTHON311 names another interpreter; PIP_ARGS and PYTEST_ARGS are passed on, as in
# make test PYTEST_ARGS="-x tests/envs/robots/test_robot.py". LOCKED=1 lets setup take no file whose hash is not in
# requirements.lock.

PYTHON311 ?= $(shell command -v python3.11 || command -v python3)
PIP_ARGS ?=
PYTHONS ?= python3.11 python3.12 python3.13
EXTRAS ?= torchrl rllib zoo video optuna dataset
LOCKED ?=
PYTEST_ARGS ?=
# Files stay whole: what is made once a file is made in one worker.
PYTEST_WORKERS ?= -n auto --maxprocesses 4 --dist loadfile
MINUTES ?= 30
WORKERS ?= 1
SEED ?=
FUZZ_ARGS ?=
PYTHON := .venv/bin/python
STAMP := .venv/.poise-setup
FLEET := dm-control example-robot-data fourier-robot-descriptions gb-robot-models icub-models
DOCS := .venv/.poise-docs

.PHONY: setup test clips weekly test-processors demo check docs format build release bench fleet fuzz lock audit clean

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -m pip --version >/dev/null 2>&1 || $(PYTHON311) -m venv .venv
	$(if $(LOCKED),$(PYTHON) -m pip install -q $(PIP_ARGS) --require-hashes -r requirements.lock)
	$(PYTHON) -m pip install -q $(PIP_ARGS) -c constraints.txt setuptools
	$(PYTHON) -m pip install -q $(PIP_ARGS) -c constraints.txt --no-build-isolation -e ".[dev]"
	$(PYTHON) -m poise.baselines.warmup
	touch $@

test: setup
	$(PYTHON) -m pytest -q $(PYTEST_WORKERS) $(PYTEST_ARGS)

# The packaged clips, made again from their keyframes, and from a walk.
clips: setup
	$(PYTHON) -m poise.training.motion.recording
	$(PYTHON) -m poise.training.motion.gaits.recorded_walk

# Not in .venv: RLlib and the Zoo ask for other versions of Gymnasium than constraints.txt has. Of
# that file torch alone is held, so that no other build of it is pulled.
weekly: setup
	$(PYTHON) -m pytest -q -m weekly $(PYTEST_WORKERS) $(PYTEST_ARGS)
	mkdir -p build && grep '^torch==' constraints.txt > build/torch.txt
	failed=; for extra in $(EXTRAS); do \
		echo "$$extra:"; rm -rf build/weekly; $(PYTHON311) -m venv build/weekly && \
		build/weekly/bin/python -m pip install -q $(PIP_ARGS) -c build/torch.txt -e ".[$$extra]" pytest && \
		RAY_raylet_start_wait_time_s=600 \
		build/weekly/bin/python -m pytest -q -rs tests/integration/test_examples.py -k "test_$$extra" || \
		failed="$$failed $$extra"; \
	done; test -z "$$failed" || { echo "failed:$$failed"; exit 1; }

test-processors: setup
	$(PYTHON) -m tests.processors --repeat 3 $(PYTEST_ARGS)

demo: setup
	.venv/bin/poise demo

check: setup
	.venv/bin/ruff format --check .
	.venv/bin/ruff check .
	$(PYTHON) -m mypy

$(DOCS): $(STAMP)
	$(PYTHON) -m pip install -q $(PIP_ARGS) -c constraints.txt --no-build-isolation -e ".[docs]"
	touch $@

docs: $(DOCS)
	NO_MKDOCS_2_WARNING=1 .venv/bin/mkdocs build -q

format: setup
	.venv/bin/ruff check --fix .
	.venv/bin/ruff format .

# Not in .venv: these two are no part of what they look at.
build/audit:
	$(PYTHON311) -m venv $@
	$@/bin/python -m pip install -q $(PIP_ARGS) pip-audit pip-tools

lock: build/audit
	cp constraints.txt build/audit/constraints.in
	build/audit/bin/pip-compile -q --generate-hashes --allow-unsafe --strip-extras --no-annotate \
		--no-header --no-emit-find-links --no-emit-index-url --no-emit-trusted-host \
		-o build/audit/hashes.txt build/audit/constraints.in
	{ sed -n '/^#/p' requirements.lock; sed 's/+cpu / /; /^#/d; /^--/d' build/audit/hashes.txt; } \
		> build/audit/requirements.lock
	mv build/audit/requirements.lock requirements.lock

audit: build/audit
	build/audit/bin/pip-audit -r requirements.lock --disable-pip

# The second environment holds the wheel alone; its dependencies are those of .venv, by a path
# file, which does not bring the editable install with it.
build: setup
	rm -rf build/lib build/smoke dist
	$(PYTHON) -m build -q --no-isolation
	$(PYTHON) -m venv build/smoke
	build/smoke/bin/python -m pip install -q --no-index --no-deps dist/poise-*.whl
	$(PYTHON) -c "import sysconfig; print(sysconfig.get_path('purelib'))" \
		> $$(build/smoke/bin/python -c "import sysconfig; print(sysconfig.get_path('purelib'))")/main.pth
	cd build/smoke && bin/python -P ../../tests/smoke.py && bin/poise --help >/dev/null
	@ls dist

build/twine:
	$(PYTHON311) -m venv $@
	$@/bin/python -m pip install -q $(PIP_ARGS) twine

# Each of PYTHONS installs the wheel with its dependencies, and plays some trials.
release: build build/twine
	build/twine/bin/twine check --strict dist/*
	set -e; for python in $(PYTHONS); do \
		if ! $$python --version 2>/dev/null; then echo "$$python: not here, left out"; continue; fi; \
		rm -rf build/alone; $$python -m venv build/alone; \
		build/alone/bin/python -m pip install -q $(PIP_ARGS) -c constraints.txt dist/poise-*.whl; \
		(cd build/alone && bin/python -P ../../tests/smoke.py && bin/poise --version && \
		bin/poise evaluate momentum-qp zero --trials 4 --workers 1 --out trials >/dev/null); \
	done
	$(PYTHON) -c "import re, pathlib; print(re.split(r'(?m)^## ', pathlib.Path('CHANGELOG.md').read_text())[1])" \
		> dist/notes.md
	$(PYTHON) -m zipfile -c dist/poise-leaderboard.zip docs/results docs/leaderboard.md CITATION.cff LICENSE
	@ls dist

bench: setup
	$(PYTHON) -m tests.performance

# Not in .venv, and without what they need: only their models are read.
build/fleet:
	$(PYTHON) -m pip install -q $(PIP_ARGS) --no-deps --only-binary :all: --target $@ $(FLEET)

fleet: setup build/fleet
	$(PYTHON) -m tests.performance.fleet build/fleet --workers $(WORKERS) --write

fuzz: setup
	$(PYTHON) -m tests.fuzz --minutes $(MINUTES) --workers $(WORKERS) \
		$(if $(SEED),--seed $(SEED)) $(FUZZ_ARGS)

clean:
	rm -rf build dist *.egg-info .pytest_cache .ruff_cache .mypy_cache .hypothesis
