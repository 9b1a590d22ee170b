//! Mohr-Coulomb strength parameters, shared by several models.

use crate::{SoilError, error::check};

/// Cohesion, friction angle and dilation angle.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Strength {
    /// Cohesion c, kPa.
    pub c: f64,
    /// Friction angle phi, degrees.
    pub phi: f64,
    /// Dilation angle psi, degrees: `psi = phi` is associated flow, `psi = 0` is flow at constant volume.
    pub psi: f64,
}

impl Strength {
    /// Returns the strength, or an error unless `c >= 0`, `0 <= psi <= phi < 90` and one of `c` and `phi` is positive.
    ///
    /// Contraction (`psi < 0`) is refused because a perfectly plastic soil would contract without limit. The argument
    /// holds the parameter names for the error.
    pub(crate) fn checked(self, [c, phi, psi]: [&'static str; 3]) -> Result<Self, SoilError> {
        check(phi, self.phi, "in [0, 90) degrees", (0.0..90.0).contains(&self.phi))?;
        check(psi, self.psi, "in [0, phi] degrees", (0.0..=self.phi).contains(&self.psi))?;
        check(c, self.c, "zero or positive, kPa", self.c >= 0.0)?;
        check(
            c,
            self.c,
            "positive if phi is 0, because the soil would have no strength",
            self.c + self.phi > 0.0,
        )?;
        Ok(self)
    }

    /// Returns the given tension cut-off, kPa, or infinity for `None`. A cut-off that is negative or above the apex
    /// `c cot(phi)` is an error.
    pub(crate) fn tension_cutoff(&self, given: Option<f64>) -> Result<f64, SoilError> {
        let Some(tension) = given else { return Ok(f64::INFINITY) };
        let (sin, cos) = self.phi.to_radians().sin_cos();
        let below_apex = tension * sin <= self.c * cos;
        check("tension_cutoff", tension, "in [0, c/tan(phi)] kPa", tension >= 0.0 && below_apex)
    }
}
