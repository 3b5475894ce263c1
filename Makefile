# make compare    the main job; ARGS="..." adds options
# make test       quick tests, under three minutes on two cores; ARGS="..." goes to pytest
# make slow       the other tests: README, examples, notebooks, browser, training
# make oldest     every feature with the oldest versions that pyproject.toml allows, in .venv/oldest
# make bench      every speed beside a peer, under ten minutes; ARGS="..." goes to pytest
# make lint       style and types
# make docs       the documentation, in results/site; `python3 -m http.server -d results/site` serves it
# make results    all results and the tables and figures of the pages; hours
# make gallery    the documentation's films of walks, in docs/images
# PYTHON=...      the Python, 3.11 or newer, for .venv

PYTHON ?= python3
INSTALL = -m pip --disable-pip-version-check --quiet install --no-compile
PROJECT = .venv/bin/python $(INSTALL) --constraint constraints.txt --editable
TWO_AT_ONCE = -p no:benchmark --numprocesses 2 --dist loadfile
GL_LIBRARIES = libEGL.so.1 libOpenGL.so.0
GL_PACKAGES = libegl1 libgl1-mesa-dri libopengl0
GL = $(if $(findstring libEGL.so.1,$(shell PATH="$$PATH:/sbin:/usr/sbin" ldconfig -p)),egl,disable)

LEAGUE = uncoordinated hws ldvs ldvs-tripod own own-0.3 own-0.5 robust-0.1 lasting lasting-0.3 wilson graham graham-random \
    walknet walknet-reacog walknet-load cpg-tripod cpg-tetrapod cpg-wave flygym-rules righetti tegotae evolved free

.PHONY: compare test slow oldest bench lint docs results gallery system browser
.DELETE_ON_ERROR:

compare: .venv/project system
	.venv/bin/hexmj compare --precision 0.05 --out results/compare $(ARGS)

test slow oldest bench: export MUJOCO_GL ?= $(GL)
test: .venv/dev system
	.venv/bin/python -m pytest -m "not slow" $(TWO_AT_ONCE) $(ARGS)

slow: .venv/dev system browser .venv/rl
	.venv/bin/python -m pytest -m slow $(TWO_AT_ONCE) $(ARGS)

oldest: system
	$(PYTHON) -m venv --clear .venv/oldest
	.venv/oldest/bin/python $(INSTALL) uv
	.venv/oldest/bin/uv pip install --quiet --python .venv/oldest --resolution lowest-direct ".[search,gym,dask,view]"
	.venv/oldest/bin/python tests/features.py

bench: .venv/dev system
	mkdir -p results/bench
	cache=$$(mktemp -d); trap 'rm -rf "$$cache"' EXIT; NUMBA_CACHE_DIR=$$cache .venv/bin/python -m pytest benchmarks \
	    --override-ini "python_files=bench_*.py" --benchmark-quiet --benchmark-json results/bench/benchmark.json $(ARGS)
	.venv/bin/python -m benchmarks.table results/bench

lint: .venv/dev
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/pyright

docs: .venv/dev
	NO_MKDOCS_2_WARNING=1 .venv/bin/python -m mkdocs build --quiet --strict

results: bench
	.venv/bin/python -m benchmarks.scaling
	.venv/bin/hexmj biology --processes 2
	.venv/bin/python examples/insects.py
	.venv/bin/hexmj reproduce --beside lasting --processes 2
	.venv/bin/hexmj league --processes 2
	for varied in "vp 40 80 160" "centre-of-mass -2 0 2" "standing-height 8 10 12" "landing-time 10 20 40" \
	    "step-height 4 12" "friction 0.5 1"; do \
	    .venv/bin/hexmj compare --controller ldvs --velocity 0.5 --starts 400 --$$varied \
	        --out results/sensitivity/$${varied%% *} || exit 1; \
	done
	.venv/bin/hexmj compare --controller ldvs --velocity 0.3 0.5 0.7 --vp 20 40 80 160 --starts 400 --seed 66 \
	    --out results/dynamic
	.venv/bin/hexmj compare --controller ldvs --velocity 0.1 0.2 0.3 0.4 0.5 0.6 0.7 0.8 0.9 --precision 0.03 \
	    --out results/over_v
	.venv/bin/hexmj compare --controller $(LEAGUE) --velocity 0.5 --starts 200 --seed 17 --processes 2 \
	    --out results/everyone
	.venv/bin/python docs/results.py

gallery: .venv/project system
	.venv/bin/python examples/gallery.py docs/images

# Libraries for rendering without a display; everything else works without them.
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

# A browser for the tests of pages, which are skipped without it.
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
	$(PROJECT) .
	touch $@

.venv/dev: .venv/begun pyproject.toml constraints.txt
	$(PROJECT) ".[search,gym,dask,view,docs]" --group dev
	touch .venv/project $@

# stable-baselines3 and torch, for tests of learning, which are skipped without them.
.venv/rl: .venv/dev
	@echo "Installing stable-baselines3, for the tests of learning; its torch may be gigabytes."
	@$(PROJECT) ".[rl]" && touch $@ || \
	echo "Tests of learning are skipped: stable-baselines3 could not be installed here: pip install '.[rl]'."
