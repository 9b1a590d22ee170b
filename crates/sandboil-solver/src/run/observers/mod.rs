//! Histories, envelopes and energy of a stage. Observers are called at fixed points of a step: after the
//! accelerations are known and before the nodes move, and at its end.

pub mod energy;
pub mod envelopes;
pub mod histories;

use crate::{
    run::{clock::Clock, domain::Domain, forces::Power, ground::Ground},
    skeleton::soils::StressWork,
    stages::stage::Output,
};
use energy::{EdgeWork, Energy, EnergyHistory};
use envelopes::Envelopes;
use histories::Histories;

/// The observers of a moving stage.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct Observers {
    /// Histories at points.
    pub histories: Histories,
    /// Envelopes.
    pub envelopes: Envelopes,
    /// Samples of the energy balance.
    pub energy_history: EnergyHistory,
    energy: Energy,
}

impl Observers {
    /// The observers of a stage; `dt` is its first time step, s.
    pub fn new(ground: &Ground, output: &Output, dt: f64) -> Self {
        Self {
            histories: Histories::new(ground, output, dt),
            envelopes: Envelopes::new(ground, output),
            energy: Energy::new(ground.kinetic_energy()),
            energy_history: EnergyHistory::new(output.history_interval),
        }
    }

    /// Adds the work of forces, from the power of the step's forces on the velocity at its beginning (kW/m),
    /// and of the water's force in the step before on the same velocity.
    pub fn account_forces(&mut self, dt: f64, power: &Power, last_water_power: f64) {
        self.energy.end_step(&Power { water: last_water_power, ..*power });
        self.energy.begin_step(dt, power);
    }

    /// Takes samples after the accelerations are known and before the nodes move.
    pub fn record(&mut self, ground: &Ground, clock: &Clock, work: &EdgeWork) {
        self.energy.step(work);
        self.envelopes.record(ground);
        self.histories.record(ground, clock);
    }

    /// Adds the work of stress in the step's strain, and of the pore pressure at the corners of cells.
    pub fn account_strain(&mut self, stress: StressWork, water: StressWork) {
        self.energy.strain(stress, water);
    }

    /// At the end of a step: takes a sample of energy if one `is_due`, with the work of stress and pore pressure
    /// `after` the step in its strain, and completes the histories if the stage `is_over`.
    pub fn end_step(&mut self, domain: &Domain, after: [f64; 2], is_due: bool, is_over: bool) {
        let Domain { ground, clock, .. } = domain;
        if is_due {
            let mut energy = self.energy;
            energy.end_step(&domain.present_power());
            let kinetic = ground.kinetic_energy();
            self.energy_history.push(clock.time, &energy, kinetic, after, &ground.phases);
        }
        if is_over {
            self.histories.finish(clock.time);
        }
    }

    /// Before a renewal of the geometry: completes the work of forces that the renewal changes.
    pub fn begin_renewal(&mut self, domain: &Domain) {
        self.energy.end_step(&domain.present_power());
    }

    /// After a renewal: adds the kinetic energy `gained` in it, kJ/m.
    pub fn end_renewal(&mut self, gained: f64) {
        self.energy.renew(gained);
    }
}
