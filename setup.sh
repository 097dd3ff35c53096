#!/bin/sh
# Makes .venv, the project's own environment: the packages of requirements.lock, which the commands
# need, and the project itself, editable; then those of one more lock, where an argument names it, as in
# ./setup.sh requirements-test.lock. Run again, it adds what is missing and leaves the rest.
# PYTHON names the interpreter (default: python3). What uv and pip say goes to .venv/setup.log.
set -eu
cd "$(dirname "$0")"
python=${PYTHON:-python3}
extra=${1:-}

fail() {
    echo "smc-mujoco: $*" >&2
    exit 1
}

version() {
    "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null || true
}

wanted() { # all that the environment depends on: in a moved folder it is broken
    pwd
    cat pyproject.toml requirements.lock
}

create() {
    found=$(version "$python")
    [ -n "$found" ] || fail "needs Python 3.11 or newer and cannot run $python: install it, or name another: PYTHON=python3.12"
    [ "${found%%.*}" -eq 3 ] && [ "${found#*.}" -ge 11 ] ||
        fail "needs Python 3.11 or newer, but $python is $found: name another, as in PYTHON=python3.12"
    "$python" -c 'import ensurepip, venv' 2>/dev/null ||
        fail "$python has no venv module: install it (Debian, Ubuntu: apt-get install python3-venv)"
    echo "smc-mujoco: setting up .venv, once (two minutes of processor time, 1.1 GB)"
    said=$("$python" -m venv --clear .venv 2>&1) ||
        fail "$python could not make .venv: $(echo "$said" | tail -n 1)"
}

install() { # with uv, five times as fast, where it is on the path and succeeds; else with pip
    command -v uv >/dev/null &&
        uv pip install --python .venv/bin/python --no-deps ${again:+--reinstall} "$@" >>.venv/setup.log 2>&1 && return
    .venv/bin/python -I -m pip install --no-deps ${again:+--ignore-installed} "$@" >>.venv/setup.log 2>&1 && return
    if grep -qE 'ConnectionError|ConnectTimeout|ReadTimeout|NameResolution|ProxyError' .venv/setup.log; then
        fail "no network: the packages could not be downloaded; pip's output is in .venv/setup.log"
    fi
    fail "the packages could not be installed; pip's output is in .venv/setup.log"
}

have=$(version .venv/bin/python)
place=$(head -n 1 .venv/installed 2>/dev/null || true) # none after a broken installation
if [ -z "$have" ] || [ "$place" != "$(pwd)" ] || { [ -n "${PYTHON:-}" ] && [ "$have" != "$(version "$PYTHON")" ]; }; then
    create
fi
if [ "$(wanted)" != "$(cat .venv/installed 2>/dev/null)" ]; then
    rm -f .venv/installed # until all is there
    install --only-binary :all: --require-hashes -r requirements.lock
    install --no-build-isolation --no-index -e .
    wanted >.venv/installed
fi
if [ -n "$extra" ] && ! cmp -s "$extra" ".venv/$extra"; then
    [ "$extra" != requirements-test.lock ] || echo "smc-mujoco: adding $extra, once (0.8 GB)"
    [ ! -e .venv/adding ] || again=yes # uv was stopped: it takes a package that it had half copied for complete
    touch .venv/adding
    install --only-binary :all: --require-hashes -r "$extra"
    cp "$extra" .venv/
    rm -f .venv/adding
fi
