//! Weights of the operators: neighbour lists, images beyond edges, rows of gradient weights, and their
//! tables.

pub mod balance;
pub mod corners;
pub mod free_surface;
pub mod geometry;
pub mod images;
pub mod lattice;
pub mod lists;
pub mod points;
pub mod printed;
pub mod rows;
pub mod stencils;
