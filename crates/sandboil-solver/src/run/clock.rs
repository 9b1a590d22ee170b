//! Time of a stage, and the work done in it.

use crate::run::time_step::{Criterion, TimeLimit};
use sandboil_soil::UpdateReport;

/// Steps between checks of stability limit, geometry and finiteness.
pub const CHECK_INTERVAL: u64 = 16;
/// The time step is reduced when it exceeds its target by this factor, and increased when it is below by
/// [`GROW_AT`].
const SHRINK_AT: f64 = 1.1;
/// See [`SHRINK_AT`].
const GROW_AT: f64 = 1.3;

/// Time in a stage.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub struct Clock {
    /// Time since the stage began, s.
    pub time: f64,
    /// Steps since then.
    pub step: u64,
    /// Time step, s.
    pub dt: f64,
    /// What limits the time step.
    pub criterion: Criterion,
}

impl Clock {
    /// Starts a stage with a time step (s) and what limits it.
    pub fn start(TimeLimit { dt, criterion }: TimeLimit) -> Self {
        Self { time: 0.0, step: 0, dt, criterion }
    }

    /// Ends a step.
    pub fn tick(&mut self) {
        self.step += 1;
        self.time += self.dt;
    }

    /// Sets the time step to a new limit if it is too far from it. Returns whether it changed.
    pub fn update(&mut self, limit: TimeLimit) -> bool {
        let outgrown = is_outgrown(self.dt, limit.dt);
        if outgrown {
            (self.dt, self.criterion) = (limit.dt, limit.criterion);
        }
        outgrown
    }
}

/// Whether a time step is too far from its target to be kept.
pub fn is_outgrown(dt: f64, target: f64) -> bool {
    dt > SHRINK_AT * target || dt * GROW_AT < target
}

/// Counts of the work done in a stage, by kind; kinds that a scene does not need stay zero.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Counters {
    /// Steps.
    pub steps: u64,
    /// Calls of the flow model.
    pub flow_calls: u64,
    /// Calls of the base dashpots.
    pub base_calls: u64,
    /// Steps with free-field sides.
    pub free_field_calls: u64,
    /// Steps with dispersion-corrected inertia.
    pub inertia_corrections: u64,
    /// Updates of plastic soil models.
    pub plastic_updates: u64,
    /// Geometries built.
    pub geometry_builds: u64,
    /// Porosities clipped to the range of a grain packing.
    pub porosity_clips: u64,
    /// Stress nodes whose soil could not carry their initial stress and took the nearest that it can carry.
    pub inadmissible_starts: u64,
    /// Changes of the time step.
    pub time_step_changes: u64,
    /// Times that a node was stopped at an edge, with large displacements.
    pub edge_contacts: u64,
    /// Counts of the soil models.
    pub soil: UpdateReport,
}
