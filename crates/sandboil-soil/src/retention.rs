//! Water retention and relative conductivity of partly saturated soil: van Genuchten (1980), Soil Sci. Soc. Am. J. 44,
//! with the conductivity of Mualem (1976), Water Resour. Res. 12.

use crate::error::{SoilError, check, positive};

/// Exponent `l` of the effective saturation in Mualem's conductivity.
const TORTUOSITY: f64 = 0.5;
/// Lower limit of the relative conductivity. Mualem's capillary model neglects water films and vapour, through which
/// dry soil still conducts some water.
const LEAST_RELATIVE_CONDUCTIVITY: f64 = 1e-6;

/// Water retention curve of a soil.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct VanGenuchten {
    /// `alpha`, 1/m: about the inverse of the capillary rise.
    alpha: f64,
    /// `n`: steepness of the curve.
    n: f64,
    /// Degree of saturation at great suction.
    residual: f64,
    /// Degree of saturation without suction.
    saturated: f64,
}

/// Saturation and conductivity of a soil at a pressure head.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Moisture {
    /// Degree of saturation `S_r`.
    pub saturation: f64,
    /// Specific capacity `dS_r/dh_p`, 1/m.
    pub capacity: f64,
    /// Conductivity relative to that of the saturated soil.
    pub relative_conductivity: f64,
}

impl Moisture {
    /// Soil with all pores full of water.
    pub const SATURATED: Self = Self { saturation: 1.0, capacity: 0.0, relative_conductivity: 1.0 };
}

impl VanGenuchten {
    /// A curve with `alpha` (1/m), `n`, and the degrees of saturation at great suction (`residual`) and without
    /// suction (`saturated`).
    ///
    /// # Errors
    /// [`SoilError::InvalidParameter`] unless `alpha > 0`, `n > 1` and `0 <= residual < saturated <= 1`.
    pub fn new(alpha: f64, n: f64, residual: f64, saturated: f64) -> Result<Self, SoilError> {
        positive("alpha", alpha)?;
        check("n", n, "above 1", n > 1.0)?;
        check("residual_saturation", residual, "in [0, 1)", (0.0..1.0).contains(&residual))?;
        let rises = saturated > residual && saturated <= 1.0;
        check("saturated_saturation", saturated, "above residual_saturation and at most 1", rises)?;
        Ok(Self { alpha, n, residual, saturated })
    }

    /// Pressure head at which the capacity is largest, m.
    pub fn steepest(&self) -> f64 {
        let m = 1.0 - 1.0 / self.n;
        -m.powf(1.0 / self.n) / self.alpha
    }

    /// Saturation and conductivity at a pressure head `h_p`, m: positive below the water table, negative (suction)
    /// above it.
    pub fn at(&self, pressure_head: f64) -> Moisture {
        if pressure_head >= 0.0 {
            return Moisture { saturation: self.saturated, ..Moisture::SATURATED };
        }
        let m = 1.0 - 1.0 / self.n;
        let suction = -pressure_head;
        let x = (self.alpha * suction).powf(self.n);
        let effective = (1.0 + x).powf(-m);
        let span = self.saturated - self.residual;
        // `1 - (1 - S_e^(1/m))^m` with `S_e^(1/m) = 1/(1 + x)`, in a form without cancellation at great suction.
        let open = -(m * (-1.0 / (1.0 + x)).ln_1p()).exp_m1();
        let relative = effective.powf(TORTUOSITY) * open * open;
        Moisture {
            saturation: self.residual + span * effective,
            capacity: span * m * self.n * x / suction * effective / (1.0 + x),
            relative_conductivity: relative.max(LEAST_RELATIVE_CONDUCTIVITY),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn agrees_with_values_computed_by_hand() {
        let state = VanGenuchten::new(2.0, 2.0, 0.0, 1.0).unwrap().at(-0.5);
        // x = 1: S_e = 1/sqrt(2), dS_e/dh = a m n (a y)^(n-1) (1 + x)^(-m-1), with a = alpha and suction y.
        assert!((state.saturation - 0.5_f64.sqrt()).abs() < 1e-15);
        assert!((state.capacity - 2.0 * 2.0_f64.powf(-1.5)).abs() < 1e-15);
        assert!((state.relative_conductivity - 0.072_138).abs() < 1e-6);
    }

    #[test]
    fn parameters_outside_their_range_are_refused() {
        for (alpha, n, residual, saturated) in [
            (0.0, 2.0, 0.1, 1.0),
            (-1.0, 2.0, 0.1, 1.0),
            (f64::NAN, 2.0, 0.1, 1.0),
            (1.0, 1.0, 0.1, 1.0),
            (1.0, f64::INFINITY, 0.1, 1.0),
            (1.0, 2.0, -0.1, 1.0),
            (1.0, 2.0, 0.5, 0.5),
            (1.0, 2.0, 0.5, 1.1),
        ] {
            assert!(VanGenuchten::new(alpha, n, residual, saturated).is_err(), "{alpha} {n} {residual}");
        }
    }

    proptest! {
        #[test]
        fn saturation_falls_with_suction_and_capacity_is_its_slope(
            alpha in 0.01..30.0_f64,
            n in 1.05..8.0_f64,
            residual in 0.0..0.5_f64,
            suction in 1e-3..1e3_f64,
        ) {
            let curve = VanGenuchten::new(alpha, n, residual, 1.0).unwrap();
            let step = 1e-4 * suction;
            let (wetter, here, drier) = (curve.at(step - suction), curve.at(-suction), curve.at(-suction - step));
            prop_assert!(wetter.saturation >= here.saturation && here.saturation >= drier.saturation);
            prop_assert!(wetter.relative_conductivity >= here.relative_conductivity);
            prop_assert!(here.saturation >= residual && here.saturation <= 1.0);
            prop_assert!(here.relative_conductivity > 0.0 && here.relative_conductivity <= 1.0);
            let peak = curve.at(curve.steepest()).capacity;
            prop_assert!(here.capacity <= peak * (1.0 + 1e-12));
            let slope = (wetter.saturation - drier.saturation) / (2.0 * step);
            prop_assert!((slope - here.capacity).abs() <= 1e-5 * here.capacity + 1e-11 / suction, "{slope} {here:?}");
        }
    }
}
