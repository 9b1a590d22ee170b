//! Integration of the rate equations over a strain increment.
//!
//! The small yield surface makes the equations stiff: the loading direction adjusts over a shear strain of about
//! `m p/(2 G)`. Stability therefore limits the sub-steps, and a method of higher order brings little.

use super::{
    PM4Sand, State,
    rates::{Change, Memory, Point, Reading, direction},
    reversal,
    state::Strain,
    surfaces::{elastic_increment, stress_ratio},
};
use crate::{Deviator, Integrator, UpdateReport};
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// Lower limit of the mean stress (the pressure floor), relative to `p_min`.
const FLOOR_FRACTION: f64 = 0.2;
/// Largest stress ratio kept at the pressure floor, relative to the critical ratio.
const FLOOR_STRESS_RATIO: f64 = 0.8;
/// Tolerance, in parts, when an increment is divided, so that round-off of the strain does not add a part.
const PART_SLACK: f64 = 1e-4;
/// Cosine between yield normal and elastic stress increment below which a point on the surface first moves inside.
const INWARD_COSINE: f64 = -1e-4;
/// Smallest factor applied to a rejected sub-step; used also where the equations have no solution.
const STRONGEST_CUT: f64 = 0.1;
/// Safety factor on the sub-step size from the error estimate.
const SAFETY: f64 = 0.8;
/// Smallest ratio of a sub-step to the accepted one before it.
const MILDEST_CUT: f64 = 0.5;
/// Largest Runge-Kutta sub-step, relative to the strain `m p/G`. At a ratio of two the result is wrong without a
/// warning.
const RK4_STABILITY: f64 = 0.5;
/// Reference stress that is added to `sqrt(2) p` in the relative error, relative to atmospheric pressure.
const ERROR_SCALE: f64 = 1.0 / 30.0;
/// Largest number of iterations of the reference drift correction.
const DRIFT_ITERATIONS: usize = 25;

/// An integration scheme and its constants.
#[derive(Debug, Clone, Copy)]
struct Scheme {
    stages: Stages,
    /// Error allowed per sub-step.
    tolerance: f64,
    /// Smallest sub-step, as a share of the part.
    smallest: f64,
    /// Largest ratio of a sub-step to the one before it.
    growth: f64,
    /// True: as implemented by Chen and Arduino (2021), with moduli of the last commit, error of the stress only,
    /// iterative drift correction, and no fabric change in a forced acceptance.
    reference: bool,
}

#[derive(Debug, Clone, Copy)]
enum Stages {
    Two,
    Four,
}

impl Scheme {
    fn of(integrator: &Integrator) -> Self {
        // At most a hundred sub-steps per part. Where more would be needed, the back-stress ratio alternates across the
        // bounding surface, which no step resolves.
        let base = Self {
            stages: Stages::Two,
            tolerance: Integrator::DEFAULT_TOLERANCE,
            smallest: 1e-2,
            growth: 5.0,
            reference: false,
        };
        match *integrator {
            Integrator::ModifiedEuler { tolerance, .. } => Self { tolerance, ..base },
            Integrator::RungeKutta4 { .. } => Self { stages: Stages::Four, ..base },
            Integrator::Reference => {
                Self { tolerance: 1e-5, smallest: 1e-4, growth: f64::INFINITY, reference: true, ..base }
            }
        }
    }
}

/// Result of one attempted sub-step.
struct Attempt {
    point: Point,
    error: f64,
    loading_index: f64,
}

impl PM4Sand {
    /// Divides an increment into parts, and integrates and commits each.
    pub(super) fn integrate(
        &self,
        state: &mut State,
        strain: Strain,
        integrator: &Integrator,
        report: &mut UpdateReport,
    ) {
        let scheme = Scheme::of(integrator);
        let parts = (strain.largest_component() / integrator.max_increment() - PART_SLACK).ceil().max(1.0);
        let part = strain.scaled(1.0 / parts);
        let mut done = 0.0;
        while done < parts {
            self.advance(state, part, scheme, report);
            done += 1.0;
        }
    }

