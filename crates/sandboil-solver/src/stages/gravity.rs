//! Gravity: ground at rest on held edges.

use crate::stages::stage::{
    BaseEdge, Damping, Displacements, Edges, End, Output, SideEdge, Stage, Surface, WaterReference,
};

/// Time-step factor of the stage. It needs no margin for stiffening, because soil is elastic.
const TIME_STEP_FACTOR: f64 = 0.85;

/// Static stage: gravity on held edges, relaxed by kinetic damping; soil elastic, pore pressure frozen.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Gravity {
    /// Largest unbalanced acceleration over gravity at which the ground is at rest.
    pub tolerance: f64,
    /// Number of steps after which the stage ends with an error.
    pub max_steps: u64,
}

impl From<Gravity> for Stage {
    fn from(Gravity { tolerance, max_steps }: Gravity) -> Self {
        Self {
            edges: Edges { base: BaseEdge::Held, sides: [SideEdge::Held, SideEdge::Held] },
            water_reference: WaterReference::AtRest,
            surface: Surface::Tied,
            displacements: Displacements::Small,
            damping: Damping::default(),
            conditions: Vec::new(),
            end: End::AtRest { tolerance, max_steps },
            time_step_factor: TIME_STEP_FACTOR,
            output: Output::default(),
        }
    }
}
