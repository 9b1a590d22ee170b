//! State of a section and its stepping.

pub mod begin;
pub mod checkpoint;
pub mod clock;
pub mod domain;
pub mod forces;
pub mod ground;
pub mod moving;
pub mod neighbour;
pub mod observers;
pub mod readout;
pub mod relaxing;
pub mod renewal;
pub mod simulation;
pub mod time_step;
