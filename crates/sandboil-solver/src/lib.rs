//! Three-phase solver for saturated and partly saturated ground under static and seismic load: fields, momentum,
//! flow, stress, boundaries, stepping and stages. It reads and writes no files and does not depend on Python.
//!
//! Equation numbers are those of Mhaski & Ramana (2025), CMES 142(1). Units: kN, m, s, Mg; stress tension
//! positive, pore pressure compression positive; x horizontal, y up.

mod edges;
mod error;
mod linear;
mod neighbours;
mod parallel;
mod run;
mod section;
mod shear_cell;
mod skeleton;
mod stages;
#[cfg(test)]
mod testing;
mod water;
mod weights;

pub use edges::base::{Base, BaseSegment, HalfSpace, Impedance, UpgoingWave, Vertical};
pub use error::{SolverError, StateError};
pub use neighbours::identity::column_identities;
pub use run::{
    begin::ACCELERATION_TERM_CONDUCTIVITY, checkpoint, clock::Counters, observers::energy::ENERGY_NAMES,
    time_step::Criterion,
};
pub use sandboil_sph::{Period, Vec2};
pub use section::{
    description::{
        AccelerationTerm, Conductivity, Diffusion, Model, Numerics, Operators, Region, Water,
        stress_node_offset,
    },
    outline::{Outline, Side, Support},
    stress_layout::stress_positions,
};
pub use shear_cell::{CellTest, Departure, ShearCell};
pub use skeleton::rayleigh::Rayleigh;
pub use stages::{
    column_record::ColumnRecord,
    gravity::Gravity,
    rules::{Choices, RULES, Rule, broken},
    run_out::RunOut,
    shaking::{MOVING_FACTOR, Shaking},
    stage::{BaseEdge, Damping, Displacements, Edges, End, Output, SideEdge, Stage, Surface, WaterReference},
};
pub use water::{
    conditions::{HydraulicBoundary, HydraulicCondition, Series},
    moving_edges::MovingBoundary,
    seepage::{Seepage, SeepageCounters, Until, WaterBalance},
};

/// A section under successive stages, with free-field columns where a stage has free-field sides.
pub type Simulation = run::simulation::Driver<neighbours::free_field::FreeField>;
