//! Size, alignment and offset of everything in the header, and every number, as compiled by C and C++ compilers.

use crate::contents::Contents;
use vg_testing::root;
use vg_testing::tools::{assert_golden, have};

#[test]
fn c_and_cxx_see_the_golden_layout() {
    if !cfg!(all(target_arch = "x86_64", target_pointer_width = "64")) {
        vg_testing::say("skipped: the golden layout is of x86-64");
        return;
    }
    let header = root().join("include/vg.h");
    let contents = Contents::of(&std::fs::read_to_string(&header).unwrap());
    assert!(
        contents.structs() >= 10 && contents.enumerators() >= 30,
        "too few structs or enumerators were parsed from the header"
    );
    let mut seen = Vec::new();
    for (compiler, standards) in
        [(vg_testing::tools::cc(), ["c11", "c2x"]), (vg_testing::tools::cxx(), ["c++17", "c++20"])]
    {
        if have(&compiler, "gcc g++", "layout") {
            seen.extend(standards.map(|standard| contents.printed_by(&compiler, standard, &header)));
        }
    }
    for printed in &seen {
        let why = "programs were compiled with the golden layout: a struct may only grow at its end, an enumeration \
                   only get new numbers; such a change is blessed with VG_BLESS=1";
        assert_golden(&vg_testing::tools::golden().join("layout_x86_64.txt"), printed, why);
    }
}
