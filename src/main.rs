//! The `surfel` command.

fn main() {}
