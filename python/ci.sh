#!/usr/bin/env bash
# The Python package from nothing: a venv, the package by pip, its tests, the floor on Ray with two workers.
# Ends with 75, and says so, where no package registry is in reach.
# `python/ci.sh dask` and `python/ci.sh spark` run the floor on those engines instead.
set -euo pipefail
cd "$(dirname "$0")/.."
packages="pytest pandas pyarrow control ray<2.64 nbclient ipykernel"
chosen=()
case "${1:-}" in
    "") ;;
    dask) packages="pytest pyarrow dask distributed" chosen=(-k dask) ;;
    spark)
        packages="pytest pyarrow pyspark" chosen=(-k spark)
        command -v java >/dev/null || { apt-get update -qq && apt-get install -y -qq default-jre-headless; }
        ;;
    *) echo "found '$1'; expected nothing, dask or spark" >&2 && exit 2 ;;
esac
python3 -c "import ensurepip, venv" 2>/dev/null || { apt-get update -qq && apt-get install -y -qq python3 python3-venv; }
venv="$PWD/target/python-venv"
[ -x "$venv/bin/pip" ] || python3 -m venv "$venv"
# pip finds the builder of the venv.
export PATH="$venv/bin:$PATH"
pip install -q --disable-pip-version-check "maturin>=1.9,<2" "numpy>=1.23" || {
    echo "no package registry in reach: the Python package is not tested" >&2 && exit 75
}
# shellcheck disable=SC2086
pip install -q --disable-pip-version-check $packages
# The folder and the profile of the root's own tests: what they have compiled is not compiled again.
export CARGO_TARGET_DIR="$PWD/target"
# The program that the package is held against.
cargo build --locked --bin servotune
pip install -q --disable-pip-version-check --no-build-isolation --force-reinstall --no-deps . -C build-args="--profile dev --locked"
SERVOTUNE="$CARGO_TARGET_DIR/debug/servotune" python -m pytest -q -x "${chosen[@]}" python/tests
