//! Forces on the velocity nodes: the constant ones by their origin, and those of stress, water and damping.

use crate::{
    section::stress_layout::StressLayout,
    skeleton::{
        phases::Phases,
        point::StressPoint,
        printed::PrintedStress,
        rayleigh::RayleighDamping,
        strain_and_force::{NodalShare, conservative_force},
        viscosity::Viscosity,
    },
    water::{corner_pressure::Pressed, pore_water::PoreWater},
    weights::geometry::Geometry,
};
use sandboil_sph::Vec2;

/// Constant nodal forces, kN/m. Parts that a scene does not have take no memory.
///
/// In a stage of small displacements the sum balances the state at the start of the stage to the last bit.
/// The sum less weight, still water, renewal and load is the reaction: of the edges, and of the residual of
/// the static stage.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct ConstantForces {
    /// Sum of all parts.
    total: Vec<Vec2>,
    /// Of still water: of its pressure at rest, or at the present positions.
    still_water: Vec<Vec2>,
    /// Balance of the changes by renewed weights.
    renewal: Vec<Vec2>,
    /// Of a load that balances an excess pore pressure.
    load: Vec<Vec2>,
}

/// Power of nodal forces on a velocity field, by origin, kW/m.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Power {
    /// Of all constant forces.
    pub constant: f64,
    /// Of weight.
    pub weight: f64,
    /// Of still water.
    pub still_water: f64,
    /// Of the balance at renewals.
    pub renewal: f64,
    /// Of a load.
    pub load: f64,
    /// Of the pore water beyond its state at rest.
    pub water: f64,
}

impl Power {
    /// The sum of two powers.
    #[must_use]
    pub fn plus(self, other: &Self) -> Self {
        Self {
            constant: self.constant + other.constant,
            weight: self.weight + other.weight,
            still_water: self.still_water + other.still_water,
            renewal: self.renewal + other.renewal,
            load: self.load + other.load,
            water: self.water + other.water,
        }
    }
}

impl ConstantForces {
    /// No forces yet on `nodes` nodes.
    pub fn new(nodes: usize) -> Self {
        Self { total: vec![Vec2::zeros(); nodes], ..Self::default() }
    }

    /// Sum on node `j`, kN/m.
    #[inline]
    pub fn total(&self, j: usize) -> Vec2 {
        self.total[j]
    }

    /// Adds the power of the constant forces on node `j` with a mass (Mg/m) and a velocity (m/s), under
    /// `gravity` (m/s2).
    #[inline]
    pub fn add_power(&self, j: usize, mass: f64, velocity: Vec2, gravity: f64, power: &mut Power) {
        power.constant += self.total[j].dot(&velocity);
        power.weight -= gravity * mass * velocity.y;
        for (part, sum) in [
            (&self.still_water, &mut power.still_water),
            (&self.renewal, &mut power.renewal),
            (&self.load, &mut power.load),
        ] {
            if let Some(force) = part.get(j) {
                *sum += force.dot(&velocity);
            }
        }
    }

    /// Sets the forces to weight and still water at the present positions; `still_water` lists its
    /// contributions.
    pub fn set_present(&mut self, mass: &[f64], gravity: f64, still_water: &[Vec<Vec2>]) {
        let gravity = Vec2::new(0.0, -gravity);
        self.total.clear();
        self.total.extend(mass.iter().map(|mass| gravity * *mass));
        (self.renewal, self.load) = (Vec::new(), Vec::new());
        self.still_water = vec![Vec2::zeros(); if still_water.is_empty() { 0 } else { mass.len() }];
        for part in still_water {
            self.total.iter_mut().zip(part).for_each(|(sum, force)| *sum += force);
            self.still_water.iter_mut().zip(part).for_each(|(sum, force)| *sum += force);
        }
    }

    /// Sets the sum that balances `force` (kN/m), the force of stress and pressure.
    pub fn balance(&mut self, force: &[Vec2]) {
        self.total.clear();
        self.total.extend(force.iter().map(|force| -force));
        (self.renewal, self.load) = (Vec::new(), Vec::new());
    }

