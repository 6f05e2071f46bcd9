//! The second witness.
