#!/usr/bin/env bash
# The Python package from nothing: a venv, the package by pip, its tests. The profile `ci` builds in a fraction of the time of `release`.
set -euo pipefail
cd "$(dirname "$0")/.."
venv="target/python-venv"
[ -x "$venv/bin/python" ] || python3 -m venv "$venv"
# pip finds the builder of the venv.
export PATH="$PWD/$venv/bin:$PATH"
"$venv/bin/pip" install -q --disable-pip-version-check "maturin>=1.9,<2" numpy pytest pandas pyarrow control ray dask distributed
# The program that the package is held against; the tests of the root have built it already.
cargo build --locked --bin servotune
CARGO_TARGET_DIR=target/python "$venv/bin/pip" install -q --disable-pip-version-check --no-build-isolation --force-reinstall --no-deps . \
    -C build-args="--profile ci --locked"
"$venv/bin/python" -m pytest -q -x python/tests "$@"
