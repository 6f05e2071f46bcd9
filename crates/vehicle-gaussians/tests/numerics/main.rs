//! Behaviour at the limits of numbers: a contract for every stiff and extreme case, checked against the f64 reference.
//!
//! `docs/NUMERICS.md` is written from the tables here (`VG_BLESS=1 cargo test --test numerics`), and a test fails if it
//! differs from them.

mod cases;
mod document;
mod inputs;
mod measure;
mod properties;
mod refinement;
