//! A running static stage: gravity is applied and motion is stopped by kinetic damping.

use crate::{
    error::SolverError,
    run::domain::{Domain, MotionSum},
};

/// Tolerance on the mean unbalanced acceleration, over the tolerance on the largest.
const MEAN_RESIDUAL: f64 = 0.1;

/// A running static stage.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct Relaxing {
    tolerance: f64,
    max_steps: u64,
    kinetic_energy: f64,
    /// Largest unbalanced acceleration over gravity; infinite before the first step.
    pub residual: f64,
    /// Whether the ground has come to rest.
    pub at_rest: bool,
}

impl Relaxing {
    /// A stage that ends when the largest unbalanced acceleration over gravity is at most `tolerance`, or
    /// fails after `max_steps` steps.
    pub fn new(tolerance: f64, max_steps: u64) -> Self {
        Self { tolerance, max_steps, kinetic_energy: 0.0, residual: f64::INFINITY, at_rest: false }
    }

    /// Makes a step.
    ///
    /// # Errors
    /// [`SolverError::Diverged`], [`SolverError::NotAtRest`].
    pub fn step(&mut self, domain: &mut Domain) -> Result<(), SolverError> {
        let dt = domain.clock.dt;
        // From rest the first velocity update of a leapfrog is over half a step. With a whole step, modes
        // near the stability limit would alternate between two stops for ever.
        let update = if self.kinetic_energy == 0.0 { 0.5 * dt } else { dt };
        let sum = domain.accelerate::<true>(update);
        domain.check_finite("acceleration", |ground, j| ground.acceleration[j].norm(), f64::INFINITY)?;
        if self.is_at_rest(domain, &sum) {
            self.at_rest = true;
            domain.ground.velocity.fill(sandboil_sph::Vec2::zeros());
            return Ok(());
        }
        if domain.clock.step >= self.max_steps {
            let Self { tolerance, residual, .. } = *self;
            return Err(SolverError::NotAtRest { steps: domain.clock.step, residual, tolerance });
        }
        self.damp(domain, sum.kinetic_energy);
        domain.update_stress(dt, false)?;
        domain.clock.tick();
        Ok(())
    }

    fn is_at_rest(&mut self, domain: &Domain, sum: &MotionSum) -> bool {
        let gravity = domain.ground.model.gravity;
        self.residual = sum.largest_acceleration / gravity;
        let mean = sum.acceleration / (gravity * domain.ground.nodes() as f64);
        self.residual <= self.tolerance && mean <= MEAN_RESIDUAL * self.tolerance
    }

    /// Kinetic damping: at each peak of the kinetic energy all motion stops.
    fn damp(&mut self, domain: &mut Domain, kinetic_energy: f64) {
        if kinetic_energy < self.kinetic_energy {
            domain.ground.velocity.fill(sandboil_sph::Vec2::zeros());
            self.kinetic_energy = 0.0;
        } else {
            self.kinetic_energy = kinetic_energy;
        }
    }
}
