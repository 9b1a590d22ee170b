//! Run-out: large displacements on held edges under the ground's own weight.

use crate::stages::stage::{
    BaseEdge, Damping, Displacements, Edges, End, Output, SideEdge, Stage, Surface, WaterReference,
};
use sandboil_sph::Vec2;

/// Stage in which the ground may flow until it comes to rest.
#[derive(Debug, Clone, PartialEq)]
pub struct RunOut {
    /// Duration, s.
    pub duration: f64,
    /// Coefficient `alpha` of the artificial viscosity.
    pub viscosity: f64,
    /// Whether the left and the right side are removed.
    pub open: [bool; 2],
    /// Surface of the still water around the ground, from left to right, m; no water if empty. `None`: the
    /// water surface of the static stage.
    pub still_water: Option<Vec<Vec2>>,
    /// Local damping `xi_l` of Eq. 16.
    pub local_damping: f64,
    /// Factor on the stability limit of the time step.
    pub time_step_factor: f64,
    /// Histories and envelopes to record.
    pub output: Output,
}

impl From<RunOut> for Stage {
    fn from(run_out: RunOut) -> Self {
        let side = |open: bool| if open { SideEdge::Open } else { SideEdge::Held };
        Self {
            edges: Edges { base: BaseEdge::Held, sides: run_out.open.map(side) },
            water_reference: WaterReference::StillWater { line: run_out.still_water },
            surface: Surface::Found,
            displacements: Displacements::Large,
            damping: Damping {
                local: run_out.local_damping,
                rayleigh: None,
                viscosity: Some(run_out.viscosity),
            },
            conditions: Vec::new(),
            end: End::After(run_out.duration),
            time_step_factor: run_out.time_step_factor,
            output: run_out.output,
        }
    }
}
