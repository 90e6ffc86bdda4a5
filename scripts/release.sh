#!/bin/sh
# Release archives for Linux, and whether the program compiles for other systems as far as this machine can tell.
#   scripts/release.sh [OUT]     OUT: folder of the archives, target/dist by default
#   CHECK_ONLY=1 scripts/release.sh     only the other systems
set -eu
cd "$(dirname "$0")/.."
out=${1:-target/dist}
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' Cargo.toml)
host=$(rustc -vV | sed -n 's/^host: //p')

archive() {
    target=$1
    cargo build --locked --release --bin servotune --target "$target"
    name=servotune-$version-$target
    folder=$out/$name
    rm -rf "$folder"
    mkdir -p "$folder/completions" "$folder/man"
    program=target/$target/release/servotune
    cp "$program" README.md LICENSE "$folder/"
    # Words for the shells come from the program itself, so this target must run here.
    for shell in bash zsh fish powershell; do
        "$program" completions "$shell" > "$folder/completions/servotune.$shell"
    done
    "$program" completions man > "$folder/man/servotune.1"
    # The same bytes for the same sources: order, owners and times are fixed.
    tar --sort=name --owner=0 --group=0 --numeric-owner --mtime='2026-01-01 00:00Z' -C "$out" -cf - "$name" | gzip -n > "$out/$name.tar.gz"
    rm -rf "$folder"
    (cd "$out" && sha256sum "$name.tar.gz" > "$name.tar.gz.sha256")
    echo "archive: $out/$name.tar.gz"
}

# Compiles without linking: needs the target's standard library, and for SQLite a C compiler of that system.
compiles() {
    target=$1
    if ! rustup target list --installed 2>/dev/null | grep -qx "$target"; then
        echo "not checked: $target (rustup target add $target)"
        return
    fi
    if cargo check --locked --bin servotune --target "$target"; then
        echo "compiles: $target"
    elif cargo check --locked --package servotune --package servotune-report --target "$target"; then
        echo "compiles without the fleet: $target (SQLite needs a C compiler of that system)"
    else
        echo "DOES NOT COMPILE: $target"
        failed=1
    fi
}

failed=0
mkdir -p "$out"
[ "${CHECK_ONLY:-}" ] || archive "$host"
for target in x86_64-pc-windows-gnu x86_64-apple-darwin aarch64-apple-darwin aarch64-unknown-linux-gnu; do
    compiles "$target"
done
exit $failed
