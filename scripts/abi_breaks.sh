#!/usr/bin/env bash
# Breaks the ABI on purpose, in one way at a time, and prints which tests notice. Fails if none does. Needs a clean
# checkout, and leaves it clean.
#
#     scripts/abi_breaks.sh            all ways
#     scripts/abi_breaks.sh WORDS      those whose name contains these words
set -euo pipefail
cd "$(dirname "$0")/.."

if [ -n "$(git status --porcelain -- src include crates)" ]; then
    echo "src/ or include/ has changes that are not committed" >&2
    exit 1
fi
restore() { git checkout --quiet -- src include crates; }
trap restore EXIT
only=${1:-}
unnoticed=0

failing() {
    # Slow tests of behaviour are left out; the client is enough to detect them.
    { cargo test --package libvg --lib 2>&1; cargo test --package libvg --test abi -- --skip valgrind --skip arguments --skip compiles_clean 2>&1; } |
        sed -n 's/^test \(.*\) \.\.\. FAILED$/    \1/p; s/^error\[\(.*\)/    does not compile: \1/p' || true
}

attempt() {
    local what=$1 found
    shift
    case $what in
    *"$only"*) ;;
    *) return ;;
    esac
    restore
    "$@"
    if git diff --quiet -- src include crates; then
        echo "$what: the change did not apply" >&2
        exit 1
    fi
    echo "$what:"
    found=$(failing)
    if [ -z "$found" ]; then
        found="    NOT NOTICED"
        unnoticed=1
    fi
    echo "$found"
}

swap_fields() { perl -0pi -e 's/(    \/\/\/ A `vg_prior`[^\n]*\n    pub prior: i32,\n)(    \/\/\/ A `vg_symmetry`[^\n]*\n    pub symmetry: i32,\n)/$2$1/' src/capi/options.rs; }
change_number() { perl -0pi -e 's/Always = 1/Always = 3/' src/capi/options.rs; }
remove_function() { perl -0pi -e 's/#\[unsafe\(no_mangle\)\]\n(pub unsafe extern "C" fn vg_context_threads)/$1/' src/capi/context.rs; }
shrink_struct() { perl -pi -e 's/\[u64; 4\]/[u64; 3]/; s/\[0; 4\]/[0; 3]/' src/capi/camera.rs; }
change_type() { perl -0pi -e 's/fn vg_context_threads\(context: \*const vg_context\) -> u32/fn vg_context_threads(context: *const vg_context) -> u64/; s/w\.threads\.count\(\) as u32/w.threads.count() as u64/' src/capi/context.rs; }
change_comment() { perl -pi -e 's/Makes a context\./Makes one context./' src/capi/context.rs; }
change_behaviour() { perl -pi -e 's/sh_degree: i32::from\(rust\.sh_degree\),/sh_degree: 1,/' src/capi/options.rs; }

# Changes of meaning with the same fields, names and numbers, which no type shows.
change_default() { perl -pi -e 's/^(            photo:) i32::from\(rust\.photo\),/$1 0,/' src/capi/options.rs; }
swap_length_and_width() { perl -pi -e 's/\|b\| b\.size_m\)/|b| [b.size_m[1], b.size_m[0], b.size_m[2]])/' src/capi/report.rs; }
seconds_for_milliseconds() { perl -pi -e 's/total_ms: report\.total_ms,/total_ms: report.total_ms \/ 1e3,/' src/capi/report.rs; }
change_sign() { perl -pi -e 's/\|c\| c\.lateral_m\)/|c| -c.lateral_m)/' src/capi/report.rs; }
swap_log_levels() { perl -pi -e 's/vg_log_level::(Info|Debug), \|\| format/"vg_log_level::" . ($1 eq "Info" ? "Debug" : "Info") . ", || format"/e' src/capi/reconstruct.rs; }
swap_keep_bits() { perl -pi -e 's/KeepItem::(Overlap|Floaters) => &mut/"KeepItem::" . ($1 eq "Overlap" ? "Floaters" : "Overlap") . " => &mut"/e' crates/vehicle-gaussians/src/pipeline/options.rs; }
swap_precision_and_recall() { perl -pi -e 's/errors\.(precision|recall),/"errors." . ($1 eq "recall" ? "precision" : "recall") . ","/e' src/capi/metrics.rs; }
swap_red_and_blue() { perl -pi -e 's/Background::Color\(self\.background_color\)/Background::Color({ let [r, g, b] = self.background_color; [b, g, r] })/' src/capi/render.rs; }

attempt "nothing but a word of a comment" change_comment
attempt "two fields of vg_options swapped" swap_fields
attempt "a number of vg_symmetry changed" change_number
attempt "vg_context_threads removed" remove_function
attempt "vg_camera shrunk by 8 bytes" shrink_struct
attempt "vg_context_threads returns 64 bits" change_type
attempt "a default changed" change_behaviour
attempt "another default changed" change_default
attempt "length and width of the box swapped" swap_length_and_width
attempt "seconds for milliseconds" seconds_for_milliseconds
attempt "the sign of a shift changed" change_sign
attempt "two levels of the log swapped" swap_log_levels
attempt "two bits of vg_keep swapped" swap_keep_bits
attempt "precision and recall swapped" swap_precision_and_recall
attempt "red and blue of the background swapped" swap_red_and_blue
exit $unnoticed
