//! The synchronized frame grabber on a scripted clock, so that no test depends on the speed of the
//! machine.

mod balance;
mod coordination;
mod failure;
mod pairing;
mod queue;
mod stage;
