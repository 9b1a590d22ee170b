//! Fields of a stress node besides the state of its soil model.

use crate::skeleton::deformation::Deformation;
use sandboil_soil::Stress;

/// Fields of a stress node besides the state of its soil model.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct StressPoint {
    /// Effective stress, kPa, tension positive.
    pub stress: Stress,
    /// What the forces take beside the effective stress, kPa, compression positive: the excess pore pressure of stress
    /// points on the dual lattice, and what the point's group carries of its mean stress.
    pub neutral: f64,
    /// Total strain `(xx, yy, engineering xy)` since the stage began, tension positive.
    pub strain: [f64; 3],
    /// Current elastic shear modulus, kPa.
    pub shear_modulus: f64,
    /// Current skeleton stiffness `K + 4G/3`, kPa.
    pub stiffness: f64,
    /// Mixture density, Mg/m3.
    pub density: f64,
    /// Volume per unit thickness when the geometry was built: an equal share of its velocity node's, m2.
    pub volume: f64,
    /// Deformation since then.
    pub deformation: Deformation,
}

impl StressPoint {
    /// Stress from which the forces follow, kPa, tension positive.
    #[inline]
    pub fn total_stress(&self) -> Stress {
        let Stress { xx, yy, .. } = self.stress;
        Stress { xx: xx - self.neutral, yy: yy - self.neutral, ..self.stress }
    }
}

/// Engineering shear strain of the largest in-plane Mohr circle.
pub fn maximum_shear_strain([xx, yy, xy]: [f64; 3]) -> f64 {
    (xx - yy).hypot(xy)
}
