//! Where the energy of a shaken section goes, and how much of each phase there is.
//!
//! Works are those of the leapfrog's own steps: a force does `f (v_before + v_after)/2 dt`, so that all of them together
//! are exactly what kinetic energy gains. Stress does its work at the stress nodes, half of every strain increment with
//! the stress before it and half with the one after: summed by parts that is the work of its nodal forces, to the second
//! order in the strain of a step. What the skeleton's forces take beyond it is what damping takes.
//!
//! A step costs no loop of its own: constant forces and water do half their work where the next step reads the velocity
//! between both, and motion is looked at where a sample is taken.

use crate::{
    run::forces::Power,
    skeleton::{phases::Phases, soils::StressWork},
};

/// Names of the columns of a history of energy, in order; masses are Mg/m, all else is kJ/m.
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

/// Energy of a section in a stage, kJ/m; works count from its beginning.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Energy {
    /// Of the motion at the beginning.
    kinetic_before: f64,
    /// Done on the soil by its effective stress, all of the last strain increment included: stored, or taken by plasticity.
    stress: f64,
    /// Given to the pore water beyond its state at rest.
    water: f64,
    /// Taken by local damping.
    local_damping: f64,
    /// Done by the constant forces.
    constant: ConstantWork,
    /// Brought in by the base's dashpots.
    base: f64,
    /// Brought in by free-field sides, also through the strain that the columns' motion gives.
    sides: f64,
    /// Kinetic energy gained by masses that a renewed geometry has changed.
    renewal: f64,
    /// Length of the last step while constant forces and water still owe it half their work, s; else zero.
    owed: f64,
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

    /// Of the reaction: what no other part does.
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
    /// Nothing done yet at a kinetic energy, kJ/m.
    pub fn new(kinetic: f64) -> Self {
        Self { kinetic_before: kinetic, ..Self::default() }
    }

    /// Adds the half of the last step's work that is still owed: the power of its forces on the velocity that it left.
    pub fn end_step(&mut self, last: &Power) {
        self.constant.add(last, 0.5 * self.owed);
        self.water -= 0.5 * self.owed * last.water;
        self.owed = 0.0;
    }

    /// Adds half of a step's work, over `dt` in s: the power of its forces on the velocity at its beginning.
    pub fn begin_step(&mut self, dt: f64, power: &Power) {
        self.constant.add(power, 0.5 * dt);
        self.water -= 0.5 * dt * power.water;
        self.owed = dt;
    }

    /// Adds the work of edges and local damping in a step.
    pub fn step(&mut self, work: &EdgeWork) {
        self.base += work.base;
        self.sides += work.sides;
        self.local_damping += work.local_damping;
    }

    /// Adds the kinetic energy that a renewal of the geometry gave, kJ/m.
    pub fn renew(&mut self, gained: f64) {
        self.renewal += gained;
    }

    /// Adds the work of stress in a step's strain, kJ/m.
    pub fn strain(&mut self, work: StressWork) {
        self.stress += work.mean;
    }

    /// The columns of [`ENERGY_NAMES`] but the masses, from the kinetic energy and the work of the stress `after` the last
    /// strain increment in it, kJ/m. What the forces of stress, velocity filter and Rayleigh damping have taken is the
    /// remainder.
    fn columns(&self, kinetic: f64, after: f64) -> [f64; 13] {
        // Half of the last increment, with the stress after it, belongs to the next step's force.
        let stress = self.stress - 0.5 * after;
        let given = self.constant.total + self.base + self.sides + self.renewal;
        let held = (kinetic - self.kinetic_before) + self.water + self.local_damping;
        [
            kinetic,
            stress,
            self.water,
            given - held - stress,
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

    /// Takes a sample at the end of a step, `time` in s, from the kinetic energy and the work of the stress `after` the step
    /// in its strain, kJ/m.
    pub fn push(&mut self, time: f64, energy: &Energy, kinetic: f64, after: f64, phases: &Phases) {
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
