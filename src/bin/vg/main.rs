//! The program `vg`.

fn main() {}
