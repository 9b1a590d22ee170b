//! Description of a stage: independent choices of edges, water, damping and output. Gravity, shaking and run-out are
//! presets.

use crate::{
    edges::base::{Base, BaseSegment},
    error::SolverError,
    section::{description::positive, outline::Hand},
    skeleton::rayleigh::Rayleigh,
    stages::column_record::ColumnRecord,
    water::moving_edges::MovingBoundary,
};
use sandboil_sph::Vec2;

/// Loading, boundaries, damping and output of a stage.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Stage {
    /// Base and sides.
    pub edges: Edges,
    /// Pore pressure at which the excess is zero.
    pub water_reference: WaterReference,
    /// Surface at which pore water drains.
    pub surface: Surface,
    /// How far the ground may move.
    pub displacements: Displacements,
    /// Damping in addition to that of the soil.
    pub damping: Damping,
    /// Hydraulic conditions. An edge without one is impermeable, except the ground surface, which keeps its pressure.
    pub conditions: Vec<MovingBoundary>,
    /// When the stage ends.
    pub end: End,
    /// Factor on the stability limit of the time step.
    pub time_step_factor: f64,
    /// Histories and envelopes to record.
    pub output: Output,
}

/// Base and sides of a stage.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Edges {
    /// The base.
    pub base: BaseEdge,
    /// The left and the right side.
    pub sides: [SideEdge; 2],
}

/// The base in a stage.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum BaseEdge {
    /// Held as its support prescribes.
    Held,
    /// Compliant: waves pass through it.
    Compliant(Base),
}

/// A side in a stage.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum SideEdge {
    /// Held as its support prescribes.
    Held,
    /// Next to a free-field column. With a record of the same column under the same motion the column is not solved.
    FreeField(Option<ColumnRecord>),
    /// Removed.
    Open,
}

/// Pore pressure at which the excess is zero.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum WaterReference {
    /// The pressure of each node at rest; a node keeps it when it moves.
    AtRest,
    /// The pressure of still water at the present position of each node.
    StillWater {
        /// Surface of the water from left to right, m; no water if empty. `None`: the water surface of the
        /// static stage.
        line: Option<Vec<Vec2>>,
    },
}

/// Surface at which pore water drains.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Surface {
    /// The ground surface of the model: the nodes at it stay the same.
    Tied,
    /// Found from the present positions of the nodes.
    Found,
}

/// How far the ground may move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Displacements {
    /// Nodes keep their neighbours. After a renewal of the geometry constant forces keep the balance.
    Small,
    /// Nodes change their neighbours and may separate from all others. Weight and still water act at the
    /// present positions.
    Large,
}

/// Damping in addition to that of the soil.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Damping {
    /// Local damping `xi_l` of Eq. 16.
    pub local: f64,
    /// Rayleigh damping, if any.
    pub rayleigh: Option<Rayleigh>,
    /// Coefficient `alpha` of the artificial viscosity, if any.
    pub viscosity: Option<f64>,
}

/// When a stage ends.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum End {
    /// When the ground is at rest. Soil is elastic, pore pressure is frozen, and time has no physical meaning.
    AtRest {
        /// Largest unbalanced acceleration over gravity at which the ground is at rest.
        tolerance: f64,
        /// Number of steps after which the stage ends with an error.
        max_steps: u64,
    },
    /// After a duration, s.
    After(f64),
}

/// Histories and envelopes that a stage records.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Output {
    /// Points at which histories are recorded, m.
    pub probes: Vec<Vec2>,
    /// Interval of the histories, s.
    pub history_interval: f64,
    /// Whether stress and strain are also recorded at the probes.
    pub stress_histories: bool,
    /// Whether the largest excess pressure of each node is recorded.
    pub pressure_envelope: bool,
    /// Whether the largest shear strain of each stress node is recorded.
    pub strain_envelope: bool,
    /// Interval at which free-field columns are recorded, s; `None`: they are not.
    pub record_columns: Option<f64>,
}

impl Stage {
    /// Which sides are free-field sides.
    pub fn free_field(&self) -> [bool; 2] {
        self.edges.sides.each_ref().map(|side| matches!(side, SideEdge::FreeField(_)))
    }

    /// Which sides are removed.
    pub fn open(&self) -> [bool; 2] {
        self.edges.sides.each_ref().map(|side| matches!(side, SideEdge::Open))
    }

    /// The compliant base, if the stage has one.
    pub fn compliant_base(&self) -> Option<&Base> {
        match &self.edges.base {
            BaseEdge::Compliant(base) => Some(base),
            BaseEdge::Held => None,
        }
    }

    /// Refuses values outside their range.
    ///
    /// # Errors
    /// [`SolverError::InvalidInput`] with the first value found.
    pub fn validate(&self) -> Result<(), SolverError> {
        let Self { end, time_step_factor, output, damping, .. } = self;
        positive("time_step_factor", *time_step_factor)?;
        if let End::After(duration) = end {
            positive("duration", *duration)?;
            positive("history_interval", output.history_interval)?;
        }
        if let Some(rayleigh) = &damping.rayleigh {
            rayleigh.validate()?;
        }
        match damping.viscosity {
            Some(value) if !(value >= 0.0 && value.is_finite()) => {
                let (name, expected) = ("viscosity", "zero or a positive number");
                Err(SolverError::InvalidInput { name, value, expected })
            }
            _ => Ok(()),
        }
    }

    /// Drops the records of the columns, after the columns have copied them.
    pub fn forget_column_records(&mut self) {
        for side in &mut self.edges.sides {
            if let SideEdge::FreeField(record) = side {
                *record = None;
            }
        }
    }

    /// Record of the column of a side, if there is one; the column is then not solved.
    pub fn column_record(&self, hand: Hand) -> Option<&ColumnRecord> {
        match &self.edges.sides[hand as usize] {
            SideEdge::FreeField(record) => record.as_ref(),
            SideEdge::Held | SideEdge::Open => None,
        }
    }

    /// Duration, s; infinite for a stage that ends at rest.
    pub fn duration(&self) -> f64 {
        match self.end {
            End::After(duration) => duration,
            End::AtRest { .. } => f64::INFINITY,
        }
    }

    /// The same stage for a column between periodic sides, shaken by the wave of one segment of the base.
    /// `lowest` (m) is the elevation to which arrival times refer if the base has no datum.
    #[must_use]
    pub fn of_column(&self, segment: BaseSegment, lowest: f64) -> Self {
        let base = match &self.edges.base {
            BaseEdge::Held => BaseEdge::Held,
            BaseEdge::Compliant(base) => {
                let wave = segment.wave.map(|wave| base.waves[wave].clone());
                BaseEdge::Compliant(Base {
                    vertical: base.vertical,
                    half_space: base.half_space,
                    segments: vec![BaseSegment { wave: wave.as_ref().map(|_| 0), ..segment }],
                    waves: wave.into_iter().collect(),
                    datum: Some(base.datum.unwrap_or(lowest)),
                })
            }
        };
        Self {
            edges: Edges { base, sides: [SideEdge::Held, SideEdge::Held] },
            conditions: Vec::new(),
            output: Output { history_interval: self.output.history_interval, ..Output::default() },
            ..self.clone()
        }
    }
}
