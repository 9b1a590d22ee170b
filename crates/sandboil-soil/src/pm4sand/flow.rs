//! Plastic modulus and dilatancy (manual, sections 3.4 and 3.5).

use super::{
    PM4Sand,
    rates::{Memory, Point},
    surfaces::{Surfaces, stress_ratio},
};
use crate::Deviator;
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// `C_gamma1` over `h_o`: keeps the plastic modulus finite at a reversal.
const C_GAMMA1_PER_HO: f64 = 1.0 / 200.0;
/// `C_D`: distance from the dilatancy surface within which contraction decreases.
const C_D: f64 = 0.16;
/// Hardening coefficient exactly at the bounding image, where the formula is infinite.
const HARDENING_AT_IMAGE: f64 = 1e10;
/// Distance to the bounding image (a ratio) below which [`HARDENING_AT_IMAGE`] is used.
const IMAGE_DISTANCE: f64 = 1e-10;
/// Largest contraction rate, relative to `A_do`.
const CONTRACTION_CAP: f64 = 1.5;
/// Forced dilation near `p_min`, relative to `A_do` times the distance between the surfaces.
const FORCED_DILATION: f64 = 3.5;
/// Distance in stress ratio from the bounding surface over which unrotated dilatancy replaces the rotated one.
const BOUNDING_BLEND: f64 = 0.01;

/// Hardening and dilatancy at a point, for its loading direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Flow {
    /// Hardening coefficient h of the back-stress ratio.
    pub hardening: f64,
    /// Distance to the bounding image, `b = alpha^b - alpha`.
    pub b: Deviator,
    /// `b:n`.
    pub b_n: f64,
    /// Plastic modulus `K_p`, kPa.
    pub plastic_modulus: f64,
    /// Dilatancy D, positive in contraction.
    pub dilatancy: f64,
    /// `(alpha^d - alpha):n` for the unrotated dilatancy surface.
    pub dilatancy_distance: f64,
}

/// Positive part.
#[inline]
fn positive_part(x: f64) -> f64 {
    x.max(0.0)
}

#[inline]
fn fifth(x: f64) -> f64 {
    let square = x * x;
    square * square * x
}

impl PM4Sand {
    /// Hardening and dilatancy at a point for the loading direction `n`.
    #[inline]
    pub(super) fn flow(
        &self,
        n: Deviator,
        at: &Point,
        memory: &Memory,
        surfaces: Surfaces,
        shear_modulus: f64,
        clamp: bool,
    ) -> Flow {
        let c = &self.constants;
        let p = at.p.max(memory.p_min);
        let image = |ratio: f64| (ratio - c.m) * FRAC_1_SQRT_2;
        let b = n * image(surfaces.bounding) - at.alpha;
        let b_n = b.contract(n);
        // `n:n` is one, except where the direction is not defined.
        let unit = n.contract(n);
        let alpha_n = at.alpha.contract(n);
        let dilatancy_distance = image(surfaces.dilatancy) * unit - alpha_n;

        // Fabric opposite to the loading direction rotates the dilatancy surface inwards.
        let fabric_n = at.fabric.contract(n);
        let opposing = positive_part(-fabric_n);
        let fabric_change = (memory.fabric_in.contract(n) - fabric_n).abs();
        let c_zin1 =
            if fabric_change > 0.0 { 1.0 - (-2.0 * fabric_change / memory.limit).exp() } else { 0.0 };
        let c_rot1 = 1.0 + SQRT_2 * opposing / memory.limit * (1.0 - c_zin1);
        let rotated_distance = image(surfaces.dilatancy / c_rot1) * unit - alpha_n;

        let (mut hardening, mut plastic_modulus) = self.hardening(n, b_n, at, memory, p, shear_modulus);
        let dilates = rotated_distance <= 0.0;
        if clamp && b_n < 0.0 {
            (hardening, plastic_modulus) = (0.0, 0.0);
        } else if !dilates {
            plastic_modulus = positive_part(plastic_modulus);
        }
        let dilatancy = if dilates {
            self.dilation(at, memory, surfaces, p, (dilatancy_distance, rotated_distance), opposing, c_zin1)
        } else {
            self.contraction(n, at, memory, surfaces, p, dilatancy_distance)
        };
        Flow { hardening, b, b_n, plastic_modulus, dilatancy, dilatancy_distance }
    }

