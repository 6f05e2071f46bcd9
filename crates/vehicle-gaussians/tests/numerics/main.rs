//! What happens at the limits of numbers: a contract for every stiff and extreme case, held to the f64 reference.
//!
//! `docs/NUMERICS.md` is written from the tables here (`VG_BLESS=1 cargo test --test numerics`), and a test fails where
//! it says anything else.

mod cases;
mod document;
mod inputs;
mod measure;
mod properties;
mod refinement;
