//! Recordings: round trips, other programs' bags, damage, recovery.

mod bad_input;
pub(crate) mod bag;
mod bag_folders;
mod calibration_stamps;
mod damage;
mod disk;
mod drivers;
mod encodings;
mod extended;
mod foreign_bags;
mod foreign_readers;
pub(crate) mod frames;
mod hints;
mod kill;
mod live_topics;
mod poses;
mod realsense;
mod recovery;
mod ros1;
mod round_trip;
mod seek;
mod sensor;
mod sensor_truth;
mod stamps;
mod summary;
mod unchecked;
mod video;
