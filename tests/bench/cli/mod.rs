//! The command line: one file per subcommand.

pub(crate) mod fixture;

mod server;

pub(crate) mod adapters;
mod algos;
mod bench;
mod calibrate_board;
mod calibrate_convert;
mod calibrate_distance;
mod compare;
mod copies;
mod counts;
mod datasets;
mod description;
mod drive;
mod eval;
mod exec;
mod figures;
mod filter;
mod firmware;
mod folder_truth;
mod help;
mod histories;
mod info;
pub mod interrupt;
mod label;
mod live;
mod losses;
mod matching;
mod merge;
mod messages;
mod own_data;
mod record;
mod rectify;
mod reference;
mod replay;
mod reproduce;
mod score;
mod score_recordings;
mod screens;
mod shard;
mod stress;
mod survive;
mod train;
mod tune;
mod videos;
