//! The public data sets: their layouts on disk, their scenarios, and what is refused.

mod archive;
mod boards;
mod layouts;
mod scenarios;
mod tree;
