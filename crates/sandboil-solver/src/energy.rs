//! Where the energy of a shaken section goes, and how much of each phase there is.
//!
//! Works are those of the leapfrog's own steps: a force does `f (v_before + v_after)/2 dt`, so that all of them together
//! are exactly what kinetic energy gains. Stress does its work at the stress nodes, half of every strain increment with
//! the stress before it and half with the one after: summed by parts that is the work of its nodal forces, to the second
//! order in the strain of a step. What the skeleton's forces take beyond it is what damping takes.

use crate::{phases::Phases, soil_field::StressWork};

/// Names of the columns of a history of energy, in order; masses are Mg/m, all else is kJ/m.
pub const ENERGY_NAMES: [&str; 11] = [
    "kinetic",
    "stress",
    "water",
    "damping",
    "local_damping",
    "constant_forces",
    "base",
    "sides",
    "renewal",
    "solid_mass",
    "water_mass",
];

/// Energy of a section in a stage of shaking, kJ/m; works count from its beginning.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Energy {
    /// Of the motion in the middle of the last step.
    kinetic: f64,
    /// Taken by forces of stress, velocity filter and Rayleigh damping.
    skeleton: f64,
    /// Done on the soil by its effective stress; what it stores and what its plasticity takes.
    stress: f64,
    /// The same of the last strain increment with the stress after it: half of it belongs to the next step.
    unmet: f64,
    /// Given to the pore water beyond its state at rest.
    water: f64,
    /// Taken by local damping.
    local_damping: f64,
    /// Done by gravity and the reactions stored at rest.
    constant: f64,
    /// Brought in by the base's dashpots.
    base: f64,
    /// Brought in by free-field sides.
    sides: f64,
    /// Kinetic energy gained by masses that a renewed geometry has changed.
    renewal: f64,
}

/// What a step did to a section, kJ/m: each force on the mean of the velocities before and after it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepWork {
    /// Kinetic energy that it leaves.
    pub kinetic: f64,
    /// Work of gravity and of the reactions stored at rest.
    pub constant: f64,
    /// Work of the pore water on the soil.
    pub water: f64,
    /// Work of the base's dashpots.
    pub base: f64,
    /// Work of free-field sides.
    pub sides: f64,
    /// What local damping takes.
    pub local_damping: f64,
}

impl Energy {
    /// Nothing done yet at a kinetic energy, kJ/m.
    pub fn new(kinetic: f64) -> Self {
        Self { kinetic, ..Self::default() }
    }

    /// Takes over what a step did.
    pub fn step(&mut self, work: &StepWork) {
        let StepWork { kinetic, constant, water, base, sides, local_damping } = *work;
        self.skeleton += constant + water + base + sides - local_damping - (kinetic - self.kinetic);
        self.kinetic = kinetic;
        self.constant += constant;
        self.water -= water;
        self.base += base;
        self.sides += sides;
        self.local_damping += local_damping;
    }

    /// Takes over the kinetic energy after a renewal of the geometry, kJ/m.
    pub fn renew(&mut self, kinetic: f64) {
        self.renewal += kinetic - self.kinetic;
        self.kinetic = kinetic;
    }

    /// Takes over the work of stress in a step's strain, kJ/m.
    pub fn strain(&mut self, work: StressWork) {
        self.stress += 0.5 * (self.unmet + work.before);
        self.unmet = work.after;
    }

    /// The columns of [`ENERGY_NAMES`] but the masses.
    fn columns(&self) -> [f64; 9] {
        [
            self.kinetic,
            self.stress,
            self.water,
            self.skeleton - self.stress,
            self.local_damping,
            self.constant,
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

    /// Offers the state at the end of a step, `time` in s; the last one of a stage is always kept.
    pub fn offer(&mut self, time: f64, is_last: bool, energy: &Energy, phases: &Phases) {
        if is_last || time >= self.next as f64 * self.interval {
            while self.next as f64 * self.interval <= time {
                self.next += 1;
            }
            self.times.push(time);
            self.values.extend(energy.columns());
            self.values.extend(phases.total_masses());
        }
    }

    /// Takes the samples out: times (s) and values, one row of [`ENERGY_NAMES`] for each time.
    pub fn take(&mut self) -> (Vec<f64>, Vec<f64>) {
        (std::mem::take(&mut self.times), std::mem::take(&mut self.values))
    }
}
