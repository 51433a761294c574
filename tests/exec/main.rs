//! The plug-in protocol, with programs that keep it and programs that break it.
#![cfg(feature = "exec")]

mod breach;
mod fixture;
mod keeping;
mod settings;
