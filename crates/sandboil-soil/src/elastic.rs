//! Linear isotropic elasticity in plane strain, with the Jaumann rate of stress.

use crate::{
    Deviator, Integrator, Moduli, SoilError, SoilModel, StrainIncrement, Stress, UpdateReport, bulk_to_shear,
    error::{check, positive},
};

/// Linear isotropic elastic material.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Elastic {
    moduli: Moduli,
}

impl Elastic {
    /// Material with shear modulus `shear` and three-dimensional bulk modulus `bulk`, kPa, both positive.
    pub fn new(shear: f64, bulk: f64) -> Result<Self, SoilError> {
        Ok(Self { moduli: Moduli { bulk: positive("K", bulk)?, shear: positive("G", shear)? } })
    }

    /// Material with shear modulus `shear`, kPa, and Poisson's ratio in (-1, 0.5).
    pub fn from_poisson(shear: f64, nu: f64) -> Result<Self, SoilError> {
        check("nu", nu, "in (-1, 0.5)", nu > -1.0 && nu < 0.5)?;
        Self::new(shear, bulk_to_shear(nu) * shear)
    }

    /// Bulk and shear modulus, kPa.
    pub fn constants(&self) -> Moduli {
        self.moduli
    }

    /// Stress, kPa, after a strain increment: the old stress rotated with the material, plus `C de`.
    ///
    /// The rotation is that of Hughes and Winget (1980), in Cayley form. It is a pure rotation for any spin, so stress
    /// invariants are kept to round-off. For small increments it gives the Jaumann rate.
    #[inline]
    pub fn moved(&self, stress: &Stress, de: &StrainIncrement) -> Stress {
        let Moduli { bulk, shear } = self.moduli;
        let volume = de.xx + de.yy;
        let mean = stress.plane_mean() + self.moduli.mean_stress_stiffness() * volume;
        let strain = Deviator { half_difference: 0.5 * (de.xx - de.yy), xy: 0.5 * de.xy };
        // Clockwise rotation of the material by `spin` gives the same components as counter-clockwise rotation of
        // the axes by `spin`.
        let deviator = stress.plane_deviator().in_axes_turned(cayley(de.spin)) + strain * (2.0 * shear);
        Stress::of_plane(mean, deviator, stress.zz + (bulk - 2.0 / 3.0 * shear) * volume)
    }
}

impl SoilModel for Elastic {
    type State = Stress;

    fn initialise(&self, stress: Stress, _void_ratio: Option<f64>) -> Result<Stress, SoilError> {
        stress.finite("initial stress")
    }

    fn update(
        &self,
        state: &mut Stress,
        de: &StrainIncrement,
        _integrator: &Integrator,
    ) -> Result<UpdateReport, SoilError> {
        de.bounded()?;
        *state = self.moved(state, de).finite("stress")?;
        Ok(UpdateReport::default())
    }

    fn stress(&self, state: &Stress) -> Stress {
        *state
    }

    fn moduli(&self, _state: &Stress) -> Moduli {
        self.moduli
    }

    fn static_shear_modulus(&self) -> f64 {
        self.moduli.shear
    }
}

/// Cosine and sine of twice the angle `2 atan(spin/2)`; this angle equals `spin` to second order.
#[inline]
fn cayley(spin: f64) -> (f64, f64) {
    let scale = 1.0 / (1.0 + 0.25 * spin * spin);
    let cos = scale * (1.0 - 0.25 * spin * spin);
    let sin = scale * spin;
    (cos * cos - sin * sin, 2.0 * sin * cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rock() -> Elastic {
        Elastic::new(1.0e5, 3.0e5).unwrap()
    }

    #[test]
    fn one_dimensional_compression_has_the_stiffness_k_plus_four_thirds_g() {
        let stress =
            rock().moved(&Stress::default(), &StrainIncrement { yy: -1e-4, ..StrainIncrement::default() });
        assert!((stress.yy + (3.0e5 + 4.0 / 3.0 * 1.0e5) * 1e-4).abs() < 1e-9);
        assert!((stress.xx + (3.0e5 - 2.0 / 3.0 * 1.0e5) * 1e-4).abs() < 1e-9);
        assert!((stress.zz - stress.xx).abs() < 1e-12);
    }

    #[test]
    fn poisson_ratio_gives_the_earth_pressure_coefficient() {
        let soil = Elastic::from_poisson(5.0e4, 1.0 / 3.0).unwrap();
        let stress =
            soil.moved(&Stress::default(), &StrainIncrement { yy: -1e-4, ..StrainIncrement::default() });
        assert!((stress.xx / stress.yy - 0.5).abs() < 1e-12);
    }

    #[test]
    fn shear_strain_is_engineering() {
        let stress =
            rock().moved(&Stress::default(), &StrainIncrement { xy: 1e-4, ..StrainIncrement::default() });
        assert!((stress.xy - 10.0).abs() < 1e-9);
    }

    #[test]
    fn a_quarter_turn_in_small_steps_exchanges_the_axes() {
        let start = Stress { xx: -50.0, yy: -100.0, xy: 7.0, zz: -50.0 };
        let steps = 1000;
        let spin = std::f64::consts::FRAC_PI_2 / f64::from(steps);
        let mut stress = start;
        for _ in 0..steps {
            stress = rock().moved(&stress, &StrainIncrement { spin, ..StrainIncrement::default() });
        }
        assert!((stress.xx - start.yy).abs() < 1e-3 && (stress.yy - start.xx).abs() < 1e-3);
        assert!((stress.xy + start.xy).abs() < 1e-3);
    }

    #[test]
    fn spin_follows_the_jaumann_rate() {
        let start = Stress { xx: -50.0, yy: -100.0, xy: 7.0, zz: -50.0 };
        let w = 1e-6;
        let turned = rock().moved(&start, &StrainIncrement { spin: w, ..StrainIncrement::default() });
        assert!((turned.xx - start.xx - 2.0 * w * start.xy).abs() < 1e-9);
        assert!((turned.yy - start.yy + 2.0 * w * start.xy).abs() < 1e-9);
        assert!((turned.xy - start.xy - w * (start.yy - start.xx)).abs() < 1e-9);
    }

    #[test]
    fn impossible_constants_are_refused() {
        assert!(Elastic::new(0.0, 1.0).is_err());
        assert!(Elastic::new(1.0, f64::NAN).is_err());
        assert!(Elastic::from_poisson(1.0, 0.5).is_err());
        assert!(Elastic::from_poisson(1.0, f64::NAN).is_err());
    }
}
