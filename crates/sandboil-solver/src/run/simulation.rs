//! A simulation: a section under one stage after the other.

use crate::{
    error::{SolverError, StateError},
    parallel::Pool,
    run::{
        checkpoint,
        domain::Domain,
        moving::{Lead, Moving},
        neighbour::Neighbour,
        relaxing::Relaxing,
        renewal::renew,
    },
    section::{description::Model, order::sorted},
    stages::{column_record::ColumnRecord, gravity::Gravity},
};
use serde::de::DeserializeOwned;
use std::io::{self, Write};

/// The running stage.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
#[serde(bound(deserialize = "N: DeserializeOwned"))]
pub enum Active<N> {
    /// None yet.
    None,
    /// A static stage.
    Relaxing(Relaxing),
    /// A stage of moving ground.
    Moving(Box<Moving<N>>),
}

/// A section and its state, with the ground `N` beside it. All output arrays are in the user's node order.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
#[serde(bound(deserialize = "N: DeserializeOwned"))]
pub struct Driver<N> {
    pub(super) domain: Domain,
    pub(super) active: Active<N>,
    /// The static stage that was run, for the columns beside the section.
    pub(super) gravity: Option<Gravity>,
    #[serde(skip)]
    pool: Pool,
}

impl<N: Neighbour> Driver<N> {
    /// Builds the section at its geostatic stress, at rest on held edges.
    ///
    /// # Errors
    /// Bad input, or a thread pool that cannot be made.
    pub fn new(model: &Model, threads: usize) -> Result<Self, SolverError> {
        let domain = Domain::new(model, threads > 1)?;
        Ok(Self { domain, active: Active::None, gravity: None, pool: Pool::new(threads)? })
    }

    /// Writes the whole state, so that [`Driver::restore`] can continue, and a note of the caller's, which
    /// [`checkpoint::note`] reads.
    ///
    /// # Errors
    /// Errors of the writer `to`.
    pub fn store(&self, note: &[u8], to: impl Write) -> io::Result<()> {
        checkpoint::write(self, note, to)
    }

    /// The simulation that was stored, in the same stage at the same step: it continues bit for bit, with any number of
    /// threads.
    ///
    /// # Errors
    /// [`SolverError::State`] for bytes that are damaged or of another model than the one given, or a thread pool
    /// that cannot be made.
    pub fn restore(model: &Model, threads: usize, bytes: &[u8]) -> Result<Self, SolverError> {
        let mut simulation: Self = checkpoint::read(bytes)?;
        if simulation.domain.ground.model != sorted(model).0 {
            return Err(StateError::OtherModel.into());
        }
        simulation.domain.threaded = threads > 1;
        simulation.pool = Pool::new(threads)?;
        Ok(simulation)
    }

    /// Advances by at most `steps` steps, or until the stage time reaches `until`. Returns whether the stage is
    /// complete.
    ///
    /// # Errors
    /// [`SolverError::Diverged`], [`SolverError::Soil`], [`SolverError::NotAtRest`]; the state stays readable.
    pub fn advance(&mut self, steps: u64, until: f64) -> Result<bool, SolverError> {
        if matches!(self.active, Active::None) {
            return Err(SolverError::Order { call: "advance", needs: "a stage" });
        }
        let mut pool = std::mem::take(&mut self.pool);
        let outcome = pool.run(|| self.run(steps, until));
        self.pool = pool;
        let done = outcome??;
        // A state that is not finite must not be read, stored or continued.
        self.guard()?;
        Ok(done)
    }

    fn run(&mut self, steps: u64, until: f64) -> Result<bool, SolverError> {
        for _ in 0..steps {
            let clock = &self.domain.clock;
            // A tolerance of half a step: output does not change the time step.
            if self.is_complete() || clock.time + 0.5 * clock.dt >= until {
                break;
            }
            match &mut self.active {
                Active::None => break,
                Active::Relaxing(stage) => stage.step(&mut self.domain)?,
                Active::Moving(stage) => stage.step(&mut self.domain, Lead::Own)?,
            }
        }
        Ok(self.is_complete())
    }

    /// Makes a step of `dt` seconds as a column beside a section, which sets the time step.
    ///
    /// # Errors
    /// As [`Driver::advance`].
    pub(crate) fn step_beside(&mut self, dt: f64) -> Result<(), SolverError> {
        self.domain.clock.dt = dt;
        match &mut self.active {
            Active::Moving(stage) => stage.step(&mut self.domain, Lead::Section),
            _ => Ok(()),
        }
    }

    /// Renews the geometry as a column beside a section, which decides when.
    pub(crate) fn renew_beside(&mut self) {
        renew(&mut self.domain, None::<&mut N>);
    }

    /// Whether the stage has reached its end.
    pub fn is_complete(&self) -> bool {
        match &self.active {
            Active::None => true,
            Active::Relaxing(stage) => stage.at_rest,
            Active::Moving(stage) => stage.is_over(self.domain.clock.time, self.domain.clock.dt),
        }
    }

    pub(crate) fn guard(&self) -> Result<(), SolverError> {
        match self.moving() {
            Some(stage) => stage.guard(&self.domain),
            None => self.domain.guard(),
        }
    }

    /// The running stage, if the ground moves in it.
    pub(super) fn moving(&self) -> Option<&Moving<N>> {
        match &self.active {
            Active::Moving(stage) => Some(stage),
            _ => None,
        }
    }

    pub(super) fn moving_mut(&mut self) -> Option<&mut Moving<N>> {
        match &mut self.active {
            Active::Moving(stage) => Some(stage),
            _ => None,
        }
    }

    /// Completes the open samples of a run that ends before its stage does, with one-sided windows.
    pub fn finish_histories(&mut self) {
        let time = self.domain.clock.time;
        if let Some(stage) = self.moving_mut() {
            stage.observers.histories.finish(time);
        }
    }

    /// Samples of energy and masses since the last call: times (s) and one row of [`crate::ENERGY_NAMES`] for each.
    pub fn take_energy(&mut self) -> (Vec<f64>, Vec<f64>) {
        self.moving_mut().map(|stage| stage.observers.energy_history.take()).unwrap_or_default()
    }

    /// History samples finished since the last call: times (s) and one row for each time, probe after probe.
    pub fn take_histories(&mut self) -> (Vec<f64>, Vec<f64>) {
        self.moving_mut().map(|stage| stage.observers.histories.take()).unwrap_or_default()
    }

    /// Takes out the records of the free-field columns of the left and the right side in the stage, if there
    /// are any.
    pub fn take_column_records(&mut self) -> [Option<ColumnRecord>; 2] {
        let neighbour = self.moving_mut().and_then(|stage| stage.neighbour.as_mut());
        neighbour.map_or([None, None], N::take_records)
    }
}
