# make compare    the main job; ARGS="..." adds options
# make test       the tests, but for those that take their time
# make slow       others: kills at every write, the soak's sample, README and examples, whatever takes seconds
# make thorough   those for which .ci/run has no time: longer commands of the documents, notebooks, more starts
# make soak       a hundred thousand inputs that make no sense, an hour; ARGS="1000" tries fewer
# make bench      every speed beside its bar and its peers, a quarter of an hour; ARGS="..." goes to pytest
# make lint       style and types
# make docs       the documentation, in results/site; `python3 -m http.server -d results/site` shows it
# make gallery    the documentation's films of walks, in docs/gallery
# PYTHON=...      the Python, 3.11 or newer, that .venv is made from

PYTHON ?= python3
INSTALL = -m pip --disable-pip-version-check --quiet install --no-compile
PROJECT = .venv/bin/python $(INSTALL) --constraint constraints.txt --editable
TWO_AT_ONCE = -p no:benchmark --numprocesses 2 --dist loadfile
GL_LIBRARIES = libEGL.so.1 libOpenGL.so.0
GL_PACKAGES = libegl1 libgl1-mesa-dri libopengl0
GL = $(if $(findstring libEGL.so.1,$(shell PATH="$$PATH:/sbin:/usr/sbin" ldconfig -p)),egl,disable)

.PHONY: compare test slow thorough soak bench lint docs gallery system browser
.DELETE_ON_ERROR:

compare: .venv/project system
	.venv/bin/hexmj compare --out results/compare $(ARGS)

test slow thorough: export MUJOCO_GL ?= $(GL)
test: .venv/dev system
	.venv/bin/python -m pytest -m "not (slow or thorough)" $(TWO_AT_ONCE) $(ARGS)

slow: .venv/dev system browser .venv/rl
	.venv/bin/python -m pytest -m "slow and not thorough" $(TWO_AT_ONCE) $(ARGS)

thorough: .venv/dev system
	.venv/bin/python -m pytest -m thorough $(TWO_AT_ONCE) $(ARGS)

soak: export MUJOCO_GL ?= $(GL)
soak: .venv/dev system
	.venv/bin/python -m tests.soak $(ARGS)

bench: export MUJOCO_GL ?= $(GL)
bench: .venv/dev system
	mkdir -p results/bench
	$(MAKE) .venv-flygym/ready || echo "flygym could not be installed; its rows are left out."
	.venv/bin/python -m pytest benchmarks --override-ini "python_files=bench_*.py" \
	    --benchmark-quiet --benchmark-json results/bench/benchmark.json $(ARGS)
	.venv/bin/python -m benchmarks.solver_settings results/bench
	.venv/bin/python -m benchmarks.scaling --out results/bench
	.venv/bin/python -m benchmarks.table results/bench

lint: .venv/dev
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/pyright

docs: .venv/dev
	NO_MKDOCS_2_WARNING=1 .venv/bin/python -m mkdocs build --quiet --strict

gallery: .venv/project system
	.venv/bin/python examples/gallery.py docs/gallery

# Rendering without a screen; where it cannot be installed, the rest goes on without it.
system:
	@missing=; root=; libraries=$$(PATH="$$PATH:/sbin:/usr/sbin" ldconfig -p); \
	for library in $(GL_LIBRARIES); do \
	    case "$$libraries" in *"$$library"*) ;; *) missing=yes ;; esac; \
	done; \
	test -z "$$missing" && exit; \
	test "$$(id -u)" = 0 || root="sudo -n"; \
	echo "Installing $(GL_PACKAGES), for rendering."; \
	{ $$root apt-get -qq update && \
	    $$root env DEBIAN_FRONTEND=noninteractive apt-get -qq install --no-install-recommends $(GL_PACKAGES); } \
	    >/dev/null 2>&1 || \
	echo "Rendering needs system packages that could not be installed here: apt-get install $(GL_PACKAGES)."

# A browser for the tests of pages, which are skipped without one.
browser:
	@for name in chromium chromium-browser google-chrome; do command -v $$name >/dev/null && exit; done; \
	root=; test "$$(id -u)" = 0 || root="sudo -n"; \
	echo "Installing chromium, for the tests of pages."; \
	{ $$root apt-get -qq update && \
	    $$root env DEBIAN_FRONTEND=noninteractive apt-get -qq install --no-install-recommends chromium; } \
	    >/dev/null 2>&1 || \
	echo "Tests of pages are skipped: chromium could not be installed here: apt-get install chromium."

.venv/begun:
	@$(PYTHON) -c "import ensurepip, venv" 2>/dev/null || \
	    { echo "$(PYTHON) cannot make virtual environments: apt-get install python3-venv."; exit 1; }
	$(PYTHON) -m venv .venv
	.venv/bin/python $(INSTALL) "pip>=25.1"  # the first with dependency groups
	touch $@

.venv/project: .venv/begun pyproject.toml constraints.txt
	$(PROJECT) ".[film]"
	touch $@

# A peer with other versions of MuJoCo; its OpenCV is replaced by the one that needs no libGL.
.venv-flygym/ready: benchmarks/flygym.txt
	$(PYTHON) -m venv .venv-flygym
	.venv-flygym/bin/python $(INSTALL) --requirement benchmarks/flygym.txt
	.venv-flygym/bin/python $(INSTALL) --no-deps --force-reinstall "opencv-python-headless<5"
	touch $@

.venv/dev: .venv/begun pyproject.toml constraints.txt
	$(PROJECT) ".[film,search,gym,dask,view,docs]" --group dev
	touch .venv/project $@

# stable-baselines3 and torch, for tests of learning, which are skipped without them.
.venv/rl: .venv/dev
	@echo "Installing stable-baselines3, for the tests of learning; its torch may be gigabytes."
	@$(PROJECT) ".[rl]" && touch $@ || \
	echo "Tests of learning are skipped: stable-baselines3 could not be installed here: pip install '.[rl]'."
