//! Boundaries that let waves out and in: dashpots on the trace of the velocity field, at the compliant base (Eq. 14 as
//! corrected) and on free-field sides (Eq. 15 as corrected).

use crate::{
    boundary::EdgeNodes,
    geometry::point_weights,
    model::{Model, Operators},
};
use sandboil_sph::{Csr, Vec2};

/// Velocity history of the upgoing waves at the base: half of an outcrop motion, m/s.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct UpgoingWave {
    /// Sampling interval, s.
    pub interval: f64,
    /// Horizontal velocity (shear wave), m/s, first sample at time zero; at rest after the last.
    pub horizontal: Vec<f64>,
    /// Vertical velocity (compression wave), m/s; empty: none.
    pub vertical: Vec<f64>,
}

impl UpgoingWave {
    /// A shear wave alone, of horizontal velocities in m/s.
    pub fn shear(interval: f64, horizontal: Vec<f64>) -> Self {
        Self { interval, horizontal, vertical: Vec::new() }
    }

    /// Horizontal velocity at a time, m/s.
    pub fn horizontal_at(&self, time: f64) -> f64 {
        interpolated(&self.horizontal, time / self.interval)
    }

    /// Vertical velocity at a time, m/s.
    pub fn vertical_at(&self, time: f64) -> f64 {
        interpolated(&self.vertical, time / self.interval)
    }
}

/// Linear interpolation between samples, zero outside the record; `place` counts samples.
fn interpolated(samples: &[f64], place: f64) -> f64 {
    if !(place >= 0.0) {
        return 0.0;
    }
    let before = place.floor();
    let fraction = place - before;
    let sample = |index: f64| {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole and not negative
        samples.get(index as usize).copied().unwrap_or(0.0)
    };
    sample(before) * (1.0 - fraction) + sample(before + 1.0) * fraction
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

/// A dashpot at a point of an edge, in one direction.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Dashpot {
    /// Index of its point.
    pub point: usize,
    /// Unit vector of the velocity it feels.
    pub direction: Vec2,
    /// `rho_m C`, kPa s/m.
    pub impedance: f64,
    /// Length of edge it stands for, m.
    pub length: f64,
}

/// Dashpots along an edge.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct Dashpots {
    all: Vec<Dashpot>,
    /// Weights of the velocity on the edge: rows are points, columns velocity nodes.
    trace: Csr<f64>,
    /// `sum_j N_ij sum_k N_kj A_k eta_k / m_j`: what a unit of the trace velocity loses in a second, 1/s.
    rate: Vec<f64>,
    before: Vec<f64>,
    traction: Vec<f64>,
    /// What a unit force of each dashpot adds to accelerations beside those of the trace, 1/Mg, if anything.
    spread: Option<Csr<Vec2>>,
}

