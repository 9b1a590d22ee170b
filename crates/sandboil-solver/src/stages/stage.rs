//! A stage: independent choices of what is done to a section. Gravity, shaking and run-out are presets of it.

use crate::{
    edges::base::{Base, BaseSegment},
    error::SolverError,
    section::{description::positive, outline::Hand},
    skeleton::rayleigh::Rayleigh,
    stages::column_record::ColumnRecord,
    water::moving_edges::MovingBoundary,
};
use sandboil_sph::Vec2;

/// What is done to a section, and what is recorded of it.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Stage {
    /// Base and sides.
    pub edges: Edges,
    /// Pore pressure that counts as no excess.
    pub water_reference: WaterReference,
    /// The surface across which pore water drains.
    pub surface: Surface,
    /// How far the ground may move.
    pub displacements: Displacements,
    /// What takes energy from the motion beside the soil.
    pub damping: Damping,
    /// Hydraulic conditions. Without one the ground surface keeps its pressure, and all other edges are impermeable.
    pub conditions: Vec<MovingBoundary>,
    /// When the stage ends.
    pub end: End,
    /// Factor on the stability limit.
    pub time_step_factor: f64,
    /// What is recorded.
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
    /// Held as its support says.
    Held,
    /// Compliant: waves pass through it.
    Compliant(Base),
}

/// A side in a stage.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum SideEdge {
    /// Held as its support says.
    Held,
    /// Next to a free-field column, which is solved, or read from a record of the same column under the same motion.
    FreeField(Option<ColumnRecord>),
    /// Taken away.
    Open,
}

/// Pore pressure that counts as no excess.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum WaterReference {
    /// The pressure at rest, which moves with the nodes.
    AtRest,
    /// The pressure of still water at the present place of each node.
    StillWater {
        /// Surface of the water from left to right, m; empty: there is none. `None`: the surface at rest.
        line: Option<Vec<Vec2>>,
    },
}

/// The surface across which pore water drains.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Surface {
    /// That of the section as it was drawn: the nodes below it stay the same.
    Tied,
    /// Found from the present places of the nodes.
    Found,
}

/// How far the ground may move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Displacements {
    /// Nodes keep their neighbours; a renewed geometry leaves the state in balance.
    Small,
    /// Nodes change their neighbours and may fly alone; weight and still water act where the nodes are.
    Large,
}

/// What takes energy from the motion beside the soil.
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
    /// When the ground is at rest. Soil is elastic meanwhile, pore pressure frozen, and motion has no physical time.
    AtRest {
        /// Largest unbalanced acceleration over gravity.
        tolerance: f64,
        /// Steps after which the stage gives up.
        max_steps: u64,
    },
    /// After a time, s.
    After(f64),
}

/// What a stage records.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Output {
    /// Points where histories are read, m.
    pub probes: Vec<Vec2>,
    /// Interval of the histories, s.
    pub history_interval: f64,
    /// Whether probes also read stress and strain.
    pub stress_histories: bool,
    /// Whether the largest excess pressure of every node is kept.
    pub pressure_envelope: bool,
    /// Whether the largest shear strain of every stress node is kept.
    pub strain_envelope: bool,
    /// Interval at which the motion of free-field columns is recorded, s.
    pub record_columns: Option<f64>,
}

impl Stage {
    /// Which sides are free-field sides.
    pub fn free_field(&self) -> [bool; 2] {
        self.edges.sides.each_ref().map(|side| matches!(side, SideEdge::FreeField(_)))
    }

    /// Which sides are taken away.
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

    /// Drops the records of columns, once these hold them.
    pub fn forget_column_records(&mut self) {
        for side in &mut self.edges.sides {
            if let SideEdge::FreeField(record) = side {
                *record = None;
            }
        }
    }

    /// Record of the column of a side, if it is to be read instead of solved.
    pub fn column_record(&self, hand: Hand) -> Option<&ColumnRecord> {
        match &self.edges.sides[hand as usize] {
            SideEdge::FreeField(record) => record.as_ref(),
            SideEdge::Held | SideEdge::Open => None,
        }
    }

    /// Duration, s; infinite where the ground comes to rest first.
    pub fn duration(&self) -> f64 {
        match self.end {
            End::After(duration) => duration,
            End::AtRest { .. } => f64::INFINITY,
        }
    }

    /// The same stage for a column between periodic sides, shaken by the wave of one segment of the base; `lowest` (m) is the
    /// elevation at which times of arrival hold unless the base says otherwise.
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
