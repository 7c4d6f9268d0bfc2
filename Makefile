# shrm: `make demo` shows what it does, `make test` proves it. Both set themselves up in .venv.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SHRM := $(BIN)/shrm

# make batch PROBES="a.exr hdr/*.exr 'my probe.exr'" BRDFS="microfacet:sigma=0.1 phong:exponent=32"
# Words are those of a shell: quotes keep a name with spaces together.
PROBES ?= probes/*.exr
BRDFS ?= microfacet:sigma=0.1 microfacet:sigma=0.3 phong:exponent=32 lambertian
# make batch EPS=0.03: SHRMs of that tolerance, in place of the form whose picture is right
EPS ?=
# make batch FORMS="irradiance splitsum she" FLAGS_irradiance="--form zh3": what engines load
FORMS ?=
# The tests run in as many processes as there are processors; PYTEST_FLAGS="-x -k name" in one.
PYTEST_FLAGS ?= -n auto --dist worksteal
# make fuzz MINUTES=10 FUZZ_FLAGS="--seed 2 --case 345"
MINUTES ?= 10
FUZZ_FLAGS ?=
# make bench BENCH="start sphere": only these, or BENCH=--print, which leaves README as it is
BENCH ?=
# make torch TORCH='torch --index-url URL': a build for processors alone is a tenth as large
TORCH ?= torch
# make blender BLENDER_PYTHON=python3.11: the version that the wheels of bpy are for
BLENDER_PYTHON ?= python3.13
# make engines PROBE=probe.exr
PROBE ?=
# make tables TABLES_FLAGS="--short", or "--probes FOLDER" with real probes in another folder
TABLES_FLAGS ?=
# make taps TAPS_FLAGS="--probes FOLDER": the light that the look-ups of brushed GGX are fitted to
TAPS_FLAGS ?=
# make gallery GALLERY_FLAGS=--short: fewer pairs and smaller pictures
GALLERY_FLAGS ?=
# make survey MEASURED="a.bsdf b.binary": measured BRDFs beside the models; `make tables` draws two
MEASURED ?=
PREFILTER_FLAGS ?=
RENDER_FLAGS ?=
# make demo DEMO_FLAGS="--size 256": a larger picture, which takes longer
DEMO_FLAGS ?=

# The material of `make demo`: red paint under clear lacquer.
LACQUER := 0.9*lambertian:albedo=0.8/0.1/0.05+0.1*phong:exponent=64

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help install demo test prove web torch blender site man figures gallery .web-setup engines browser fuzz mutants bench tables survey scale taps probes batch clean distclean

help:
	@echo 'make demo      prefilter a sky with a sun, and show it beside the truth'
	@echo 'make test      lint, type-check and test'
	@echo 'make prove     the proofs that take long, which make test leaves out'
	@echo 'make web       test pages and exports in Chromium and in engines, all of which it sets up'
	@echo 'make browser   a page that prefilters a panorama without a server, in build/browser'
	@echo 'make torch     test gradients, with PyTorch, which it installs: up to 5 GB (see TORCH)'
	@echo 'make blender   test the extension and exports in Blender, which it installs as a module'
	@echo 'make engines   PROBE=x.exr: its light in engines of the web beside ours'
	@echo 'make fuzz      MINUTES=10: damaged and lying files, and what goes wrong with them'
	@echo 'make mutants   change the planner in hundreds of ways, and tell which ones no test notices'
	@echo 'make bench     measure against other tools, as ratios, into README'
	@echo "make tables    the paper's tables and figures, and what is seen, into build/paper/"
	@echo 'make survey    MEASURED="...": what all BRDFs cost, into build/paper/'
	@echo 'make scale     what batches take and what limits them, into build/paper/'
	@echo 'make taps      fit the look-ups of brushed GGX anew'
	@echo 'make site      the pages of docs/ and the reference, into build/site/; needs npm'
	@echo 'make man       man pages, and what shells complete by, into build/man/'
	@echo 'make figures   the figures of the theory, into docs/figures/'
	@echo 'make gallery   forms beside the truth, with bytes and errors, which the site then shows'
	@echo 'make probes    fetch real probes into probes/real (Debian and Ubuntu)'
	@echo 'make batch     PROBES="..." BRDFS="..." FORMS="...": bake every pair into build/'
	@echo 'make install   set up .venv with shrm in it'
	@echo 'make clean     remove what was built; make distclean: and .venv'

# ---- setting up -------------------------------------------------------------------------------

install: $(VENV)/.installed

# pip compiles what it copies, but not a checkout. Compiling at each start takes a third of a short run.
COMPILE = $(BIN)/python -m compileall -q shrm_cli || true

$(VENV)/.made:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo 'shrm needs Python 3.11 or newer; name one: make PYTHON=python3.12'; exit 1; }
	@$(PYTHON) -m venv $(VENV) || \
	  { echo 'No venv module; on Debian and Ubuntu: apt install python3-venv'; exit 1; }
	@touch $@

$(VENV)/.installed: $(VENV)/.made pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@$(COMPILE)
	@touch $@

# One run of pip sets up all. Python compiles what tests import when they import it first, which is a
# part of all these packages.
$(VENV)/.dev: $(VENV)/.made pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --editable '.[dev]'
	@$(COMPILE)
	@touch $(VENV)/.installed $@

# ---- the two commands -------------------------------------------------------------------------

# A sky with a bare sun, and what a lacquered ball reflects of it, beside the truth. The truth is a
# sum over all pixels for every point of the ball, and takes nearly all the time.
demo: $(VENV)/.installed
	@mkdir -p build/demo
	$(SHRM) probe sky --size 64 -o build/demo/sky.exr
	$(SHRM) prefilter build/demo/sky.exr --brdf '$(LACQUER)' -o build/demo/lacquer.shrm.exr
	$(SHRM) compare build/demo/lacquer.shrm.exr --probe build/demo/sky.exr --view 110,15 \
	  --no-flip -o build/demo/lacquer.png $(DEMO_FLAGS)
	@echo "The picture is $$(pwd)/build/demo/lacquer.png: truth, map, difference"

# The tests start hundreds of processes. Each would compile all of shrm again if no bytecode were kept.
test prove web torch blender: export PYTHONDONTWRITEBYTECODE :=
# Tests run on all processors already. Threads of products beside them would wait for each other.
test prove web: export OPENBLAS_NUM_THREADS := 1

# Types are checked on one processor for half a minute, beside the tests.
test: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy & types=$$!; \
	  $(BIN)/python -m pytest -m 'not proof' $(PYTEST_FLAGS); tests=$$?; \
	  wait $$types && exit $$tests

prove: $(VENV)/.dev
	$(BIN)/python -m pytest -m proof $(PYTEST_FLAGS)

# Chromium, and the engines at the versions of tests/web/package-lock.json. What cannot be had is said
# before .venv is filled, which takes long.
.web-setup: $(VENV)/.made
	@$(BIN)/python -B -m tests.web.install

$(VENV)/.web: $(VENV)/.dev
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[web-test]'
	@touch $@

web: .web-setup $(VENV)/.web
	SHRM_WEB=1 $(BIN)/python -m pytest tests/web tests/site $(PYTEST_FLAGS)

$(VENV)/.torch: $(VENV)/.dev
	$(BIN)/python -m pip install --quiet --disable-pip-version-check $(TORCH)
	@touch $@

torch: $(VENV)/.torch
	$(BIN)/python -m pytest tests/torch

# Blender as a module, in an environment of its own: it takes one version of Python.
$(VENV)-blender/.made:
	@$(BLENDER_PYTHON) -m venv $(VENV)-blender || \
	  { echo 'Blender as a module needs $(BLENDER_PYTHON) with venv; where is it? make blender BLENDER_PYTHON=PATH'; exit 1; }
	$(VENV)-blender/bin/python -m pip install --quiet --disable-pip-version-check bpy
	@touch $@

blender: $(VENV)/.dev $(VENV)-blender/.made
	SHRM_BLENDER=$(abspath $(VENV))-blender/bin/python $(BIN)/python -m pytest tests/export/engines/test_blender.py

engines: .web-setup $(VENV)/.web
	$(BIN)/python -m tests.web.table $(if $(PROBE),'$(PROBE)') -o build/engines

# examples/browser with all that it needs, for any web server. No browser takes part.
browser: $(VENV)/.made
	@$(BIN)/python -B -m tests.web.install --packages
	@$(BIN)/python -B examples/browser/build.py tests/web/node_modules build/browser

fuzz: $(VENV)/.dev
	$(BIN)/python -m tests.fuzz --minutes $(MINUTES) $(FUZZ_FLAGS)

# mutmut changes shrm_cli/plan in hundreds of ways, in a copy, and tells which ones no test notices.
mutants: $(VENV)/.dev
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[mutants]'
	rm -rf mutants
	$(BIN)/mutmut run
	$(BIN)/mutmut results
	@echo 'What each of them changes: $(BIN)/mutmut show NAME'

bench: $(VENV)/.dev
	$(BIN)/python -m tests.benchmarks $(BENCH)

tables: $(VENV)/.dev
	$(BIN)/python -m research build/paper $(TABLES_FLAGS) $(MEASURED)

# Without probes/real, which `make probes` fills, both take shipped probes.
survey: $(VENV)/.dev
	$(BIN)/python -m research build/paper --survey $(TABLES_FLAGS) $(MEASURED)

# A quarter of an hour of an idle machine; docs/scale.md takes its tables from it.
scale: $(VENV)/.dev
	$(BIN)/python -m research build/paper --scale $(TABLES_FLAGS)

# Five minutes; its tables are part of the package: nothing needs this unless the fit changes.
taps: $(VENV)/.dev
	$(BIN)/python -m research.taps $(TAPS_FLAGS)

probes:
	@bash probes/fetch.sh

# ---- the site ----------------------------------------------------------------------------------

# KaTeX typesets equations, and iframe-worker searches pages that are opened from a disk; they become
# a part of the site, which loads nothing from elsewhere.
$(VENV)/.site: $(VENV)/.installed tests/site/package-lock.json
	@command -v npm >/dev/null || { echo 'The site needs npm (Debian and Ubuntu: apt install npm)'; exit 1; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[site]'
	npm ci --silent --ignore-scripts --no-audit --no-fund --prefix tests/site
	@touch $@

site: $(VENV)/.site
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet --strict
	@echo "The site is build/site/index.html, which needs no server"

man: $(VENV)/.installed
	@$(BIN)/python -m tests.site.manual build/man
	@echo "The manual is in build/man/: man -l build/man/shrm.1"

# In one thread, whose sums are the same in every run.
figures: export OPENBLAS_NUM_THREADS := 1
figures: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[plots]'
	$(BIN)/python -m tests.site.figures docs/figures

gallery: $(VENV)/.installed
	$(BIN)/python -m tests.site.gallery build/gallery $(GALLERY_FLAGS)

# ---- batch ------------------------------------------------------------------------------------

# probes/batch.py has `shrm batch` bake what is out of date, because make itself cannot handle spaces,
# quotes, $ and % in names. The variables are handed over as they are, without being expanded.
HANDED := PROBES BRDFS FORMS EPS PREFILTER_FLAGS RENDER_FLAGS $(filter FLAGS_%,$(.VARIABLES))
$(foreach v,$(HANDED),$(eval export BATCH_$(v) := $$(value $(v))))
export BATCH_SHRM := $(SHRM)

# +: such lines are carried out in spite of -n, which probes/batch.py obeys itself.
batch: $(VENV)/.installed
	@+$(PYTHON) -B probes/batch.py

clean:
	rm -rf build mutants .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find examples research shrm_cli tests -name node_modules -prune -o -name __pycache__ -type d -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV) $(VENV)-blender shrm_cli.egg-info shrm_cli/_version.py tests/web/node_modules tests/site/node_modules