    /// Hardening coefficient h and plastic modulus `K_p = (2/3) p h b:n` (manual, section 3.4.3).
    #[inline]
    fn hardening(
        &self,
        n: Deviator,
        b_n: f64,
        at: &Point,
        memory: &Memory,
        p: f64,
        shear_modulus: f64,
    ) -> (f64, f64) {
        let c = &self.constants;
        if b_n.abs() < IMAGE_DISTANCE {
            return (HARDENING_AT_IMAGE, 2.0 / 3.0 * p * HARDENING_AT_IMAGE * b_n);
        }
        let c_gamma1 = C_GAMMA1_PER_HO * c.ho;
        let apparent = positive_part((at.alpha - memory.alpha_in).contract(n));
        let travelled = positive_part((at.alpha - memory.alpha_in_true).contract(n));
        // Effect of sustained static shear; it acts while the pressure is below `p_zp`.
        let unloading = positive_part(memory.p_zp - p);
        let c_ka = 1.0
            + c.c_kaf * (unloading / (unloading + memory.p_min)) * memory.c_zpk1
                / (1.0 + 6.25 * travelled * travelled);
        let c_rev = if (at.alpha - memory.alpha_in_previous).contract(n) <= 0.0 {
            (apparent + c_gamma1) / (travelled + c_gamma1)
        } else {
            1.0
        };
        let c_fabric = 1.0 + memory.fabric_softening * positive_part(b_n);
        let stiffness = shear_modulus * c.ho * c_ka * c_rev / ((apparent.exp() - 1.0 + c_gamma1) * c_fabric);
        let root = b_n.abs().sqrt();
        (1.5 * stiffness / (p * root), stiffness * root.copysign(b_n))
    }

    /// Dilatancy outside the rotated dilatancy surface (manual, section 3.5.2).
    #[inline]
    #[expect(clippy::too_many_arguments, reason = "values that the caller has already computed")]
    fn dilation(
        &self,
        at: &Point,
        memory: &Memory,
        surfaces: Surfaces,
        p: f64,
        (distance, rotated_distance): (f64, f64),
        opposing: f64,
        c_zin1: f64,
    ) -> f64 {
        let c = &self.constants;
        let Memory { limit, cumulative, peak, p_min, ado, .. } = *memory;
        let c_pzp = 1.0 / (1.0 + fifth(2.5 * p / memory.p_zp));
        let p_min_ratio = 10.0 * p_min / p;
        let c_pmin = 1.0 / (1.0 + p_min_ratio * p_min_ratio);
        let w = c_zin1 * (cumulative - peak) / (3.0 * limit);
        let c_zin2 = (1.0 + w) / (1.0 + 3.0 * w);
        // Within a long step, fabric may exceed its peak at the last commit; the cube must not become negative.
        let t = (1.0 - opposing * FRAC_1_SQRT_2 / peak).clamp(0.0, 1.0);
        let damage = cumulative * cumulative / limit * (t * t * t) * c.ce * c.ce * c_pzp * c_pmin * c_zin1;
        let rate = ado * c_zin2 / (damage + 1.0);
        let plain = rate * distance;
        let rotated = rate * opposing * FRAC_1_SQRT_2 / limit * rotated_distance / c.c_dr;
        let mut dilatancy = plain;
        if plain > rotated {
            let margin = positive_part(surfaces.bounding - stress_ratio(p, at.s));
            dilatancy += (rotated - plain) * margin / (margin + BOUNDING_BLEND);
        }
        if p <= 2.0 * p_min {
            let forced = -FORCED_DILATION * ado * positive_part(surfaces.bounding - surfaces.dilatancy);
            dilatancy = dilatancy.min(forced * (2.0 * p_min - p) / p_min);
        }
        dilatancy
    }

    /// Contraction inside the rotated dilatancy surface (manual, section 3.5.1).
    #[inline]
    fn contraction(
        &self,
        n: Deviator,
        at: &Point,
        memory: &Memory,
        surfaces: Surfaces,
        p: f64,
        distance: f64,
    ) -> f64 {
        // Contraction decreases linearly from 18 p_min to zero at 2 p_min.
        let low_pressure = ((p - 2.0 * memory.p_min) / (16.0 * memory.p_min)).min(1.0);
        if low_pressure <= 0.0 {
            return 0.0;
        }
        let aiding = positive_part(at.fabric.contract(n));
        let h_p = self.contraction_resistance(surfaces.state_index);
        let rate = memory.ado * (1.0 + aiding) / (h_p * memory.c_dz);
        let path = (at.alpha - memory.alpha_in).contract(n) + SQRT_2 * aiding / memory.limit;
        (rate * path * path).min(CONTRACTION_CAP * memory.ado) * distance / (distance + C_D) * low_pressure
    }

    /// `h_p`: resistance to contraction at a state index (manual, section 3.5.1).
    #[inline]
    pub(super) fn contraction_resistance(&self, state_index: f64) -> f64 {
        let density = positive_part(0.5 - state_index);
        self.constants.hpo * (-0.7 + 7.0 * density * density).exp()
    }
}
