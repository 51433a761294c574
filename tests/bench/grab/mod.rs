//! The synchronized frames grabber, on a scripted clock: no test here can fail for a slow machine.

mod balance;
mod coordination;
mod failure;
mod pairing;
mod queue;
mod stage;
