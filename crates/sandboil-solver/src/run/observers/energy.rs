//! Energy balance of a moving section, and the masses of its phases.
//!
//! The work of a force in a leapfrog step is `f (v_before + v_after)/2 dt`, so that the work of all forces is
//! exactly the gain of kinetic energy. The work of stress is summed at the stress nodes, half of every strain
//! increment with the stress before it and half with the stress after it. Summed by parts this is the work of
//! its nodal forces, to second order in the strain of a step. Damping takes the rest of the work of the
//! skeleton's forces.
//!
//! No loop is added to a step: half of the work of constant forces and water is added in the next step, which
//! reads the velocity between both steps. Kinetic energy is computed only when a sample is taken.

use crate::{
    run::forces::Power,
    skeleton::{phases::Phases, soils::StressWork},
};

/// Names of the columns of a history of energy, in order; masses are in Mg/m, all others in kJ/m.
pub const ENERGY_NAMES: [&str; 15] = [
    "kinetic",
    "stress",
    "water",
    "damping",
    "local_damping",
    "weight",
    "still_water",
    "reaction",
    "renewal_force",
    "load",
    "base",
    "sides",
    "renewal",
    "solid_mass",
    "water_mass",
];

/// Energy of a section in a stage, kJ/m; work counts from its beginning.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Energy {
    /// Kinetic energy at the beginning.
    kinetic_before: f64,
    /// Work of the effective stress on the soil, with the whole last strain increment: stored, or taken by
    /// plasticity.
    stress: f64,
    /// Work on the pore water beyond its state at rest.
    water: f64,
    /// Taken by local damping.
    local_damping: f64,
    /// Work of the constant forces.
    constant: ConstantWork,
    /// Work of the base's dashpots on the section.
    base: f64,
    /// Work of free-field sides on the section, also through the strain by the columns' motion.
    sides: f64,
    /// Kinetic energy gained by masses that a renewed geometry has changed.
    renewal: f64,
    /// Length of the last step while half of its work of constant forces and water is not yet added, s; else
    /// zero.
    unfinished_step: f64,
}

/// Work of the constant forces by origin, kJ/m.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
struct ConstantWork {
    /// Of all of them.
    total: f64,
    weight: f64,
    still_water: f64,
    renewal: f64,
    load: f64,
}

impl ConstantWork {
    fn add(&mut self, power: &Power, time: f64) {
        self.total += time * power.constant;
        self.weight += time * power.weight;
        self.still_water += time * power.still_water;
        self.renewal += time * power.renewal;
        self.load += time * power.load;
    }

    /// Of the reaction: the total less all other parts.
    fn reaction(&self) -> f64 {
        self.total - self.weight - self.still_water - self.renewal - self.load
    }
}

/// Work of a step, kJ/m: each force on the mean of the velocities before and after it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EdgeWork {
    /// Of the base's dashpots.
    pub base: f64,
    /// Of free-field sides.
    pub sides: f64,
    /// Taken by local damping.
    pub local_damping: f64,
}

impl Energy {
    /// No work yet, at a kinetic energy, kJ/m.
    pub fn new(kinetic: f64) -> Self {
        Self { kinetic_before: kinetic, ..Self::default() }
    }

    /// Adds the second half of the last step's work: the power of its forces on the velocity at its end.
    pub fn end_step(&mut self, last: &Power) {
        self.constant.add(last, 0.5 * self.unfinished_step);
        self.water -= 0.5 * self.unfinished_step * last.water;
        self.unfinished_step = 0.0;
    }

    /// Adds the first half of a step's work, over `dt` in s: the power of its forces on the velocity at its
    /// beginning.
    pub fn begin_step(&mut self, dt: f64, power: &Power) {
        self.constant.add(power, 0.5 * dt);
        self.water -= 0.5 * dt * power.water;
        self.unfinished_step = dt;
    }

    /// Adds the work of edges and local damping in a step.
    pub fn step(&mut self, work: &EdgeWork) {
        self.base += work.base;
        self.sides += work.sides;
        self.local_damping += work.local_damping;
    }

    /// Adds the kinetic energy gained in a renewal of the geometry, kJ/m.
    pub fn renew(&mut self, gained: f64) {
        self.renewal += gained;
    }

    /// Adds the work of stress, and of the pore pressure at the corners of cells, in a step's strain, kJ/m.
    pub fn strain(&mut self, stress: StressWork, water: StressWork) {
        self.stress += stress.mean;
        self.water += water.mean;
    }

    /// The columns of [`ENERGY_NAMES`] without the masses, from the kinetic energy and the work `after` of
    /// the last stress and pressure in the last strain increment, kJ/m. The energy taken by velocity filter and Rayleigh
    /// damping is the remainder.
    fn columns(&self, kinetic: f64, after: [f64; 2]) -> [f64; 13] {
        // Half of the last increment, with the stress after it, belongs to the next step's force.
        let [stress, water] = [self.stress - 0.5 * after[0], self.water - 0.5 * after[1]];
        let supplied = self.constant.total + self.base + self.sides + self.renewal;
        let stored = (kinetic - self.kinetic_before) + water + self.local_damping;
        [
            kinetic,
            stress,
            water,
            supplied - stored - stress,
            self.local_damping,
            self.constant.weight,
            self.constant.still_water,
            self.constant.reaction(),
            self.constant.renewal,
            self.constant.load,
            self.base,
            self.sides,
            self.renewal,
        ]
    }
}

/// Samples of energy and masses at an interval, unfiltered, each at the end of a step.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct EnergyHistory {
    interval: f64,
    next: u64,
    times: Vec<f64>,
    values: Vec<f64>,
}

impl EnergyHistory {
    /// A history with a sample every `interval` seconds, at the first step that reaches it.
    pub fn new(interval: f64) -> Self {
        Self { interval, next: 0, times: Vec::new(), values: Vec::new() }
    }

    /// Whether a sample is due at the end of a step, `time` in s.
    pub fn is_due(&self, time: f64) -> bool {
        time >= self.next as f64 * self.interval
    }

    /// Takes a sample at the end of a step, `time` in s, from the kinetic energy and the work of stress and
    /// pressure `after` the step in the strain of the step, kJ/m.
    pub fn push(&mut self, time: f64, energy: &Energy, kinetic: f64, after: [f64; 2], phases: &Phases) {
        while self.is_due(time) {
            self.next += 1;
        }
        self.times.push(time);
        self.values.extend(energy.columns(kinetic, after));
        self.values.extend(phases.total_masses());
    }

    /// Takes the samples out: times (s) and values, one row of [`ENERGY_NAMES`] for each time.
    pub fn take(&mut self) -> (Vec<f64>, Vec<f64>) {
        (std::mem::take(&mut self.times), std::mem::take(&mut self.values))
    }
}
