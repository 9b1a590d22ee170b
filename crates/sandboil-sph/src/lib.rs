//! Kernels, neighbour lists and particle operators on scattered nodes in the plane.
//!
//! This crate knows geometry only: positions, volumes and images in; sparse weight tables out.
//! It knows no soil, no water and no time.

pub mod kernel;
pub mod neighbours;
pub mod operators;
pub mod sparse;

/// A point or vector in the plane, metres: `x` horizontal, `y` up.
pub type Vec2 = nalgebra::Vector2<f64>;
/// A second-order tensor in the plane.
pub type Mat2 = nalgebra::Matrix2<f64>;

pub use kernel::WendlandQuintic;
pub use neighbours::{Neighbour, NeighbourList, Period, Source};
pub use operators::{GradientWeight, LeastSquaresFit, OperatorError};
pub use sparse::Csr;
