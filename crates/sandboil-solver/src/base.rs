//! Compliant base (Eq. 14 as corrected): an incoming shear wave and a dashpot, through the trace of the
//! velocity field on the base.

use crate::{
    geometry::point_weights,
    model::{Model, Operators},
};
use sandboil_sph::{Csr, Vec2};

/// Velocity history of the upgoing wave at the base: half of an outcrop motion, m/s.
#[derive(Debug, Clone, PartialEq)]
pub struct UpgoingWave {
    /// Sampling interval, s.
    pub interval: f64,
    /// Horizontal velocity, m/s, first sample at time zero; at rest after the last.
    pub velocity: Vec<f64>,
}

impl UpgoingWave {
    /// Velocity at a time by linear interpolation, zero outside the record.
    pub fn at(&self, time: f64) -> f64 {
        let place = time / self.interval;
        if !(place >= 0.0) {
            return 0.0;
        }
        let before = place.floor();
        let fraction = place - before;
        let sample = |index: f64| {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole and not negative
            self.velocity.get(index as usize).copied().unwrap_or(0.0)
        };
        sample(before) * (1.0 - fraction) + sample(before + 1.0) * fraction
    }
}

/// Means over a step of `exp(-z t)` and of what a constant push moves meanwhile, `(1 - exp(-z t)) / z`, with `t` in
/// steps and `z` the decay of a step: what the dashpot feels of the velocity before and of the step's other forces.
fn relaxation(z: f64) -> (f64, f64) {
    // Below, the second mean is lost to cancellation, and its limit is closer than that.
    const NEGLIGIBLE: f64 = 1e-7;
    if z < NEGLIGIBLE {
        return (1.0, 0.5);
    }
    let relaxed = -(-z).exp_m1() / z;
    (relaxed, (1.0 - relaxed) / z)
}

/// One boundary point below each node of the lowest row.
#[derive(Debug, Clone)]
pub struct CompliantBase {
    /// Linear-fit weights of the velocity on the base: rows are base points, columns velocity nodes.
    trace: Csr<f64>,
    /// Dashpot coefficient `eta = rho_m C_s`, kPa s/m.
    impedance: Vec<f64>,
    /// `sum_j N_ij sum_k N_kj A_k eta_k / m_j`: what a unit of the trace velocity loses in a second, 1/s.
    rate: Vec<f64>,
    /// Length of base each point stands for, m.
    length: f64,
    wave: Option<UpgoingWave>,
    trace_before: Vec<f64>,
}

impl CompliantBase {
    /// Base points of the lowest row of `model`, with the impedance (kPa s/m) of each.
    pub fn new(
        model: &Model,
        position: &[Vec2],
        mass: &[f64],
        impedance: Vec<f64>,
        wave: Option<UpgoingWave>,
    ) -> Self {
        let points = base_points(model, position);
        let trace = match model.numerics.operators {
            Operators::Conservative => point_weights(model, position, &points),
            Operators::Printed => lowest_row(model, position),
        };
        let length = model.spacing.x;
        let transposed = trace.transposed(position.len());
        let drag = |node: usize| -> f64 {
            transposed.iter_row(node).map(|(point, weight)| weight * length * impedance[point]).sum()
        };
        let rate: Vec<f64> = (0..points.len())
            .map(|point| trace.iter_row(point).map(|(node, weight)| weight * drag(node) / mass[node]).sum())
            .collect();
        Self { trace_before: vec![0.0; points.len()], trace, impedance, rate, length, wave }
    }

    /// Dashpot coefficients, kPa s/m.
    pub fn impedance(&self) -> &[f64] {
        &self.impedance
    }

    /// Remembers the trace before the step's forces act.
    pub fn begin_step(&mut self, velocity: &[Vec2]) {
        for (point, before) in self.trace_before.iter_mut().enumerate() {
            *before = self.trace.iter_row(point).map(|(node, weight)| weight * velocity[node].x).sum();
        }
    }

    /// Adds the base traction of Eq. 14 to velocities that all other forces of the step have moved already.
    ///
    /// The trace relaxes towards twice the upgoing velocity; over a step of constant other forces this is solved
    /// exactly, so a dashpot of any strength neither limits the time step nor overshoots. The coupling between
    /// neighbouring points is lumped, exact for uniform motion.
    pub fn end_step(
        &mut self,
        time: f64,
        dt: f64,
        mass: &[f64],
        velocity: &mut [Vec2],
        acceleration: &mut [Vec2],
    ) {
        let incoming = 2.0 * self.wave.as_ref().map_or(0.0, |wave| wave.at(time));
        for point in 0..self.impedance.len() {
            let moved: f64 = self.trace.iter_row(point).map(|(node, weight)| weight * velocity[node].x).sum();
            let before = self.trace_before[point];
            let (relaxed, pushed) = relaxation(self.rate[point] * dt);
            // The traction is kept in the slot of the old trace until all points have read the velocities.
            self.trace_before[point] =
                self.impedance[point] * (relaxed * (incoming - before) - pushed * (moved - before));
        }
        for point in 0..self.impedance.len() {
            let force = self.trace_before[point] * self.length;
            for (node, weight) in self.trace.iter_row(point) {
                let pushed = weight * force / mass[node];
                velocity[node].x += dt * pushed;
                acceleration[node].x += pushed;
            }
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.trace.bytes() + 3 * size_of_val(self.impedance.as_slice())
    }
}

/// The printed trace: the outermost layer of nodes itself (Section 4.2).
fn lowest_row(model: &Model, position: &[Vec2]) -> Csr<f64> {
    let mut table = Csr::with_capacity(0, 0);
    for node in lowest_nodes(model, position) {
        table.push_row(&mut [(u32::try_from(node).unwrap_or(u32::MAX), 1.0)]);
    }
    table
}

/// Nodes of the lowest row.
pub fn lowest_nodes(model: &Model, position: &[Vec2]) -> impl Iterator<Item = usize> {
    let top = model.base_elevation + model.spacing.y;
    position.iter().enumerate().filter(move |(_, x)| x.y < top).map(|(node, _)| node)
}

/// Points on the base below the nodes of the lowest row, m.
pub fn base_points(model: &Model, position: &[Vec2]) -> Vec<Vec2> {
    lowest_nodes(model, position).map(|node| Vec2::new(position[node].x, model.base_elevation)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dashpot_of_any_strength_relaxes_without_overshoot() {
        assert_eq!(relaxation(0.0), (1.0, 0.5));
        for z in [1e-7, 1e-5, 1e-3, 0.1, 1.0, 10.0, 1e6] {
            let (relaxed, pushed) = relaxation(z);
            // The decay over the step, and that its integral gives the second mean.
            assert!((1.0 - z * relaxed - (-z).exp()).abs() < 1e-14 * z.max(1.0), "{z}");
            let exact: f64 =
                (0..1000).map(|k| -(-z * (f64::from(k) + 0.5) / 1000.0).exp_m1() / z / 1000.0).sum();
            assert!((pushed - exact).abs() < 1e-4 * exact.max(1e-3), "{z}: {pushed} {exact}");
        }
    }

    #[test]
    fn the_wave_is_linear_between_samples_and_zero_outside() {
        let wave = UpgoingWave { interval: 0.5, velocity: vec![1.0, 3.0] };
        assert_eq!([-0.1, 0.0, 0.25, 0.5, 0.75, 1.1].map(|t| wave.at(t)), [0.0, 1.0, 2.0, 3.0, 1.5, 0.0]);
        assert_eq!(wave.at(f64::NAN), 0.0);
    }
}
