#!/usr/bin/env bash
# Lists which lines of the C interface its own tests and tests/abi run: a table, and each line that is not run.
#
#     scripts/coverage.sh [PATH]      PATH: the folder to report on (default: src/capi)
#
# Needs LLVM's tools of the compiler's own LLVM version: `rustup component add llvm-tools`, or the packages of
# apt.llvm.org.
set -euo pipefail
cd "$(dirname "$0")/.."
path=${1:-src/capi}

version=$(rustc -vV | sed -n 's/^LLVM version: \([0-9]*\).*/\1/p')
tools=$(rustc --print sysroot)/lib/rustlib/$(rustc -vV | sed -n 's/^host: //p')/bin
tool() {
    if [ -x "$tools/$1" ]; then
        echo "$tools/$1"
    elif command -v "$1-$version" >/dev/null; then
        echo "$1-$version"
    else
        echo "coverage: neither $tools/$1 nor $1-$version was found" >&2
        exit 1
    fi
}
profdata=$(tool llvm-profdata)
cov=$(tool llvm-cov)

export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-target}/coverage
profiles=$(mktemp -d)
trap 'rm -rf "$profiles"' EXIT
export LLVM_PROFILE_FILE=$profiles/%p-%m.profraw RUSTFLAGS="-Cinstrument-coverage"

cargo test --locked --package libvg --lib
cargo test --locked --package libvg --test abi
objects=$(cargo test --locked --package libvg --lib --test abi --no-run 2>&1 | sed -n 's/.*(\(.*\))$/--object \1/p')
objects+=" --object $CARGO_TARGET_DIR/debug/libvg.so"

"$profdata" merge --sparse "$profiles"/*.profraw -o "$profiles/all.profdata"
# shellcheck disable=SC2086
"$cov" report --instr-profile "$profiles/all.profdata" $objects --sources "$path"
# shellcheck disable=SC2086
"$cov" show --instr-profile "$profiles/all.profdata" $objects --sources "$path" |
    grep -E '^/|^ *[0-9]+\| *0\|' || true