    /// One committed part: reversal check, elastic or plastic integration, commit.
    fn advance(&self, state: &mut State, mut strain: Strain, scheme: Scheme, report: &mut UpdateReport) {
        if self.options.gap_memory && state.gap > 0.0 {
            // Separated grains carry no stress: compression first closes the gap, expansion widens it.
            let closing = strain.volume.min(state.gap);
            state.gap -= closing;
            state.volumetric_strain += closing;
            if state.gap > 0.0 {
                report.pressure_floors += 1;
                return;
            }
            strain = strain.scaled(1.0 - closing / strain.volume);
        }
        let before = Point::of(state);
        let trial = before.moved(&Change::elastic(state.moduli, strain), 1.0);
        let floor = FLOOR_FRACTION * state.p_min;
        if strain.volume < 0.0 && trial.p <= floor {
            if self.options.gap_memory {
                state.gap += (floor - trial.p) / state.moduli.mean_stress_stiffness();
            }
            self.at_floor(&before, state.p_min, report).store(state);
        } else {
            let trial_direction = direction(trial.p, trial.s, state.alpha, self.constants.p_atm);
            reversal::detect(state, trial_direction, report);
            if self.yield_function(trial.p, trial.s, state.alpha) <= self.yield_tolerance() {
                trial.store(state);
            } else {
                self.integrate_plastic(state, strain, scheme, report).store(state);
            }
        }
        state.volumetric_strain += strain.volume;
        self.commit(state, before.fabric, report);
    }

    /// End of a part (Chen and Arduino 2021): updates the moduli, limits the stress to the bounding surface and updates
    /// the cumulative fabric.
    fn commit(&self, state: &mut State, fabric_before: Deviator, report: &mut UpdateReport) {
        state.moduli = self.committed_moduli(state);
        let p = state.mean.max(state.p_min);
        let ratio = stress_ratio(p, state.deviator);
        if ratio > state.bounding_ratio {
            report.bounding_caps += 1;
            state.deviator = state.deviator * (state.bounding_ratio / ratio);
            // Below `p_min` the actual stress ratio exceeds the one in the formulas, which use `p_min`. The yield
            // surface must include the actual ratio.
            let kept = state.bounding_ratio * (p / state.mean);
            state.alpha = state.deviator * ((kept - self.constants.m) / (kept * state.mean));
        }
        if state.fabric != fabric_before {
            state.fabric_cumulative += FRAC_1_SQRT_2 * (state.fabric - fabric_before).norm();
            state.fabric_peak = state.fabric_peak.max(FRAC_1_SQRT_2 * state.fabric.norm());
        }
    }

    /// The elastic share of a part that ends outside the yield surface. Along an elastic path the squared yield
    /// function is quadratic. The required root is the one where the function increases, both for a path that starts
    /// inside and for one that starts on the surface and first moves inside.
    fn elastic_share(&self, state: &State, strain: Strain) -> f64 {
        let (dp, ds) = elastic_increment(state.moduli, strain);
        let outward = state.deviator - state.alpha * state.mean;
        let change = ds - state.alpha * dp;
        let radius = self.constants.m * FRAC_1_SQRT_2;
        let inside = outward.norm() - radius * state.mean < -self.yield_tolerance();
        let inward =
            outward.contract(ds) < INWARD_COSINE * outward.norm() * (2.0 * dp * dp + ds.contract(ds)).sqrt();
        if !inside && !inward {
            return 0.0;
        }
        let square = radius * radius;
        let a = change.contract(change) - square * dp * dp;
        let b = outward.contract(change) - square * state.mean * dp;
        let c = outward.contract(outward) - square * state.mean * state.mean;
        let root = (b * b - a * c).max(0.0).sqrt();
        // Two forms of the same root; each avoids cancellation for one sign of `b`.
        let share = if b > 0.0 { -c / (b + root) } else { (root - b) / a };
        if share > 0.0 { share.min(1.0) } else { 0.0 }
    }

