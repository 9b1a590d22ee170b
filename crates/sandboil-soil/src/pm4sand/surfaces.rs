//! Critical state, bounding and dilatancy surfaces, elastic moduli (manual, sections 3.2 to 3.4 and 3.7).

use super::{PM4Sand, State, state::Strain};
use crate::{Deviator, Moduli};
use std::f64::consts::SQRT_2;

/// `C_SR,o`: largest loss of elastic stiffness with stress ratio.
const STRESS_RATIO_DEGRADATION: f64 = 0.5;
/// Limit of the absolute state index in the exponentials, so that every result is finite.
const STATE_INDEX_LIMIT: f64 = 3.0;
/// Smallest `Q - ln(100 p/p_A)`; reached at 220 atmospheres, far above the range of the model.
const CRUSHING_MARGIN: f64 = 1e-3;
/// Smallest post-shaking pressure in a division, relative to atmospheric pressure.
const TINY: f64 = 1e-10;

/// Stress ratios `q/p` on the bounding and the dilatancy surface, and the state index that they depend on.
#[derive(Debug, Clone, Copy)]
pub struct Surfaces {
    /// Relative state parameter index, negative when dense of critical.
    pub state_index: f64,
    /// Bounding ratio `M^b`.
    pub bounding: f64,
    /// Dilatancy ratio `M^d`.
    pub dilatancy: f64,
}

/// Fourth power.
#[inline]
fn fourth(x: f64) -> f64 {
    (x * x) * (x * x)
}

impl PM4Sand {
    /// The surfaces at a state's pressure and void ratio.
    pub fn surfaces_of(&self, state: &State) -> Surfaces {
        self.surfaces(state.mean.max(state.p_min), state.void_ratio_at(state.volumetric_strain))
    }

    /// Bounding and dilatancy stress ratios for the relative state parameter index, negative when dense of
    /// critical (Bolton 1986; manual, sections 3.2 and 3.3). `p` must be at least `p_min`.
    #[inline]
    pub(super) fn surfaces(&self, p: f64, void_ratio: f64) -> Surfaces {
        let c = &self.constants;
        let relative_density = (c.e_max - void_ratio) / (c.e_max - c.e_min);
        let critical = c.r / (c.q - (100.0 * p / c.p_atm).ln()).max(CRUSHING_MARGIN);
        let state_index = (critical - relative_density).clamp(-STATE_INDEX_LIMIT, STATE_INDEX_LIMIT);
        // Loose of critical, the exponent of the bounding surface is a quarter and that of the dilatancy surface four
        // times the value dense of critical.
        let (nb, nd) = if state_index > 0.0 { (0.25 * c.nb, 4.0 * c.nd) } else { (c.nb, c.nd) };
        Surfaces {
            state_index,
            bounding: c.critical_ratio * (-nb * state_index).exp(),
            dilatancy: c.critical_ratio * (nd * state_index).exp(),
        }
    }

    /// Elastic moduli, kPa (manual, section 3.4), with the loss of stiffness by stress ratio and by fabric.
    /// `p` is the mean stress before its limit `p_min`; `fabric_factor` is from [`PM4Sand::fabric_stiffness`].
    #[inline]
    pub(super) fn elastic_moduli(
        &self,
        p: f64,
        s: Deviator,
        p_min: f64,
        bounding: f64,
        fabric_factor: f64,
    ) -> Moduli {
        let c = &self.constants;
        let p = p.max(p_min);
        let ratio = stress_ratio(p, s) / bounding;
        let stress_factor = 1.0 - STRESS_RATIO_DEGRADATION * fourth(ratio).min(1.0);
        Moduli::from_shear(c.g0 * (c.p_atm * p).sqrt() * stress_factor * fabric_factor, c.bulk_to_shear)
    }

    /// Factor on the elastic moduli for a cumulative fabric, given relative to the fabric limit.
    #[inline]
    pub(super) fn fabric_stiffness(&self, cumulative_over_limit: f64) -> f64 {
        (1.0 + cumulative_over_limit) / (1.0 + self.constants.c_gd * cumulative_over_limit)
    }

    /// Moduli of a state, including the post-shaking reduction.
    #[inline]
    pub(super) fn committed_moduli(&self, state: &State) -> Moduli {
        let fabric = self.fabric_stiffness(state.fabric_cumulative / state.fabric_limit);
        let factor = fabric * self.sedimentation_factor(state);
        self.elastic_moduli(state.mean, state.deviator, state.p_min, state.bounding_ratio, factor)
    }

    /// Post-shaking stiffness factor `F_sed` (manual, section 3.8); one during shaking. `p/(20 p_sed)` has the
    /// exponent one, as implemented by Chen and Arduino (2021).
    pub(super) fn sedimentation_factor(&self, state: &State) -> f64 {
        if !self.options.post_shaking {
            return 1.0;
        }
        let c = &self.constants;
        let p = state.mean.max(state.p_min);
        let void_ratio = state.void_ratio_at(state.volumetric_strain);
        let dilatancy = self.surfaces(p, void_ratio).dilatancy;
        let ratio = stress_ratio(p, state.deviator);
        let p_sed = c.p_sed_o * state.fabric_cumulative / (state.fabric_cumulative + state.fabric_limit)
            * (1.0 - ratio / dilatancy).max(0.0).sqrt().sqrt();
        let recovery = p / (20.0 * p_sed.max(TINY * c.p_atm));
        (c.f_sed_min + (1.0 - c.f_sed_min) * recovery).min(1.0)
    }

    /// Recomputes the moduli of a state; needed only after a change of options.
    pub fn refresh_moduli(&self, state: &mut State) {
        state.moduli = self.committed_moduli(state);
    }

    /// Yield function `|s - p alpha| - m p/sqrt(2)`, kPa (manual, section 3.3).
    #[inline]
    pub(super) fn yield_function(&self, p: f64, s: Deviator, alpha: Deviator) -> f64 {
        (s - alpha * p).norm() - self.constants.m / SQRT_2 * p
    }

    /// Stress tolerance of the yield function, kPa.
    #[inline]
    pub(super) fn yield_tolerance(&self) -> f64 {
        1e-8 * self.constants.p_atm
    }
}

/// Stress ratio `M_cur = q/p` with `q = sqrt(2) |s|`.
#[inline]
pub(super) fn stress_ratio(p: f64, s: Deviator) -> f64 {
    SQRT_2 * s.norm() / p
}

/// Elastic stress increment (mean, deviator) in plane strain.
#[inline]
pub(super) fn elastic_increment(moduli: Moduli, strain: Strain) -> (f64, Deviator) {
    (moduli.mean_stress_stiffness() * strain.volume, strain.deviator * (2.0 * moduli.shear))
}
