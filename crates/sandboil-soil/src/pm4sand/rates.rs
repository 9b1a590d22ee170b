//! The rate equations: loading index and the change of stress, back-stress ratio and fabric (manual, section 3.6).

use super::{PM4Sand, State, state::Strain, surfaces::elastic_increment};
use crate::{Deviator, Moduli};
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// `C_Kp`: loss of plastic modulus with fabric.
const C_KP: f64 = 2.0;
/// Stress, relative to atmospheric pressure, below which the loading direction is not defined.
const NO_DIRECTION: f64 = 1e-12;

/// The integrated quantities, compression positive, in the material frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    /// In-plane mean effective stress, kPa.
    pub p: f64,
    /// In-plane deviator, kPa.
    pub s: Deviator,
    /// Out-of-plane effective stress, kPa.
    pub out_of_plane: f64,
    /// Back-stress ratio.
    pub alpha: Deviator,
    /// Fabric-dilatancy tensor z.
    pub fabric: Deviator,
}

impl Point {
    pub fn of(state: &State) -> Self {
        Self {
            p: state.mean,
            s: state.deviator,
            out_of_plane: state.out_of_plane,
            alpha: state.alpha,
            fabric: state.fabric,
        }
    }

    pub fn store(&self, state: &mut State) {
        state.mean = self.p;
        state.deviator = self.s;
        state.out_of_plane = self.out_of_plane;
        state.alpha = self.alpha;
        state.fabric = self.fabric;
    }

    /// `self + factor * change`.
    #[inline]
    pub fn moved(&self, change: &Change, factor: f64) -> Self {
        Self {
            p: self.p + factor * change.p,
            s: self.s + change.s * factor,
            out_of_plane: self.out_of_plane + factor * change.out_of_plane,
            alpha: self.alpha + change.alpha * factor,
            fabric: self.fabric + change.fabric * factor,
        }
    }

    /// Norm `|sigma|` of the in-plane stress, kPa.
    #[inline]
    pub fn stress_norm(&self) -> f64 {
        stress_norm(self.p, self.s)
    }
}

/// Norm of an in-plane stress with mean `p` and deviator `s`.
#[inline]
pub(super) fn stress_norm(p: f64, s: Deviator) -> f64 {
    (2.0 * p * p + s.contract(s)).sqrt()
}

/// Change of a [`Point`] over a strain increment, and its loading index.
#[derive(Debug, Clone, Copy)]
pub(super) struct Change {
    pub p: f64,
    pub s: Deviator,
    pub out_of_plane: f64,
    pub alpha: Deviator,
    pub fabric: Deviator,
    pub loading_index: f64,
}

impl Change {
    /// Elastic change: stress only.
    #[inline]
    pub fn elastic(moduli: Moduli, strain: Strain) -> Self {
        let (p, s) = elastic_increment(moduli, strain);
        Self {
            p,
            s,
            out_of_plane: (moduli.bulk - 2.0 / 3.0 * moduli.shear) * strain.volume,
            alpha: Deviator::ZERO,
            fabric: Deviator::ZERO,
            loading_index: 0.0,
        }
    }
}

/// History variables in the rate equations; constant between two commits.
#[derive(Debug, Clone, Copy)]
pub(super) struct Memory {
    pub alpha_in: Deviator,
    pub alpha_in_previous: Deviator,
    pub alpha_in_true: Deviator,
    pub fabric_in: Deviator,
    pub cumulative: f64,
    pub peak: f64,
    pub limit: f64,
    pub p_zp: f64,
    pub p_min: f64,
    pub ado: f64,
    /// `C_zpk1`: large while the cumulative fabric is still close to the peak fabric.
    pub c_zpk1: f64,
    /// `C_Kp (z_peak/z_max) sqrt(1 - C_zpk2)`.
    pub fabric_softening: f64,
    /// `C_dz` of the contraction rate.
    pub c_dz: f64,
    /// Fabric growth per loading index.
    pub growth: f64,
    /// Fabric (and post-shaking) factor of the elastic moduli.
    pub stiffness: f64,
}