    /// Integrates a part that leaves the yield surface; returns its end point.
    fn integrate_plastic(
        &self,
        state: &mut State,
        strain: Strain,
        scheme: Scheme,
        report: &mut UpdateReport,
    ) -> Point {
        let elastic = self.elastic_share(state, strain);
        let (moduli, floor) = (state.moduli, FLOOR_FRACTION * state.p_min);
        let committed = Point::of(state);
        let mut point = committed.moved(&Change::elastic(moduli, strain.scaled(elastic)), 1.0);
        let memory = Memory::of(self, state);
        let reading = Reading {
            held_moduli: scheme.reference.then_some(moduli),
            clamp: self.options.clamp_plastic_modulus && !scheme.reference,
        };
        let rest = strain.scaled(1.0 - elastic);
        let strained = state.volumetric_strain + elastic * strain.volume;
        let tolerance = self.yield_tolerance();

        // Share of the remaining strain over which the loading direction adjusts. A longer sub-step is rejected, or
        // unstable.
        let (p_min, elastic_shear) = (state.p_min, moduli.shear * rest.largest_component());
        let relaxation = |p: f64| self.constants.m * p.max(p_min) / elastic_shear;

        let first = if scheme.reference { 1.0 } else { relaxation(point.p).min(1.0) };
        let (mut remaining, mut size, mut may_grow) = (1.0_f64, first, true);
        while remaining > 0.0 {
            if let Stages::Four = scheme.stages {
                size = size.min(RK4_STABILITY * relaxation(point.p)).max(scheme.smallest).min(remaining);
            }
            let step = rest.scaled(size);
            let void_ratio = state.void_ratio_at(strained + (1.0 - remaining) * rest.volume);
            let bounding = &mut state.bounding_ratio;
            let at_smallest = size <= scheme.smallest;
            let attempt = match scheme.stages {
                Stages::Two => self.two_stages(&point, &memory, void_ratio, step, reading, scheme, bounding),
                Stages::Four => self.four_stages(&point, &memory, void_ratio, step, reading, bounding),
            };
            report.evaluations += match scheme.stages {
                Stages::Two => 2,
                Stages::Four => 4,
            };
            let mut next = f64::INFINITY;
            let mut end = if let Some(attempt) = attempt {
                let factor = SAFETY * (scheme.tolerance / attempt.error).sqrt();
                // NaN is not `<=` the tolerance, so it is rejected too.
                let good = attempt.error <= scheme.tolerance;
                if !good && !at_smallest {
                    size = (factor.max(STRONGEST_CUT) * size).max(scheme.smallest);
                    may_grow = false;
                    continue;
                }
                let mut end = attempt.point;
                if good {
                    next = factor.max(MILDEST_CUT).min(if may_grow { scheme.growth } else { 1.0 }) * size;
                } else {
                    report.forced_acceptances += 1;
                    next = factor.max(STRONGEST_CUT) * size;
                    if scheme.reference {
                        end.fabric = point.fabric;
                    }
                }
                if scheme.reference && end.p >= floor {
                    let stress = (void_ratio, moduli, attempt.loading_index);
                    self.correct_drift(&mut end, committed.fabric, &memory, stress, bounding);
                }
                end
            } else if at_smallest {
                // The equations have no solution here: apply the strain elastically; the yield surface is moved below.
                report.forced_acceptances += 1;
                point.moved(&Change::elastic(moduli, step), 1.0)
            } else {
                size = (STRONGEST_CUT * size).max(scheme.smallest);
                may_grow = false;
                continue;
            };
            report.substeps += 1;
            if end.p < floor {
                return self.at_floor(&point, p_min, report);
            }
            let drift = self.yield_function(end.p, end.s, end.alpha);
            if drift > tolerance {
                let n = direction(end.p, end.s, end.alpha, self.constants.p_atm);
                end.alpha += n * (drift / end.p);
            }
            point = end;
            may_grow = true;
            remaining = if size < remaining { remaining - size } else { 0.0 };
            size = next.max(scheme.smallest).min(remaining);
        }
        point
    }

    /// Modified Euler with an error estimate: half the difference of the two stages' stresses, relative to the stress. The
    /// back-stress ratio has no error of its own: it stays within `m/sqrt(2)` of the stress ratio, so the error of the
    /// stress controls it. `None` where a stage has no solution.
    #[inline]
    #[expect(clippy::too_many_arguments, reason = "the context of one sub-step")]
    fn two_stages(
        &self,
        point: &Point,
        memory: &Memory,
        void_ratio: f64,
        step: Strain,
        reading: Reading,
        scheme: Scheme,
        bounding: &mut f64,
    ) -> Option<Attempt> {
        let first = self.change(point, memory, void_ratio, step, reading, bounding)?;
        let predicted = point.moved(&first, 1.0);
        let second = self.change(&predicted, memory, void_ratio, step, reading, bounding)?;
        let end = point.moved(&first, 0.5).moved(&second, 0.5);
        if !(end.p > 0.0) {
            return None;
        }
        let (dp, ds) = (second.p - first.p, second.s - first.s);
        let difference = (2.0 * dp * dp + ds.contract(ds)).sqrt();
        let error = if scheme.reference {
            let scale = point.stress_norm();
            // Below 0.5 kPa the error is absolute, in kPa; `unit` is one kPa in the unit of `p_atm`.
            let unit = self.constants.p_atm / 101.3;
            if scale < 0.5 * unit { difference / unit } else { 0.5 * difference / scale }
        } else {
            0.5 * difference / (SQRT_2 * point.p + ERROR_SCALE * self.constants.p_atm)
        };
        Some(Attempt { point: end, error, loading_index: second.loading_index })
    }

