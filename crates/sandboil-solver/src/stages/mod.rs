//! Description of a stage, its presets gravity, shaking and run-out, and the table of choices that exclude each other.

pub mod column_record;
pub mod gravity;
pub mod rules;
pub mod run_out;
pub mod shaking;
pub mod stage;
