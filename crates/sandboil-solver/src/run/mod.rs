//! State of a section and its stepping.

pub mod begin;
pub mod checkpoint;
pub mod clock;
pub mod domain;
pub mod forces;
pub mod ground;
#[cfg(test)]
mod limit_load_tests;
pub mod moving;
pub mod neighbour;
pub mod observers;
pub mod readout;
pub mod relaxing;
pub mod renewal;
pub mod simulation;
#[cfg(test)]
mod step_limit_tests;
pub mod time_step;
