// The library of a robot. Its README is the front page of its documentation.
#![doc = include_str!("README.md")]

pub mod depth;
pub mod doubt;
mod error;
pub mod filter;
pub mod matcher;
pub mod ranger;
pub mod rectify;
pub mod stereo;
pub mod timing;
mod words;

pub use error::{Error, Result};

// For svl's own packages, here and below: no part of the interface.
#[doc(hidden)]
pub mod bounded;
#[doc(hidden)]
pub mod inputs;
#[doc(hidden)]
pub mod interrupt;
#[doc(hidden)]
pub mod kernel;
#[doc(hidden)]
pub mod nanoseconds;
#[doc(hidden)]
pub mod statistics;
#[doc(hidden)]
pub use error::{alternatives, did_you_mean, nearest};
#[doc(hidden)]
pub use words::{counted, joined, listed, printable, printable_line};