    /// Sets the sum that balances `force` plus the force `held_back` (kN/m); the change of the sum is the
    /// load.
    pub fn balance_under_load(&mut self, force: &[Vec2], held_back: impl Fn(usize) -> Vec2) {
        let before = self.total.clone();
        self.balance(force);
        for (j, total) in self.total.iter_mut().enumerate() {
            *total -= held_back(j);
        }
        self.load = self.total.iter().zip(before).map(|(now, before)| now - before).collect();
    }

    /// Keeps a state in balance when a renewal of the geometry changes the force of stress and pressure from
    /// `before` to `after`, kN/m.
    pub fn balance_renewal(&mut self, before: &[Vec2], after: &[Vec2]) {
        self.renewal.resize(self.total.len(), Vec2::zeros());
        for (j, (before, after)) in before.iter().zip(after).enumerate() {
            let change = before - after;
            self.total[j] += change;
            self.renewal[j] += change;
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        [&self.total, &self.still_water, &self.renewal, &self.load]
            .map(|part| size_of_val(part.as_slice()))
            .iter()
            .sum()
    }
}

/// The forces of the present state on the nodes.
#[derive(Clone, Copy)]
pub struct NodalForces<'a> {
    /// Weights.
    pub geometry: &'a Geometry,
    /// Stress nodes.
    pub points: &'a [StressPoint],
    /// Their shares in the forces.
    pub shares: &'a [NodalShare],
    /// Volumes and densities.
    pub phases: &'a Phases,
    /// Mass of each node, Mg/m.
    pub mass: &'a [f64],
    /// Pore water.
    pub water: Option<&'a PoreWater>,
    /// Where the stress points are.
    pub layout: &'a StressLayout,
    /// Stresses of the printed operators.
    pub printed: Option<&'a PrintedStress>,
    /// Rayleigh damping.
    pub rayleigh: Option<&'a RayleighDamping>,
    /// Artificial viscosity.
    pub viscosity: Option<&'a Viscosity>,
}

impl NodalForces<'_> {
    /// Force of the excess pore pressure on node `j` (Eq. 6), kN/m. That of corners is part of the stress there.
    #[inline]
    pub fn of_water(&self, j: usize) -> Vec2 {
        let (flow, tables) = match (self.water, &self.geometry.flow, self.layout) {
            (Some(PoreWater::Nodes(flow)), Some(tables), _) => (flow, tables),
            (Some(PoreWater::Corners(flow)), _, StressLayout::Dual(dual)) if flow.has_nodal_force() => {
                let Self { geometry, points, phases, .. } = *self;
                return flow.force(&Pressed { geometry, dual, points, phases }, j);
            }
            _ => return Vec2::zeros(),
        };
        match &self.geometry.printed {
            None => flow.force(tables, j),
            Some(printed) => {
                let row = printed.pressure_gradient.iter_row(j);
                let gradient: Vec2 = row.map(|(i, gradient)| gradient * flow.neutral(i)).sum();
                gradient * -self.phases.volume()[j]
            }
        }
    }

    /// Force on node `j` at a velocity: of stress and damping, plus the force of excess pore pressure,
    /// `water` (Eq. 6), kN/m.
    #[inline]
    pub fn internal(&self, j: usize, velocity: Vec2, water: Vec2) -> Vec2 {
        let mut force = match (self.printed, &self.geometry.printed) {
            (Some(stress), Some(tables)) => stress.force(tables, j, self.points, self.phases),
            _ => conservative_force(self.geometry, j, velocity, self.shares, self.points),
        };
        force += water;
        if let Some(viscosity) = self.viscosity {
            force += viscosity.force(j);
        }
        if let Some(rayleigh) = self.rayleigh {
            force += rayleigh.force(self.geometry, j, self.mass[j], velocity);
        }
        force
    }
}
