# Every target first sets up what it needs (setup.sh): .venv from the locks, once.
# Another interpreter than python3: PYTHON=python3.12 make demo

BIN := .venv/bin
UV ?= uv
LOCK := $(UV) pip compile --quiet --universal --python-version 3.11 --generate-hashes \
	--no-emit-index-url --no-annotate --custom-compile-command "make lock"

# the extra gpu, if it is missing; an environment that uv made has no pip
WITH_GPU = $(BIN)/python -c "import numba_cuda, mujoco_warp" 2>/dev/null || \
	$(UV) pip install --quiet --python $(BIN)/python -e ".[gpu]" 2>/dev/null || \
	$(BIN)/python -m pip install --quiet -e ".[gpu]" || \
	echo "smc-mujoco: could not install the extra gpu" >&2

.PHONY: help demo promised test slow quick attack mutants check docs lowest without entered tagged build gains gallery bench size gpu cardless newer lock setup sanitized snippets
.DEFAULT_GOAL := help

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-8s %s\n", $$1, $$2 }' Makefile

promised: demo check test docs ## all that a change must pass; the workflows run the same targets, each in a job

demo: setup ## the inverted pendulum under the paper's four laws: scores, traces, a figure, a film
	$(BIN)/smc-mujoco run scenes/inverted_pendulum.py

test: ## all tests but the slow ones, a file of them at a time on each core
	@./setup.sh requirements-test.lock
	$(BIN)/python -m pytest -n auto --dist loadfile -m "not slow"

slow: ## the tests of more than about 0.3 s each whose lines faster ones run, too; for releases, and daily
	@./setup.sh requirements-test.lock
	$(BIN)/python -m pytest -n auto --dist loadfile -m slow

quick: ## the first case of each test that takes little: two minutes, for every change
	@./setup.sh requirements-test.lock
	$(BIN)/python -m pytest --quick

attack: ## random scenarios and files by the thousand, for releases (7 minutes)
	@./setup.sh requirements-test.lock
	SEED=$${SEED:-$$(date +%s)} $(BIN)/python -m pytest tests/attack.py -n auto -o faulthandler_timeout=600 -o faulthandler_exit_on_timeout=true

mutants: ## small faults of ROOM=metrics, drawn from SEED, and which of them its tests find
	@./setup.sh requirements-test.lock
	@ROOM="$(ROOM)" SEED="$(SEED)" COUNT="$(COUNT)" $(BIN)/python tests/mutants.py

check: ## lint, format, types, and names that say what they hold
	@./setup.sh requirements-test.lock
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python -m pytest -q tests/test_names.py
	@# without this variable pyright asks the package index for a newer version of itself
	PYRIGHT_PYTHON_IGNORE_WARNINGS=1 $(BIN)/pyright --pythonpath $(BIN)/python

snippets: ## what a user's type checkers say of README's and the tutorial's scripts; for releases, and daily
	@./setup.sh requirements-test.lock
	$(BIN)/python tests/snippets.py .cache/snippets
	$(BIN)/mypy --follow-imports silent .cache/snippets
	PYRIGHT_PYTHON_IGNORE_WARNINGS=1 $(BIN)/pyright --pythonpath $(BIN)/python --project .cache/snippets

docs: ## the documentation as a site, site/index.html
	@./setup.sh requirements-docs.lock
	@# this variable leaves out the theme's notice that it is maintained until May 2027; --quiet would hide warnings from --strict
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict -f docs/site/mkdocs.yml

without: ## the quick tests in a copy without ANNEX=evidence, or several, and its tests, in .cache/without
	@./setup.sh requirements-test.lock
	@rm -rf .cache/without
	@mkdir -p .cache/without
	@git ls-files -z | tar --null --files-from - --create | tar --extract --directory .cache/without
	@cd .cache/without && for annex in $(ANNEX); do rm -r "smc_mujoco/$$annex" "tests/$$annex"; done
	cd .cache/without && PYTHONPATH=. ../../$(BIN)/python -m pytest --quick

