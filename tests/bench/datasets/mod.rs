//! The public data sets: their layouts on disk, their scenarios, and rejected input.

mod boards;
mod layouts;
mod scenarios;
mod tree;
