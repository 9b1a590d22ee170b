//! Dashpots on the velocity field along an edge: at the compliant base (Eq. 14 as corrected) and at
//! free-field sides (Eq. 15 as corrected).

use crate::{
    section::description::{Model, Operators},
    weights::points::point_weights,
};
use sandboil_sph::{Csr, Vec2};

/// Means over a step of `exp(-z t)` and of `(1 - exp(-z t)) / z`, with `t` in steps and `z` the decay rate
/// per step. They weight the velocity before the step, and the velocity change by the other forces of the
/// step, in the mean velocity of a dashpot.
pub fn relaxation(z: f64) -> (f64, f64) {
    // Below this the second mean is lost to cancellation; its limit is more accurate.
    const NEGLIGIBLE: f64 = 1e-7;
    if z < NEGLIGIBLE {
        return (1.0, 0.5);
    }
    let relaxed = -(-z).exp_m1() / z;
    (relaxed, (1.0 - relaxed) / z)
}

/// Velocities and accelerations of a section's nodes, followed by the copies of a neighbour's. A force
/// changes both.
pub struct NodalMotion<'a> {
    /// Velocities, m/s.
    pub velocity: &'a mut [Vec2],
    /// Accelerations, m/s2.
    pub acceleration: &'a mut [Vec2],
}

impl NodalMotion<'_> {
    /// Adds an acceleration (m/s2) to node `j` over `dt`, s.
    #[inline]
    pub fn add(&mut self, j: usize, acceleration: Vec2, dt: f64) {
        self.velocity[j] += acceleration * dt;
        self.acceleration[j] += acceleration;
    }
}

/// A dashpot at a point of an edge, in one direction.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Dashpot {
    /// Index of its point.
    pub point: usize,
    /// Unit vector of the velocity component that it resists.
    pub direction: Vec2,
    /// `rho_m C`, kPa s/m.
    pub impedance: f64,
    /// Length of edge that it represents, m.
    pub length: f64,
}

/// Dashpots along an edge.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct Dashpots {
    all: Vec<Dashpot>,
    /// Weights of the velocity on the edge: rows are points, columns velocity nodes.
    trace: Csr<f64>,
    /// `sum_j N_ij sum_k N_kj A_k eta_k / m_j`: decay rate of the velocity at each dashpot, 1/s.
    rate: Vec<f64>,
    before: Vec<f64>,
    traction: Vec<f64>,
    /// Accelerations by a unit force of each dashpot in addition to those by the trace, 1/Mg.
    spread: Option<Csr<Vec2>>,
}

impl Dashpots {
    /// Dashpots at points whose velocities `trace` gives.
    pub fn new(all: Vec<Dashpot>, trace: Csr<f64>, mass: &[f64]) -> Self {
        // Every dashpot resists the component of a unit velocity in its own direction.
        let transposed = trace.transposed(mass.len());
        let mut at_point: Vec<Vec<&Dashpot>> = vec![Vec::new(); trace.rows()];
        for dashpot in &all {
            at_point[dashpot.point].push(dashpot);
        }
        let drag = |node: usize, direction: Vec2| -> f64 {
            let at = |(point, weight): (usize, &f64)| -> f64 {
                let resistance = |d: &&Dashpot| d.length * d.impedance * d.direction.dot(&direction).powi(2);
                weight * at_point[point].iter().map(resistance).sum::<f64>()
            };
            transposed.iter_row(node).map(at).sum()
        };
        let rate = all
            .iter()
            .map(|dashpot| {
                let lost =
                    |(node, weight): (usize, &f64)| weight * drag(node, dashpot.direction) / mass[node];
                trace.iter_row(dashpot.point).map(lost).sum()
            })
            .collect();
        Self { before: vec![0.0; all.len()], traction: vec![0.0; all.len()], rate, trace, all, spread: None }
    }

    /// The dashpots.
    pub fn all(&self) -> &[Dashpot] {
        &self.all
    }

    /// Weights of the velocity on the edge: rows are points, columns velocity nodes.
    pub fn trace(&self) -> &Csr<f64> {
        &self.trace
    }

    /// Adds the accelerations (1/Mg) that a unit force of each dashpot gives to the `nodes` nodes in addition
    /// to those by the trace.
    pub fn spread_by(&mut self, spread: Csr<Vec2>, nodes: usize) {
        let transposed = spread.transposed(nodes);
        for (rate, Dashpot { point, direction, .. }) in self.rate.iter_mut().zip(&self.all) {
            let lost = |(k, response): (usize, &Vec2)| {
                let resisting = &self.all[k];
                let resistance = resisting.length * resisting.impedance * resisting.direction.dot(direction);
                response.dot(direction) * resistance
            };
            let along = |(node, weight): (usize, &f64)| -> f64 {
                weight * transposed.iter_row(node).map(lost).sum::<f64>()
            };
            *rate += self.trace.iter_row(*point).map(along).sum::<f64>();
        }
        self.spread = Some(spread);
    }