sanitized: ## the tests of exported laws and FMUs, whose C is compiled with gcc's sanitizers
	@./setup.sh requirements-test.lock
	CC="gcc -fsanitize=address,undefined -fno-sanitize-recover=all" ASAN_OPTIONS=detect_leaks=0 \
		LD_PRELOAD="$$(gcc -print-file-name=libasan.so)" $(BIN)/python -m pytest -m "not slow" -k "not what_a_study_knows" \
		tests/exchange/fmu tests/exchange/c/test_load.py tests/exchange/c/test_joint_c.py

lowest: ## the quick tests under the oldest versions that pyproject.toml allows, in .cache/lowest
	@python3 -m venv --clear .cache/lowest
	@.cache/lowest/bin/python -m pip install --quiet uv
	@VIRTUAL_ENV=.cache/lowest .cache/lowest/bin/uv pip install --quiet --resolution lowest-direct -e ".[all,dm]" --group test
	NUMBA_CACHE_DIR=.cache/lowest/numba .cache/lowest/bin/python -m pytest --quick

entered: setup ## the one entry that the last commit or merge brings, in a suite
	$(BIN)/python .github/entered.py

tagged: ## whether TAG, such as v0.1.0, is the tag of this version
	@version=v$$(sed -n 's/^__version__ = "\(.*\)"$$/\1/p' smc_mujoco/common/version.py); test "$$TAG" = "$$version" || \
		{ echo "the tag is '$$TAG', and the version $$version: release the tag of the version" >&2; exit 1; }

build: setup ## the wheel and the source archive, in dist/
	$(BIN)/python -m hatchling build

gains: setup ## the laws' gains again, tuned by one rule (within 90 minutes on two cores)
	$(BIN)/python benchmarks/gains.py --all

gallery: setup ## the clips that README shows
	$(BIN)/python videos/gallery.py

bench: ## speed, beside bare MuJoCo and other packages, and where people wait
	@./setup.sh requirements-bench.lock
	$(BIN)/python benchmarks/speed.py
	$(BIN)/python benchmarks/engine.py
	$(BIN)/python benchmarks/realistic.py
	$(BIN)/python benchmarks/laws.py
	$(BIN)/python benchmarks/study.py --quick
	$(BIN)/python benchmarks/memory.py
	$(BIN)/python benchmarks/waits.py film comparison list help basin
	$(BIN)/python benchmarks/agents.py --quick

size: ## tokens by room, density, the largest files and functions, beside the last release's
	@python3 benchmarks/size.py

gpu: ## the engines on a CUDA device, beside the processor: within ten minutes; "no device" elsewhere
	@$(BIN)/python -c "import numba, mujoco" 2>/dev/null || ./setup.sh
	@# packages for a card, where there may be one
	@! command -v nvidia-smi >/dev/null || $(WITH_GPU)
	$(BIN)/python benchmarks/engine.py --cuda
	$(BIN)/python benchmarks/card.py

cardless: ## the code of every law for a card, compiled without one, and MuJoCo Warp's processor device
	@./setup.sh requirements-test.lock
	@$(WITH_GPU)
	$(BIN)/python -m pytest tests/analysis/test_engine_gpu.py tests/analysis/test_engine_warp.py

newer: ## says when the index has a MuJoCo after 4.0.0, whose solver is wrong
	@newest=$$(python3 -m pip index versions mujoco 2>/dev/null | sed -n '1s/.*(\(.*\))/\1/p'); \
	case "$$newest" in ""|3.*|4.0.0) ;; \
	*) echo "::warning::MuJoCo $$newest is on the index: see what its tests say" ;; esac

lock: ## the locks again from pyproject.toml, needs uv; delete a lock first to upgrade its packages
	@command -v $(UV) >/dev/null || { echo "make lock needs uv: see docs.astral.sh/uv" >&2; exit 1; }
	$(LOCK) pyproject.toml --extra dm --extra film --extra view --extra site --extra rl --group use -o requirements.lock
	@# the other locks leave out what requirements.lock has, except what it has only for Windows
	beside="-c requirements.lock $$(sed -n "/== 'win32'/!s/^\([a-z0-9.-]*\)==.*/--no-emit-package \1/p" requirements.lock)"; \
	$(LOCK) pyproject.toml --extra all --extra dm --extra cluster --group test --group check $$beside -o requirements-test.lock && \
	for group in bench docs; do \
		$(LOCK) --group $$group $$beside -c requirements-test.lock -o requirements-$$group.lock || exit; done

setup:
	@./setup.sh