impl Dashpots {
    /// Dashpots on points whose velocity `trace` reads.
    pub fn new(all: Vec<Dashpot>, trace: Csr<f64>, mass: &[f64]) -> Self {
        // A unit velocity in the dashpot's direction is resisted by every dashpot, each as far as it looks that way.
        let transposed = trace.transposed(mass.len());
        let mut at_point: Vec<Vec<&Dashpot>> = vec![Vec::new(); trace.rows()];
        for dashpot in &all {
            at_point[dashpot.point].push(dashpot);
        }
        let drag = |node: usize, direction: Vec2| -> f64 {
            let at = |(point, weight): (usize, &f64)| -> f64 {
                let felt = |d: &&Dashpot| d.length * d.impedance * d.direction.dot(&direction).powi(2);
                weight * at_point[point].iter().map(felt).sum::<f64>()
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

    /// Lets a unit force of each dashpot give `nodes` nodes these accelerations (1/Mg) beside those of the trace.
    pub fn spread_by(&mut self, spread: Csr<Vec2>, nodes: usize) {
        let transposed = spread.transposed(nodes);
        for (rate, Dashpot { point, direction, .. }) in self.rate.iter_mut().zip(&self.all) {
            let lost = |(k, response): (usize, &Vec2)| {
                let resisting = &self.all[k];
                let felt = resisting.length * resisting.impedance * resisting.direction.dot(direction);
                response.dot(direction) * felt
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

    fn felt(&self, dashpot: &Dashpot, velocity: &[Vec2]) -> f64 {
        let along = |(node, weight): (usize, &f64)| weight * velocity[node].dot(&dashpot.direction);
        self.trace.iter_row(dashpot.point).map(along).sum()
    }

    /// Remembers the trace before the step's forces act.
    pub fn begin_step(&mut self, velocity: &[Vec2]) {
        for k in 0..self.all.len() {
            self.before[k] = self.felt(&self.all[k], velocity);
        }
    }

    /// Adds the tractions to velocities that all other forces of the step have moved already. `target` is the velocity
    /// (m/s) in its direction towards which each dashpot pulls.
    ///
    /// Over a step of constant other forces the pull is solved exactly, so a dashpot of any strength neither limits the
    /// time step nor overshoots. The coupling between neighbouring points is lumped, exact for uniform motion.
    pub fn end_step(
        &mut self,
        dt: f64,
        mass: &[f64],
        (velocity, acceleration): (&mut [Vec2], &mut [Vec2]),
        target: impl Fn(usize) -> f64,
    ) {
        // All points read the velocities before any is changed.
        for (k, dashpot) in self.all.iter().enumerate() {
            let (before, moved) = (self.before[k], self.felt(dashpot, velocity));
            let (relaxed, pushed) = relaxation(self.rate[k] * dt);
            self.traction[k] =
                dashpot.impedance * (relaxed * (target(k) - before) - pushed * (moved - before));
        }
        for (k, (dashpot, traction)) in self.all.iter().zip(&self.traction).enumerate() {
            let force = dashpot.direction * (traction * dashpot.length);
            for (node, weight) in self.trace.iter_row(dashpot.point) {
                let pushed = force * (weight / mass[node]);
                velocity[node] += pushed * dt;
                acceleration[node] += pushed;
            }
            for (node, response) in self.spread.iter().flat_map(|spread| spread.iter_row(k)) {
                let pushed = response * (traction * dashpot.length);
                velocity[node] += pushed * dt;
                acceleration[node] += pushed;
            }
        }
    }

    /// Work of the last step's tractions on velocities that have had all their forces, kJ/m.
    pub fn work(&self, dt: f64, velocity: &[Vec2]) -> f64 {
        let dashpots = self.all.iter().zip(&self.traction).zip(&self.before);
        dashpots
            .map(|((dashpot, traction), before)| {
                traction * dashpot.length * 0.5 * (before + self.felt(dashpot, velocity)) * dt
            })
            .sum()
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let spread = self.spread.as_ref().map_or(0, Csr::bytes);
        self.trace.bytes() + spread + size_of_val(self.all.as_slice()) + 3 * size_of_val(self.rate.as_slice())
    }
}

/// Trace of the velocity field at points of an edge. The printed set reads the outermost node itself (Section 4.2).
pub fn trace(model: &Model, position: &[Vec2], points: &[Vec2], nodes: &[usize]) -> Csr<f64> {
    match model.numerics.operators {
        Operators::Conservative => point_weights(model, position, points),
        Operators::Printed => {
            let mut table = Csr::with_capacity(nodes.len(), nodes.len());
            for &node in nodes {
                table.push_row(&mut [(crate::boundary::id(node), 1.0)]);
            }
            table
        }
    }
}

/// What the base does vertically while it is shaken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Vertical {
    /// Held, as the elements of a column are: compression waves come back.
    Roller,
    /// Held by the stored reaction alone: compression waves leave, and may come in.
    Absorbing,
}

/// A half-space given by its own properties.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct HalfSpace {
    /// Shear-wave speed, m/s.
    pub shear_speed: f64,
    /// Compression-wave speed, m/s; needed where the base absorbs vertically or slopes.
    pub compression_speed: Option<f64>,
    /// Density, Mg/m3.
    pub density: f64,
}

/// Impedances `rho C_s` and `rho C_p` (kPa s/m) and the speeds (m/s) of the half-space below a point of the base.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Impedance {
    /// Density, Mg/m3.
    pub density: f64,
    /// Shear-wave speed, m/s.
    pub shear_speed: f64,
    /// Compression-wave speed, undrained where there is water, m/s.
    pub compression_speed: f64,
}

/// Which wave comes to a stretch of the base, and when.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct BaseSegment {
    /// Its ends, m; what lies beyond the outermost ones belongs to them.
    pub extent: [f64; 2],
    /// Index of its wave; none: no motion.
    pub wave: Option<usize>,
    /// When the wave's first sample reaches its left end, s.
    pub delay: f64,
    /// How much later each metre further right is reached, s/m.
    pub slowness: f64,
}

impl BaseSegment {
    /// One wave for all of the base at once.
    pub fn everywhere(wave: Option<usize>) -> Self {
        Self { extent: [f64::NEG_INFINITY, f64::INFINITY], wave, delay: 0.0, slowness: 0.0 }
    }
}

/// The base of a shaking stage.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Base {
    /// What it does vertically.
    pub vertical: Vertical,
    /// The half-space, instead of the soil above the base.
    pub half_space: Option<HalfSpace>,
    /// The waves that its segments name.
    pub waves: Vec<UpgoingWave>,
    /// Its segments from left to right.
    pub segments: Vec<BaseSegment>,
    /// Elevation at which the waves' times hold, m; none: the lowest point of the base.
    pub datum: Option<f64>,
}

impl Base {
    /// A compliant roller base under one wave, or none.
    pub fn shaken_by(wave: Option<UpgoingWave>) -> Self {
        let segment = BaseSegment::everywhere(wave.as_ref().map(|_| 0));
        Self {
            vertical: Vertical::Roller,
            half_space: None,
            waves: wave.into_iter().collect(),
            segments: vec![segment],
            datum: None,
        }
    }