impl Memory {
    pub fn of(material: &PM4Sand, state: &State) -> Self {
        let (limit, peak, cumulative) = (state.fabric_limit, state.fabric_peak, state.fabric_cumulative);
        let c_zpk1 = peak / (cumulative + limit / 5.0);
        let c_zpk2 = (peak / (cumulative + limit / 100.0)).min(1.0 - 1e-10);
        let c_rot2 = 1.0 - c_zpk2;
        let c_dz = ((1.0 - c_rot2 * SQRT_2 * peak / limit) * limit / (limit + c_rot2 * cumulative))
            .max(1.0 / (1.0 + 0.5 * limit));
        Self {
            alpha_in: state.alpha_in.deviator(),
            alpha_in_previous: state.alpha_in_previous.deviator(),
            alpha_in_true: state.alpha_in_true,
            fabric_in: state.fabric_in,
            cumulative,
            peak,
            limit,
            p_zp: state.p_zp,
            p_min: state.p_min,
            ado: state.dilatancy_scale,
            c_zpk1,
            fabric_softening: C_KP * (peak / limit) * (1.0 - c_zpk2).sqrt(),
            c_dz,
            growth: material.constants.cz / (1.0 + (0.5 * cumulative / limit - 1.0).max(0.0)),
            stiffness: material.fabric_stiffness(cumulative / limit) * material.sedimentation_factor(state),
        }
    }
}

/// Variant of the published model that is evaluated.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reading {
    /// Constant moduli for the whole part; `None`: each stage uses the moduli at its stress.
    pub held_moduli: Option<Moduli>,
    /// `K_p = 0` and `h = 0` outside the bounding surface, both in contraction and in dilation.
    pub clamp: bool,
}

/// Loading direction `n` at a stress: the normal to the yield surface (manual, section 3.3).
#[inline]
pub(super) fn direction(p: f64, s: Deviator, alpha: Deviator, p_atm: f64) -> Deviator {
    let outward = s - alpha * p;
    let size = outward.norm();
    if p.abs() < NO_DIRECTION * p_atm {
        Deviator { half_difference: 0.0, xy: FRAC_1_SQRT_2 }
    } else if size < NO_DIRECTION * p_atm {
        outward
    } else {
        outward * (1.0 / size)
    }
}

impl PM4Sand {
    /// Change of a point over a strain increment (manual, section 3.6). `None` where the equations have no solution:
    /// the mean stress, or the denominator of the loading index, is not positive.
    /// `bounding` is set to the bounding ratio of this evaluation.
    #[inline]
    pub(super) fn change(
        &self,
        at: &Point,
        memory: &Memory,
        void_ratio: f64,
        strain: Strain,
        reading: Reading,
        bounding: &mut f64,
    ) -> Option<Change> {
        if !(at.p > 0.0) {
            return None;
        }
        let p = at.p.max(memory.p_min);
        let surfaces = self.surfaces(p, void_ratio);
        *bounding = surfaces.bounding;
        let moduli = match reading.held_moduli {
            Some(held) => held,
            None => self.elastic_moduli(at.p, at.s, memory.p_min, surfaces.bounding, memory.stiffness),
        };
        let n = direction(at.p, at.s, at.alpha, self.constants.p_atm);
        let n_r = n.contract(at.s) / at.p;
        let volume_stiffness =
            if self.options.consistent_loading_index { moduli.mean_stress_stiffness() } else { moduli.bulk };
        let two_g = 2.0 * moduli.shear;
        let mut change = Change::elastic(moduli, strain);
        let numerator = two_g * n.contract(strain.deviator) - n_r * volume_stiffness * strain.volume;
        if numerator <= 0.0 {
            return Some(change);
        }
        let flow = self.flow(n, at, memory, surfaces, moduli.shear, reading.clamp);
        let denominator = flow.plastic_modulus + two_g - moduli.bulk * flow.dilatancy * n_r;
        if !(denominator > 0.0) {
            return None;
        }
        let index = numerator / denominator;
        let plastic_mean = index * moduli.bulk * flow.dilatancy;
        change.p -= plastic_mean;
        change.s = change.s - n * (index * two_g);
        change.out_of_plane -= plastic_mean;
        change.alpha = flow.b * (2.0 / 3.0 * index * flow.hardening);
        if flow.dilatancy_distance < 0.0 && flow.dilatancy < 0.0 {
            change.fabric = (n * memory.limit + at.fabric) * (-memory.growth * index);
        }
        change.loading_index = index;
        Some(change)
    }
}
