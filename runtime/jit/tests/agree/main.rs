//! The machine code against the reference interpreter: every outcome of every program must be equal.

mod bench;
mod defects;
mod faults;
mod generator;
mod operators;
mod random;
mod shapes;
