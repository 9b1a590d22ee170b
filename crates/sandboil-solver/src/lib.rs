//! Three-phase solver for saturated ground under static and seismic load: fields, momentum, flow, stress,
//! boundaries, stepping and stages. It knows no file and no Python.
//!
//! Equation numbers are those of Mhaski & Ramana (2025), CMES 142(1). Units: kN, m, s, Mg; stress tension
//! positive, pore pressure compression positive; x horizontal, y up.

mod balance;
mod banded;
pub mod base;
mod bins;
pub mod boundary;
pub mod column;
mod conduction;
mod contacts;
mod deformation;
mod dispersion;
mod energy;
pub mod error;
mod flow;
mod free_field;
mod free_surface;
mod geometry;
pub mod hydraulics;
pub mod model;
mod parallel;
mod phases;
mod rayleigh;
mod record;
mod run_out;
pub mod seepage;
pub mod shear_cell;
pub mod simulation;
mod skeleton;
mod soil_field;
#[cfg(test)]
mod spectrum_tests;
pub mod state;
mod still_water;
mod timestep;
mod water_edges;
mod wetting;

pub use base::{Base, BaseSegment, HalfSpace, Impedance, UpgoingWave, Vertical};
pub use boundary::{Outline, Side, Support};
pub use column::ColumnRecord;
pub use energy::ENERGY_NAMES;
pub use error::SolverError;
pub use hydraulics::{HydraulicBoundary, HydraulicCondition, Series};
pub use model::{
    AccelerationTerm, Conductivity, Diffusion, Model, Numerics, Operators, Region, Water, stress_node_offset,
};
pub use rayleigh::Rayleigh;
pub use run_out::RunOut;
pub use sandboil_sph::{Period, Vec2};
pub use seepage::{Seepage, SeepageCounters, Until, WaterBalance};
pub use shear_cell::{CellTest, Departure, ShearCell};
pub use simulation::{
    ACCELERATION_TERM_CONDUCTIVITY, Counters, Gravity, SHAKING_FACTOR, Shaking, Simulation,
};
pub use state::StateError;
pub use timestep::Criterion;
pub use water_edges::MovingBoundary;
