//! A folder of many pairs as a source.

pub(crate) mod cameras;
pub(crate) mod layout;
pub(crate) mod map_files;
pub(crate) mod pairs;
pub(crate) mod poses;
pub(crate) mod source;
pub(crate) mod stamps;
#[cfg(test)]
mod tests;
