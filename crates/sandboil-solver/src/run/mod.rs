//! State of a section and its stepping.

pub mod checkpoint;
pub mod energy;
pub mod histories;
pub mod section_view;
pub mod simulation;
pub mod time_step;
