//! Constitutive models as pure functions: (parameters, state, strain increment, rotation) -> (state, report).
//!
//! This crate contains no particles, no time and no files. Stress is effective, in kPa; strain is a plain number.
//! Stress and strain are tension positive in every public function, except where noted.

pub mod drucker_prager;
pub mod elastic;
mod error;
mod integrator;
pub mod laboratory;
mod model;
pub mod mohr_coulomb;
pub mod pm4sand;
pub mod pressure_elastic;
mod report;
pub mod retention;
mod strength;
mod tensor;
pub mod total_stress;

pub use error::SoilError;
pub use integrator::Integrator;
pub use model::{Soil, SoilModel};
pub use report::UpdateReport;
pub use retention::{Moisture, VanGenuchten};
pub use strength::Strength;
pub use tensor::{Deviator, StrainIncrement, Stress};

/// Current elastic moduli of a material, kPa.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Moduli {
    /// Bulk modulus K (three-dimensional), kPa.
    pub bulk: f64,
    /// Shear modulus G, kPa.
    pub shear: f64,
}

impl Moduli {
    /// Change of the in-plane mean stress `(xx + yy)/2` per volumetric strain in plane strain, `K + G/3`, kPa.
    #[inline]
    pub fn mean_stress_stiffness(&self) -> f64 {
        self.bulk + self.shear / 3.0
    }

    /// Both moduli from the shear modulus and the ratio K/G.
    #[inline]
    pub fn from_shear(shear: f64, bulk_to_shear: f64) -> Self {
        Self { bulk: bulk_to_shear * shear, shear }
    }
}

/// K/G of an isotropic material with Poisson's ratio `nu`.
pub(crate) fn bulk_to_shear(nu: f64) -> f64 {
    2.0 / 3.0 * (1.0 + nu) / (1.0 - 2.0 * nu)
}
