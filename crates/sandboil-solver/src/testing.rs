//! Sections that several tests use.

use crate::{
    section::{
        description::{
            AccelerationTerm, Conductivity, Diffusion, Model, Numerics, Operators, Region, STRESS_NODES,
        },
        outline::Outline,
    },
    stages::stage::{
        BaseEdge, Damping, Displacements, Edges, End, Output, SideEdge, Stage, Surface, WaterReference,
    },
};
use sandboil_soil::{Integrator, Soil, elastic::Elastic};
use sandboil_sph::{Period, Vec2};

/// A free block of nodes at unit spacing, `side` by `side`.
pub fn square_block(side: usize) -> Model {
    let position = (0..side * side).map(|k| Vec2::new((k % side) as f64, (k / side) as f64)).collect();
    block(position, None)
}

/// A block of nodes of unit volume at `position` in elastic ground, free unless a period is given.
pub fn block(position: Vec<Vec2>, period: Option<Period>) -> Model {
    let nodes = position.len();
    Model {
        spacing: Vec2::repeat(1.0),
        volume: vec![1.0; nodes],
        region: vec![0; nodes],
        regions: vec![Region {
            soil: Soil::Elastic(Elastic::new(1.0, 2.0).unwrap()),
            porosity: 0.5,
            solid_density: 2.0,
            hydraulic_conductivity: Conductivity::isotropic(0.0),
            retention: None,
            earth_pressure_coefficient: 0.5,
            static_poisson_ratio: 1.0 / 3.0,
        }],
        surface_elevation: vec![nodes as f64; nodes],
        vertical_effective_stress: vec![0.0; STRESS_NODES * nodes],
        pore_pressure: Vec::new(),
        saturation: Vec::new(),
        position,
        water: None,
        gravity: 10.0,
        period,
        outline: Outline::level(-100.0),
        numerics: Numerics {
            operators: Operators::Conservative,
            smoothing_ratio: 1.4,
            velocity_filter: 0.1,
            diffusion: Diffusion::Auto,
            acceleration_term: AccelerationTerm::Auto,
            dispersion_correction: false,
            geometry_strain_limit: None,
            integrator: Integrator::default(),
        },
    }
}

/// A stage of moving ground on held edges that does not end, with local damping and a factor of the time step.
pub fn held_stage(local_damping: f64, time_step_factor: f64) -> Stage {
    Stage {
        edges: Edges { base: BaseEdge::Held, sides: [SideEdge::Held, SideEdge::Held] },
        water_reference: WaterReference::AtRest,
        surface: Surface::Tied,
        displacements: Displacements::Small,
        damping: Damping { local: local_damping, ..Damping::default() },
        conditions: Vec::new(),
        end: End::After(f64::MAX),
        time_step_factor,
        output: Output { history_interval: 1e8, ..Output::default() },
    }
}