    /// What comes to the place `x`, as a segment for all of a base.
    pub fn at(&self, x: f64) -> BaseSegment {
        let segment = self.segments.iter().find(|s| x <= s.extent[1]).or(self.segments.last());
        segment.map_or(BaseSegment::everywhere(None), |segment| {
            let run = if segment.slowness == 0.0 { 0.0 } else { segment.slowness * (x - segment.extent[0]) };
            BaseSegment { delay: segment.delay + run, ..BaseSegment::everywhere(segment.wave) }
        })
    }
}

/// What comes in at one dashpot of the base: velocities of the half-space's waves, weighted.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Incoming {
    wave: usize,
    /// Delay of the shear and of the compression wave, s.
    delay: [f64; 2],
    /// Pull for a unit of the upgoing horizontal and vertical velocity.
    factor: Vec2,
}

/// The compliant base: dashpots that pull towards the motion of the half-space.
///
/// On a half-space with the upgoing waves `v_su`, `v_pu` a dashpot's traction is `sigma_up . n + eta (v_up - v)`, with
/// the stress `sigma_up` of the waves. On a level base this is Eq. 14, `2 rho C_s v_su - eta_s v_x` and the same for P;
/// the waves rise with level fronts, so on an inclined base their stress turns with the normal and they are late by the
/// height over the datum.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct CompliantBase {
    dashpots: Dashpots,
    incoming: Vec<Option<Incoming>>,
    waves: Vec<UpgoingWave>,
    impedance: Vec<Impedance>,
}

impl CompliantBase {
    /// A dashpot below each of the lowest nodes, on half-spaces of the given impedances.
    pub fn new(
        model: &Model,
        (edges, position): (&EdgeNodes, &[Vec2]),
        mass: &[f64],
        impedance: Vec<Impedance>,
        base: &Base,
    ) -> Self {
        let points = edges.base_points(model, position);
        let datum = base.datum.unwrap_or_else(|| model.outline.lowest());
        let (mut all, mut incoming) = (Vec::new(), Vec::new());
        for ((point, at), below) in points.iter().enumerate().zip(&impedance) {
            let Impedance { density, shear_speed, compression_speed } = *below;
            let (eta_s, eta_p) = (density * shear_speed, density * compression_speed);
            let normal = model.outline.base_normal(at.x);
            let tangent = Vec2::new(-normal.y, normal.x);
            // What resists a horizontal motion of an inclined roller base: its components along and across.
            let horizontal = (Vec2::x(), eta_s * tangent.x.powi(2) + eta_p * normal.x.powi(2));
            let directions = match base.vertical {
                Vertical::Roller => vec![horizontal],
                Vertical::Absorbing => vec![(tangent, eta_s), (normal, eta_p)],
            };
            // Stress of upgoing waves of unit velocity on the base.
            let lateral = eta_p - 2.0 * eta_s * shear_speed / compression_speed;
            let shear_wave = -eta_s * Vec2::new(normal.y, normal.x);
            let compression_wave = -Vec2::new(lateral * normal.x, eta_p * normal.y);
            for (direction, impedance) in directions {
                all.push(Dashpot { point, direction, impedance, length: model.spacing.x / -normal.y });
                let (rise, arrival) = (at.y - datum, base.at(at.x));
                incoming.push(arrival.wave.map(|wave| Incoming {
                    wave,
                    delay: [shear_speed, compression_speed].map(|speed| arrival.delay + rise / speed),
                    factor: Vec2::new(
                        direction.x + direction.dot(&shear_wave) / impedance,
                        direction.y + direction.dot(&compression_wave) / impedance,
                    ),
                }));
            }
        }
        let dashpots = Dashpots::new(all, trace(model, position, &points, &edges.base), mass);
        Self { dashpots, incoming, waves: base.waves.clone(), impedance }
    }

