//! Kernels, neighbour lists and particle operators on scattered nodes in the plane.
//!
//! This crate treats geometry only: its input is positions, volumes and images; its output is sparse tables of weights.
//! It contains no soil, no water and no time.

pub mod kernel;
pub mod neighbours;
pub mod operators;
pub mod sparse;

/// A point or vector in the plane: `x` horizontal, `y` up; m for positions.
pub type Vec2 = nalgebra::Vector2<f64>;
/// A second-order tensor in the plane.
pub type Mat2 = nalgebra::Matrix2<f64>;

pub use kernel::WendlandQuintic;
pub use neighbours::{Neighbour, NeighbourList, Period, Source};
pub use operators::{GradientWeight, LeastSquaresFit, OperatorError};
pub use sparse::Csr;
