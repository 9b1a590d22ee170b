//! Three-phase solver for saturated ground under static and seismic load: fields, momentum, flow, stress,
//! boundaries, stepping and stages. It knows no file and no Python.
//!
//! Equation numbers are those of Mhaski & Ramana (2025), CMES 142(1). Units: kN, m, s, Mg; stress tension
//! positive, pore pressure compression positive; x horizontal, y up.

mod edges;
mod error;
mod linear;
mod parallel;
mod run;
mod section;
mod skeleton;
mod stages;
#[cfg(test)]
mod testing;
mod water;
mod weights;

pub use edges::base::{Base, BaseSegment, HalfSpace, Impedance, UpgoingWave, Vertical};
pub use error::{SolverError, StateError};
pub use run::{
    checkpoint,
    energy::ENERGY_NAMES,
    simulation::{ACCELERATION_TERM_CONDUCTIVITY, Counters, Gravity, SHAKING_FACTOR, Shaking, Simulation},
    time_step::Criterion,
};

pub use sandboil_sph::{Period, Vec2};
pub use section::{
    description::{
        AccelerationTerm, Conductivity, Diffusion, Model, Numerics, Operators, Region, Water,
        stress_node_offset,
    },
    outline::{Outline, Side, Support},
};

pub use skeleton::rayleigh::Rayleigh;
pub use stages::{
    column::ColumnRecord,
    run_out::RunOut,
    seepage::{Seepage, SeepageCounters, Until, WaterBalance},
    shear_cell::{CellTest, Departure, ShearCell},
};

pub use water::{
    conditions::{HydraulicBoundary, HydraulicCondition, Series},
    moving_edges::MovingBoundary,
};
