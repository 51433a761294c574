//! The exec protocol, with programs that follow it and programs that break it.

mod breach;
mod fixture;
mod keeping;
mod settings;
