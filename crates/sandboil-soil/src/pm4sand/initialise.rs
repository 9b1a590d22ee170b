//! Initial state for a given effective stress (manual, section 3.9; Chen and Arduino 2021).

use super::{
    PM4Sand, State,
    state::{Components, Offset},
    surfaces::{Surfaces, stress_ratio},
};
use crate::{Deviator, Moduli, SoilError, Stress, error::finite};

/// `p_min`, relative to the larger of initial mean stress and atmospheric pressure.
const P_MIN_FRACTION: f64 = 0.005;
/// Initial peak fabric, relative to the fabric limit.
const PEAK_FABRIC_SEED: f64 = 1e-5;
/// `p_zp` before the first reversal, relative to the initial mean stress.
const P_ZP_SEED: f64 = 0.01;
/// Largest default fabric limit.
const FABRIC_LIMIT_MAX: f64 = 20.0;

impl PM4Sand {
    /// State at a given effective stress (kPa, tension positive, fixed axes) and void ratio, at zero strain.
    ///
    /// A stress below `p_min` or outside the surfaces is replaced by the nearest admissible one. The difference is
    /// stored as a constant offset and added to the stress returned to the caller, which keeps its equilibrium.
    pub(super) fn first_state(&self, stress: Stress, void_ratio: f64) -> Result<State, SoilError> {
        if !(void_ratio > 0.0 && void_ratio.is_finite()) {
            return Err(SoilError::InvalidParameter {
                name: "void_ratio",
                value: void_ratio,
                expected: "positive and finite",
            });
        }
        for component in [stress.xx, stress.yy, stress.xy, stress.zz] {
            finite("initial stress", component)?;
        }
        let c = &self.constants;
        let given_mean = -0.5 * (stress.xx + stress.yy);
        let given_deviator = Deviator { half_difference: -0.5 * (stress.xx - stress.yy), xy: -stress.xy };
        let p_min = P_MIN_FRACTION * given_mean.max(c.p_atm);

        let (p, mut s, out_of_plane) = if given_mean < p_min {
            (p_min, Deviator::ZERO, p_min)
        } else {
            (given_mean, given_deviator, -stress.zz)
        };
        let mut alpha = s * (1.0 / p);
        let surfaces = self.surfaces(p, c.initial_void_ratio());
        let admissible = surfaces.bounding.max(surfaces.dilatancy);
        let ratio = stress_ratio(p, s);
        if ratio > admissible {
            s = s * (admissible / ratio);
            alpha = s * ((admissible - c.m) / (admissible * p));
        }

        let fabric_limit =
            c.z_max.unwrap_or_else(|| (0.70 * (-6.1 * surfaces.state_index).exp()).min(FABRIC_LIMIT_MAX));
        let mut state = State {
            mean: p,
            deviator: s,
            out_of_plane,
            offset: Offset {
                mean: given_mean - p,
                deviator: given_deviator - s,
                out_of_plane: -stress.zz - out_of_plane,
            },
            void_ratio_initial: void_ratio,
            volumetric_strain: 0.0,
            gap: 0.0,
            alpha,
            alpha_in: Components::ZERO,
            alpha_in_previous: Components::ZERO,
            alpha_in_true: alpha,
            alpha_max: Components::of(alpha),
            alpha_min: Components::of(alpha),
            fabric: Deviator::ZERO,
            fabric_in: Deviator::ZERO,
            fabric_cumulative: 0.0,
            fabric_peak: PEAK_FABRIC_SEED * fabric_limit,
            p_zp: P_ZP_SEED * p,
            zp_max: 0.0,
            before_first_reversal: true,
            moduli: Moduli { bulk: 0.0, shear: 0.0 },
            bounding_ratio: surfaces.bounding,
            p_min,
            fabric_limit,
            dilatancy_scale: c.ado.unwrap_or_else(|| self.default_dilatancy_scale(surfaces)),
            rotation: 0.0,
        };
        self.refresh_moduli(&mut state);
        state.finite()
    }

    /// `A_do` of the initial state (manual, section 3.5).
    fn default_dilatancy_scale(&self, surfaces: Surfaces) -> f64 {
        const LOOSE_OF_CRITICAL: f64 = 1.24;
        const VERY_DENSE: f64 = 1.5;
        let Surfaces { state_index, bounding, dilatancy } = surfaces;
        // The ratio below is undefined for equal surfaces (both exponents zero).
        if state_index >= 0.0 || !(bounding > dilatancy) {
            LOOSE_OF_CRITICAL
        } else if bounding > 2.0 {
            VERY_DENSE
        } else {
            2.5 * ((0.5 * bounding).asin() - (0.5 * self.constants.critical_ratio).asin())
                / (bounding - dilatancy)
        }
    }
}
