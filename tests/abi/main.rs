//! The promise of the C ABI: what a program that was built against a release may rely on.
//!
//! Each kind of break has one test that names it:
//!
//! | changed | caught by |
//! | --- | --- |
//! | a word of the header | `header` |
//! | a function added or gone | `symbols` |
//! | a field moved or resized, an enumerator's number | `layout`, and a second witness in `src/capi/tests.rs` |
//! | a parameter's or field's type | `abidiff` |
//! | the name a program asks the loader for | `soname` |
//! | a default | `defaults` |
//! | what a number means | `meaning`, and its namesake `src/capi/tests/meaning.rs` |
//! | what a call does | `client`, a program compiled against the header of its release |
//! | what comes out of it | `buffers` |
//! | what it does with bad arguments | `arguments` |
//!
//! `VG_BLESS=1 cargo test --test abi` rewrites the golden files, for a change that `CHANGELOG.md` argues for.
//! `VG_NO_SKIP=1` makes a missing tool a failure.

// The tests are callers of C functions.
#![allow(unsafe_code)]

mod abidiff;
mod abixml;
mod align;
mod arguments;
mod buffers;
mod client;
mod contents;
mod defaults;
mod gradients;
mod header;
mod layout;
mod meaning;
mod pictures;
mod symbols;