    /// The half-space below each of the lowest nodes.
    pub fn impedance(&self) -> &[Impedance] {
        &self.impedance
    }

    /// The dashpots.
    pub fn dashpots(&self) -> &Dashpots {
        &self.dashpots
    }

    /// See [`Dashpots::spread_by`].
    pub fn spread_by(&mut self, spread: Csr<Vec2>, nodes: usize) {
        self.dashpots.spread_by(spread, nodes);
    }

    /// See [`Dashpots::begin_step`].
    pub fn begin_step(&mut self, velocity: &[Vec2]) {
        self.dashpots.begin_step(velocity);
    }

    /// See [`Dashpots::end_step`].
    pub fn end_step(&mut self, time: f64, dt: f64, mass: &[f64], motion: (&mut [Vec2], &mut [Vec2])) {
        let (incoming, waves) = (&self.incoming, &self.waves);
        self.dashpots.end_step(dt, mass, motion, |k| {
            incoming[k].map_or(0.0, |incoming| {
                let (wave, [s, p]) = (&waves[incoming.wave], incoming.delay);
                incoming.factor.x * wave.horizontal_at(time - s)
                    + incoming.factor.y * wave.vertical_at(time - p)
            })
        });
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let waves = |wave: &UpgoingWave| 8 * (wave.horizontal.len() + wave.vertical.len());
        self.dashpots.bytes()
            + size_of_val(self.incoming.as_slice())
            + size_of_val(self.impedance.as_slice())
            + self.waves.iter().map(waves).sum::<usize>()
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
            // The decay over the step, and that its integral gives the second mean.
            assert!((1.0 - z * relaxed - (-z).exp()).abs() < 1e-14 * z.max(1.0), "{z}");
            let exact: f64 =
                (0..1000).map(|k| -(-z * (f64::from(k) + 0.5) / 1000.0).exp_m1() / z / 1000.0).sum();
            assert!((pushed - exact).abs() < 1e-4 * exact.max(1e-3), "{z}: {pushed} {exact}");
        }
    }

    #[test]
    fn the_wave_is_linear_between_samples_and_zero_outside() {
        let wave = UpgoingWave { interval: 0.5, horizontal: vec![1.0, 3.0], vertical: Vec::new() };
        let times = [-0.1, 0.0, 0.25, 0.5, 0.75, 1.1];
        assert_eq!(times.map(|t| wave.horizontal_at(t)), [0.0, 1.0, 2.0, 3.0, 1.5, 0.0]);
        assert_eq!(times.map(|t| wave.vertical_at(t)), [0.0; 6]);
        assert_eq!(wave.horizontal_at(f64::NAN), 0.0);
    }

    #[test]
    fn a_segment_is_reached_at_its_delay_and_slowness() {
        let segment = |from: f64, to: f64, delay: f64, slowness: f64| BaseSegment {
            extent: [from, to],
            wave: Some(0),
            delay,
            slowness,
        };
        let segments = vec![segment(0.0, 10.0, 0.0, 0.01), segment(10.0, 20.0, 0.5, 0.0)];
        let base = Base { segments, ..Base::shaken_by(Some(UpgoingWave::default())) };
        let late = |x: f64| base.at(x).delay;
        assert_eq!([0.0, 5.0, 10.0, 11.0, 25.0].map(late), [0.0, 0.05, 0.1, 0.5, 0.5]);
    }
}
