//! What is done to a section: run-out, free-field sides, seepage, and the shear cell.

pub mod column;
pub mod free_field;
pub mod run_out;
pub mod seepage;
pub mod shear_cell;
