//! What the functions do with NULL, zero, bad numbers and sizes.
