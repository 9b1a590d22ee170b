//! Shaking: small displacements above a compliant base.

use crate::{
    edges::base::Base,
    skeleton::rayleigh::Rayleigh,
    stages::{
        column_record::ColumnRecord,
        stage::{
            BaseEdge, Damping, Displacements, Edges, End, Output, SideEdge, Stage, Surface, WaterReference,
        },
    },
    water::moving_edges::MovingBoundary,
};

/// Default time-step factor of moving ground: a margin, because soil can stiffen between updates of the time step.
pub const MOVING_FACTOR: f64 = 0.6;

/// Dynamic stage on a compliant base.
#[derive(Debug, Clone, PartialEq)]
pub struct Shaking {
    /// Duration, s.
    pub duration: f64,
    /// The base and the waves that enter through it.
    pub base: Base,
    /// Whether the left and the right side are free-field sides; otherwise they are held as in the static stage.
    pub free_field: [bool; 2],
    /// Records of the columns of the left and the right side under the same motion; a column with a record is
    /// not solved.
    pub column_records: [Option<ColumnRecord>; 2],
    /// Local damping `xi_l` of Eq. 16.
    pub local_damping: f64,
    /// Rayleigh damping, if any.
    pub rayleigh: Option<Rayleigh>,
    /// Hydraulic conditions. An edge without one is impermeable, except the ground surface, which keeps its pressure.
    pub conditions: Vec<MovingBoundary>,
    /// Factor on the stability limit of the time step.
    pub time_step_factor: f64,
    /// Histories and envelopes to record.
    pub output: Output,
}

impl From<Shaking> for Stage {
    fn from(shaking: Shaking) -> Self {
        let [left, right] = shaking.column_records;
        let side = |free_field: bool, record: Option<ColumnRecord>| {
            if free_field { SideEdge::FreeField(record) } else { SideEdge::Held }
        };
        Self {
            edges: Edges {
                base: BaseEdge::Compliant(shaking.base),
                sides: [side(shaking.free_field[0], left), side(shaking.free_field[1], right)],
            },
            water_reference: WaterReference::AtRest,
            surface: Surface::Tied,
            displacements: Displacements::Small,
            damping: Damping { local: shaking.local_damping, rayleigh: shaking.rayleigh, viscosity: None },
            conditions: shaking.conditions,
            end: End::After(shaking.duration),
            time_step_factor: shaking.time_step_factor,
            output: shaking.output,
        }
    }
}
