//! Bags as users name them: MCAP, ROS 1, SQLite, folders of files; index and header.

pub(crate) mod bag;
pub(crate) mod container;
pub(crate) mod header;
pub(crate) mod index;
pub(crate) mod opened;
pub(crate) mod ros1_bag;
pub(crate) mod sqlite;
