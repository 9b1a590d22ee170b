//! Comparison of the whole solver with closed forms, through its public interface.
#![allow(clippy::unwrap_used)] // a failure is the test's own report
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // row counts of small columns

mod common;
mod consolidation;
mod free_field;
mod half_space;
mod moving_water;
mod open_edges;
mod rayleigh;
mod resume;
mod run_out;
mod seepage;
mod shear_cell;
mod stages;
mod submerged;
mod wave_column;
mod waves;
