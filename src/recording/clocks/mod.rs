//! The clock of each topic, by the proof beside its stamps: the log times.

pub(crate) mod faults;
pub(crate) mod measure;
pub(crate) mod pixels;
pub(crate) mod scan;
pub(crate) mod table;
#[cfg(test)]
mod tests;