    /// Mean traction of the last step of each dashpot in its direction, kPa.
    pub fn traction(&self) -> &[f64] {
        &self.traction
    }

    /// Velocity at a dashpot in its direction, m/s.
    fn velocity_at(&self, dashpot: &Dashpot, velocity: &[Vec2]) -> f64 {
        let along = |(node, weight): (usize, &f64)| weight * velocity[node].dot(&dashpot.direction);
        self.trace.iter_row(dashpot.point).map(along).sum()
    }

    /// Stores the velocities at the dashpots before the step's forces act.
    pub fn begin_step(&mut self, velocity: &[Vec2]) {
        for k in 0..self.all.len() {
            self.before[k] = self.velocity_at(&self.all[k], velocity);
        }
    }

    /// Adds the tractions to velocities that all other forces of the step have already changed. `target` is
    /// the velocity (m/s) towards which each dashpot pulls, in its direction.
    ///
    /// The solution is exact if the other forces are constant over the step, so a dashpot of any strength
    /// neither limits the time step nor overshoots. The coupling between neighbouring points is lumped, which
    /// is exact for uniform motion.
    pub fn end_step(
        &mut self,
        dt: f64,
        mass: &[f64],
        motion: &mut NodalMotion,
        target: impl Fn(usize) -> f64,
    ) {
        // All points read the velocities before any is changed.
        for (k, dashpot) in self.all.iter().enumerate() {
            let (before, moved) = (self.before[k], self.velocity_at(dashpot, motion.velocity));
            let (relaxed, pushed) = relaxation(self.rate[k] * dt);
            self.traction[k] =
                dashpot.impedance * (relaxed * (target(k) - before) - pushed * (moved - before));
        }
        for (k, (dashpot, traction)) in self.all.iter().zip(&self.traction).enumerate() {
            let force = dashpot.direction * (traction * dashpot.length);
            for (node, weight) in self.trace.iter_row(dashpot.point) {
                motion.add(node, force * (weight / mass[node]), dt);
            }
            for (node, response) in self.spread.iter().flat_map(|spread| spread.iter_row(k)) {
                motion.add(node, response * (traction * dashpot.length), dt);
            }
        }
    }

    /// Work of the last step's tractions, kJ/m, from velocities that include all forces of the step.
    pub fn work(&self, dt: f64, velocity: &[Vec2]) -> f64 {
        let dashpots = self.all.iter().zip(&self.traction).zip(&self.before);
        dashpots
            .map(|((dashpot, traction), before)| {
                traction * dashpot.length * 0.5 * (before + self.velocity_at(dashpot, velocity)) * dt
            })
            .sum()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let spread = self.spread.as_ref().map_or(0, Csr::bytes);
        self.trace.bytes() + spread + size_of_val(self.all.as_slice()) + 3 * size_of_val(self.rate.as_slice())
    }
}

/// Weights of the velocity field at points of an edge. The printed operators use the outermost node itself
/// (Section 4.2).
pub fn trace(model: &Model, position: &[Vec2], points: &[Vec2], nodes: &[usize]) -> Csr<f64> {
    match model.numerics.operators {
        Operators::Conservative | Operators::Dual => point_weights(model, position, points),
        Operators::Printed => {
            let mut table = Csr::with_capacity(nodes.len(), nodes.len());
            for &node in nodes {
                table.push_row(&mut [(crate::section::node_id::id(node), 1.0)]);
            }
            table
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dashpot_of_any_strength_relaxes_without_overshoot() {
        assert_eq!(relaxation(0.0), (1.0, 0.5));
        for z in [1e-7, 1e-5, 1e-3, 0.1, 1.0, 10.0, 1e6] {
            let (relaxed, pushed) = relaxation(z);
            // The decay over the step, and the second mean as its integral.
            assert!((1.0 - z * relaxed - (-z).exp()).abs() < 1e-14 * z.max(1.0), "{z}");
            let exact: f64 =
                (0..1000).map(|k| -(-z * (f64::from(k) + 0.5) / 1000.0).exp_m1() / z / 1000.0).sum();
            assert!((pushed - exact).abs() < 1e-4 * exact.max(1e-3), "{z}: {pushed} {exact}");
        }
    }
}
