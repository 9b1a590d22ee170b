//! Linear systems.

pub mod banded;
pub mod conjugate_gradients;