    /// Classical fourth-order Runge-Kutta; no error estimate.
    #[inline]
    fn four_stages(
        &self,
        point: &Point,
        memory: &Memory,
        void_ratio: f64,
        step: Strain,
        reading: Reading,
        bounding: &mut f64,
    ) -> Option<Attempt> {
        // Void ratio is linear in the volumetric strain, whose step is known in advance.
        let void_rate = -(1.0 + void_ratio) * step.volume;
        let mut stage = |at: &Point, share: f64| {
            self.change(at, memory, void_ratio + share * void_rate, step, reading, bounding)
        };
        let k1 = stage(point, 0.0)?;
        let k2 = stage(&point.moved(&k1, 0.5), 0.5)?;
        let k3 = stage(&point.moved(&k2, 0.5), 0.5)?;
        let k4 = stage(&point.moved(&k3, 1.0), 1.0)?;
        let end =
            point.moved(&k1, 1.0 / 6.0).moved(&k2, 1.0 / 3.0).moved(&k3, 1.0 / 3.0).moved(&k4, 1.0 / 6.0);
        (end.p > 0.0).then_some(Attempt { point: end, error: 0.0, loading_index: k4.loading_index })
    }

    /// Iterative drift correction of the reference scheme (Chen and Arduino 2021). The correction follows the plastic
    /// flow of the last stage if that reduces the drift, otherwise the yield normal. Fabric is that of the last commit.
    fn correct_drift(
        &self,
        point: &mut Point,
        committed_fabric: Deviator,
        memory: &Memory,
        (void_ratio, moduli, loading_index): (f64, crate::Moduli, f64),
        bounding: &mut f64,
    ) {
        let tolerance = self.yield_tolerance();
        let mut drift = self.yield_function(point.p, point.s, point.alpha);
        for _ in 0..DRIFT_ITERATIONS {
            if drift.abs() < tolerance || drift < 0.0 {
                return;
            }
            let at = Point { fabric: committed_fabric, ..*point };
            let surfaces = self.surfaces(at.p.max(memory.p_min), void_ratio);
            *bounding = surfaces.bounding;
            let n = direction(at.p, at.s, at.alpha, self.constants.p_atm);
            let n_r = n.contract(at.s) / at.p;
            let flow = self.flow(n, &at, memory, surfaces, moduli.shear, false);
            let plastic_mean = loading_index * moduli.bulk * flow.dilatancy;
            let plastic_deviator = n * (2.0 * moduli.shear * loading_index);
            let hardening = 2.0 / 3.0 * flow.hardening;
            let slope = plastic_deviator.contract(n) - plastic_mean * n_r + at.p * hardening * flow.b_n;
            let lambda = drift / slope;
            let p = at.p - lambda * plastic_mean;
            let s = at.s - plastic_deviator * lambda;
            let alpha = at.alpha + flow.b * (lambda * hardening);
            let corrected = self.yield_function(p, s, alpha);
            if corrected.abs() < drift.abs() {
                (point.p, point.s, point.alpha) = (p, s, alpha);
                point.out_of_plane -= lambda * plastic_mean;
                drift = corrected;
            } else {
                let scale = drift / (1.0 + 0.5 * n_r * n_r);
                point.p += 0.5 * n_r * scale;
                point.s = at.s - n * scale;
                drift = self.yield_function(point.p, point.s, point.alpha);
            }
        }
    }

    /// The point at the pressure floor. The stress ratio keeps its direction and is limited in size; the yield surface
    /// moves with it. The out-of-plane stress equals the mean stress. Fabric and history variables are unchanged.
    fn at_floor(&self, before: &Point, p_min: f64, report: &mut UpdateReport) -> Point {
        report.pressure_floors += 1;
        let floor = FLOOR_FRACTION * p_min;
        let ratio = stress_ratio(before.p, before.s);
        let limit = FLOOR_STRESS_RATIO * self.constants.critical_ratio;
        let (factor, kept) = if ratio > limit { (limit / ratio, limit) } else { (1.0, ratio) };
        let r = before.s * (factor / before.p);
        let alpha =
            if kept > self.constants.m { r * (1.0 - self.constants.m / kept) } else { Deviator::ZERO };
        Point { p: floor, s: r * floor, out_of_plane: floor, alpha, fabric: before.fabric }
    }
}
