//! A running stage of moving ground: the leapfrog step.

use crate::{
    edges::{compliant_base::CompliantBase, contact::stop_near_edges, dashpots::NodalMotion},
    error::SolverError,
    run::{
        clock::CHECK_INTERVAL,
        domain::Domain,
        ground::{Ground, Placement},
        neighbour::Neighbour,
        observers::{Observers, energy::EdgeWork},
        renewal::renew,
        time_step::{PressureCoupling, TimeLimit},
    },
    stages::stage::{Displacements, Stage},
};

/// Who sets the time step and renews the geometry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lead {
    /// The ground itself.
    Own,
    /// The section beside the ground, which is a column.
    Section,
}

/// A stage of moving ground.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
#[serde(bound(deserialize = "N: serde::de::DeserializeOwned"))]
pub struct Moving<N> {
    /// Its description.
    pub stage: Stage,
    /// The compliant base, if it has one.
    pub base: Option<CompliantBase>,
    /// The ground beside it, if any.
    pub neighbour: Option<N>,
    /// How pore pressure enters the limit of the time step.
    pub coupling: PressureCoupling,
    /// Histories, envelopes and energy.
    pub observers: Observers,
}

impl<N: Neighbour> Moving<N> {
    /// Makes a step of the leapfrog: positions, stress and pressure at whole steps, velocities half a step later.
    ///
    /// # Errors
    /// [`SolverError::Diverged`], [`SolverError::Soil`], [`SolverError::Column`].
    pub fn step(&mut self, domain: &mut Domain, lead: Lead) -> Result<(), SolverError> {
        let dt = domain.clock.dt;
        self.begin_edges(domain, dt)?;
        domain.update_viscosity();
        let sum = domain.accelerate::<false>(dt);
        self.observers.account_forces(dt, &sum.power, sum.last_water_power);
        self.end_edges(domain, dt);
        let local_damping = domain.damp_locally(dt);
        stop_at_edges(domain, dt);
        let work = self.edge_work(domain, dt, local_damping);
        self.observers.record(&domain.ground, &domain.clock, &work);
        domain.move_nodes(dt);
        let is_due = lead == Lead::Own && self.is_sample_due(domain.clock.time + dt, dt);
        let stress_work = domain.update_stress(dt, is_due)?;
        let water_work = domain.update_water(dt)?;
        self.observers.account_strain(stress_work, water_work);
        domain.clock.tick();
        let is_over = self.is_over(domain.clock.time, dt);
        self.observers.end_step(domain, [stress_work.after, water_work.after], is_due, is_over);
        if self.is_check_due(domain.clock.step) {
            self.check(domain, lead)?;
        }
        Ok(())
    }

    /// Whether the stage ends at a time (s), with steps of `dt`, s.
    pub fn is_over(&self, time: f64, dt: f64) -> bool {
        time + 0.5 * dt >= self.stage.duration()
    }

    fn is_sample_due(&self, time: f64, dt: f64) -> bool {
        self.observers.energy_history.is_due(time) || self.is_over(time, dt)
    }

    /// With large displacements weights are valid for a few steps only.
    fn is_check_due(&self, step: u64) -> bool {
        self.stage.displacements == Displacements::Large || step.is_multiple_of(CHECK_INTERVAL)
    }

    fn begin_edges(&mut self, domain: &Domain, dt: f64) -> Result<(), SolverError> {
        let velocity = &domain.ground.velocity;
        if let Some(base) = &mut self.base {
            base.begin_step(velocity);
        }
        if let Some(neighbour) = &mut self.neighbour {
            neighbour.begin_step(dt, velocity)?;
        }
        Ok(())
    }

    /// Adds the tractions of base and sides to velocities that the section's own forces have already changed.
    fn end_edges(&mut self, domain: &mut Domain, dt: f64) {
        let time = domain.clock.time;
        let Ground { mass, velocity, acceleration, .. } = &mut domain.ground;
        let mut motion = NodalMotion { velocity, acceleration };
        if let Some(neighbour) = &self.neighbour {
            neighbour.push(dt, mass, &mut motion);
        }
        if let Some(base) = &mut self.base {
            base.end_step(time, dt, mass, &mut motion);
            domain.counters.base_calls += 1;
        }
        if let Some(neighbour) = &mut self.neighbour {
            neighbour.end_step(dt, mass, &mut motion);
            domain.counters.free_field_calls += 1;
        }
    }

    fn edge_work(&self, domain: &Domain, dt: f64, local_damping: f64) -> EdgeWork {
        let Ground { velocity, acceleration, geometry, points, .. } = &domain.ground;
        let base = self.base.as_ref().map_or(0.0, |base| base.dashpots().work(dt, velocity));
        let of_side = |side: &N| side.work(dt, velocity, acceleration, geometry, points);
        EdgeWork { base, sides: self.neighbour.as_ref().map_or(0.0, of_side), local_damping }
    }

    /// Checks finiteness, stability limit and geometry, every few steps.
    fn check(&mut self, domain: &mut Domain, lead: Lead) -> Result<(), SolverError> {
        self.guard(domain)?;
        let Ground { model, layout, water, .. } = &mut domain.ground;
        if let Some(water) = water {
            water.refresh(model, layout);
        }
        let limit = self.limit(domain);
        domain.counters.time_step_changes += u64::from(domain.clock.update(limit));
        let beside = self.neighbour.as_ref().is_some_and(N::is_strained);
        if lead == Lead::Own && (domain.ground.is_strained() || beside) {
            self.observers.begin_renewal(domain);
            let before = domain.ground.kinetic_energy();
            renew(domain, self.neighbour.as_mut());
            self.observers.end_renewal(domain.ground.kinetic_energy() - before);
        }
        Ok(())
    }

    /// Refuses motion and pore pressure that are no longer finite. The neighbour is checked first, because it
    /// drives the section.
    ///
    /// # Errors
    /// The first node found.
    pub fn guard(&self, domain: &Domain) -> Result<(), SolverError> {
        self.neighbour.as_ref().map_or(Ok(()), N::guard)?;
        domain.guard()
    }

    /// Longest stable time step of the section and the ground beside it, times the stage's factor, s.
    pub fn limit(&self, domain: &Domain) -> TimeLimit {
        shared_limit(domain, self.neighbour.as_ref(), self.coupling, self.stage.time_step_factor)
    }
}

/// Time step of a section: a factor times its limit, and at most that of its neighbour.
pub fn shared_limit<N: Neighbour>(
    domain: &Domain,
    neighbour: Option<&N>,
    coupling: PressureCoupling,
    factor: f64,
) -> TimeLimit {
    let own = domain.limit(coupling, factor);
    let beside = neighbour.and_then(|neighbour| neighbour.limit(coupling, factor));
    beside.map_or(own, |limit| own.least(limit))
}

/// With large displacements, stops single nodes in front of held edges.
fn stop_at_edges(domain: &mut Domain, dt: f64) {
    let Ground { model, placement: Placement::Held(outline), position, velocity, acceleration, .. } =
        &mut domain.ground
    else {
        return;
    };
    let motion = NodalMotion { velocity, acceleration };
    domain.counters.edge_contacts += stop_near_edges(model, outline, position, motion, dt);
}
