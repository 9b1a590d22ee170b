//! Strength of soil after Mohr and Coulomb, as several models take it.

use crate::{SoilError, error::check};

/// Cohesion, friction angle and dilation angle.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Strength {
    /// Cohesion c, kPa.
    pub c: f64,
    /// Friction angle phi, degrees.
    pub phi: f64,
    /// Dilation angle psi, degrees; `psi = phi` is associated flow, `psi = 0` keeps volume.
    pub psi: f64,
}

impl Strength {
    /// The strength itself, refused unless `c >= 0`, `0 <= psi <= phi < 90` and something of c and phi is left.
    ///
    /// Contraction (`psi < 0`) is refused because a perfectly plastic soil would contract without end.
    pub(crate) fn checked(self, [c, phi, psi]: [&'static str; 3]) -> Result<Self, SoilError> {
        check(phi, self.phi, "in [0, 90) degrees", (0.0..90.0).contains(&self.phi))?;
        check(psi, self.psi, "in [0, phi] degrees", (0.0..=self.phi).contains(&self.psi))?;
        check(c, self.c, "zero or positive, kPa", self.c >= 0.0)?;
        check(
            c,
            self.c,
            "positive where phi is 0: soil without strength is a fluid",
            self.c + self.phi > 0.0,
        )?;
        Ok(self)
    }

    /// Refuses a mean or principal tension, kPa, that is negative or above the apex `c cot(phi)`; infinity where
    /// none is given.
    pub(crate) fn tension_cutoff(&self, given: Option<f64>) -> Result<f64, SoilError> {
        let Some(tension) = given else { return Ok(f64::INFINITY) };
        let (sin, cos) = self.phi.to_radians().sin_cos();
        let below_apex = tension * sin <= self.c * cos;
        check("tension_cutoff", tension, "in [0, c/tan(phi)] kPa", tension >= 0.0 && below_apex)
    }
}
