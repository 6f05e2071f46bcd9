//! The promise of the C ABI: everything that a program built against a release may rely on.
//!
//! One test fails for each kind of break:
//!
//! | changed | caught by |
//! | --- | --- |
//! | a word of the header | `header` |
//! | a function added or gone | `symbols` |
//! | a field moved or resized, an enumerator's number | `layout`, and a second check in `src/capi/tests.rs` |
//! | a parameter's or field's type | `abidiff` |
//! | the name that a program loads | `soname` |
//! | a default | `defaults` |
//! | the meaning of a number | `meaning`, and its namesake `src/capi/tests/meaning.rs` |
//! | the behaviour of a call | `client`, a program compiled against the header of its release |
//! | its results | `buffers` |
//! | its behaviour with bad arguments | `arguments` |
//!
//! `VG_BLESS=1 cargo test --test abi` rewrites the golden files, for a change that `CHANGELOG.md` explains.
//! `VG_NO_SKIP=1` makes a missing tool a failure.

// The tests call C functions.
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
