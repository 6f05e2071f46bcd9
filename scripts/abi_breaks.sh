#!/usr/bin/env bash
# Breaks the ABI on purpose, one way at a time, and prints which tests notice. Works on a clean checkout only, and
# leaves it clean.
#
#     scripts/abi_breaks.sh
set -euo pipefail
cd "$(dirname "$0")/.."

if [ -n "$(git status --porcelain -- src include)" ]; then
    echo "src/ or include/ has changes that are not committed" >&2
    exit 1
fi
restore() { git checkout --quiet -- src include; }
trap restore EXIT

failing() {
    # Slow tests of behaviour are left out; the client is enough to tell.
    { cargo test --lib capi 2>&1; cargo test --test abi -- --skip valgrind --skip arguments --skip compiles_clean 2>&1; } |
        sed -n 's/^test \(.*\) \.\.\. FAILED$/    \1/p; s/^error\[\(.*\)/    does not compile: \1/p' || true
}

attempt() {
    local what=$1
    shift
    restore
    "$@"
    if git diff --quiet -- src include; then
        echo "$what: the change did not apply" >&2
        exit 1
    fi
    echo "$what:"
    failing
}

swap_fields() { perl -0pi -e 's/(    \/\/\/ A `vg_prior`[^\n]*\n    pub prior: i32,\n)(    \/\/\/ A `vg_symmetry`[^\n]*\n    pub symmetry: i32,\n)/$2$1/' src/capi/options.rs; }
change_number() { perl -0pi -e 's/Always = 1/Always = 3/' src/capi/options.rs; }
remove_function() { perl -0pi -e 's/#\[unsafe\(no_mangle\)\]\n(pub unsafe extern "C" fn vg_context_threads)/$1/' src/capi/context.rs; }
shrink_struct() { perl -pi -e 's/\[u64; 4\]/[u64; 3]/; s/\[0; 4\]/[0; 3]/' src/capi/camera.rs; }
change_type() { perl -0pi -e 's/fn vg_context_threads\(context: \*const vg_context\) -> u32/fn vg_context_threads(context: *const vg_context) -> u64/; s/w\.threads\.count\(\) as u32/w.threads.count() as u64/' src/capi/context.rs; }
change_comment() { perl -pi -e 's/Makes a context\./Makes one context./' src/capi/context.rs; }
change_behaviour() { perl -pi -e 's/sh_degree: 2,/sh_degree: 1,/' src/capi/options.rs; }

attempt "nothing but a word of a comment" change_comment
attempt "two fields of vg_options swapped" swap_fields
attempt "a number of vg_symmetry changed" change_number
attempt "vg_context_threads removed" remove_function
attempt "vg_camera shrunk by 8 bytes" shrink_struct
attempt "vg_context_threads returns 64 bits" change_type
attempt "a default changed" change_behaviour
