//! One increment under mixed control: each component has either its strain or its stress prescribed.

use super::Specimen;
use crate::{Moduli, SoilError, StrainIncrement, Stress};
use nalgebra::{Matrix3, Vector3};

/// Largest number of quasi-Newton corrections. Three unknowns need about a dozen where the soil yields.
const CORRECTIONS: usize = 60;
/// Allowed difference from a prescribed stress, relative to the larger of the stress and [`LEAST_STRESS`].
const STRESS_TOLERANCE: f64 = 1e-7;
/// Stress below which the tolerance is absolute, kPa.
const LEAST_STRESS: f64 = 1.0;
/// Largest strain change of one correction, relative to the elastic strain of the increment: larger than plastic
/// strains before failure, and small enough that a secant extrapolated across a reversal does not diverge.
const TRUST: f64 = 1e3;

/// Which components of `(xx, yy, xy)` have their stress prescribed, and the prescribed values, kPa, tension positive.
#[derive(Debug, Clone, Copy)]
pub(super) struct Prescribed {
    pub by_stress: [bool; 3],
    pub stress: [f64; 3],
}

/// Estimate of the soil's compliance, 1/kPa, kept from one increment to the next.
#[derive(Debug, Clone, Copy)]
pub(super) struct Compliance(Matrix3<f64>);

/// Reason of a failed increment; the specimen is unchanged.
pub(super) enum Failure {
    /// The prescribed stress was not met.
    NotMet,
    /// The model refused a trial.
    Refused(SoilError),
}

/// Components `(xx, yy, xy)`, kPa.
pub(super) fn components(stress: &Stress) -> [f64; 3] {
    [stress.xx, stress.yy, stress.xy]
}

impl Compliance {
    /// Elastic compliance of the components under stress control, with the strain of the others fixed.
    pub(super) fn elastic(moduli: Moduli, by_stress: [bool; 3]) -> Self {
        let Moduli { bulk, shear } = moduli;
        let (direct, cross) = (bulk + 4.0 / 3.0 * shear, bulk - 2.0 / 3.0 * shear);
        let mut stiffness = Matrix3::new(direct, cross, 0.0, cross, direct, 0.0, 0.0, 0.0, shear);
        // A component under strain control has no equation: its row and column are the identity.
        for k in 0..3 {
            if !by_stress[k] {
                stiffness.row_mut(k).fill(0.0);
                stiffness.column_mut(k).fill(0.0);
                stiffness[(k, k)] = 1.0;
            }
        }
        let inverse = stiffness.try_inverse().unwrap_or_else(Matrix3::zeros);
        Self(inverse)
    }
}

impl Specimen {
    /// Difference from the prescribed stress, kPa, and its largest component in units of the tolerance.
    fn misfit(&self, prescribed: &Prescribed) -> (Vector3<f64>, f64) {
        let stress = components(&self.point.stress());
        let scale = stress.iter().fold(LEAST_STRESS, |scale, s| scale.max(s.abs()));
        let mut residual = Vector3::zeros();
        for k in 0..3 {
            if prescribed.by_stress[k] {
                residual[k] = stress[k] - prescribed.stress[k];
            }
        }
        (residual, residual.amax() / (STRESS_TOLERANCE * scale))
    }

    /// Restores the marked state and applies a strain increment to it.
    fn trial(&mut self, strain: Vector3<f64>) -> Result<(), SoilError> {
        self.point.back();
        let de = StrainIncrement { xx: strain.x, yy: strain.y, xy: strain.z, spin: 0.0 };
        let report = self.point.update(&de, &self.integrator)?;
        self.report.merge(&report);
        Ok(())
    }

    /// Makes one increment and returns its strain. `strain` holds the prescribed components and a first estimate of
    /// the others. On failure the specimen is unchanged.
    pub(super) fn increment(
        &mut self,
        strain: [f64; 3],
        prescribed: &Prescribed,
        compliance: &mut Compliance,
    ) -> Result<[f64; 3], Failure> {
        self.point.mark();
        let outcome = self.corrected(Vector3::from(strain), prescribed, compliance);
        match outcome {
            Ok(made) => {
                for (total, part) in self.strain.iter_mut().zip(made.iter()) {
                    *total += part;
                }
                Ok(made.into())
            }
            Err(failure) => {
                self.point.back();
                Err(failure)
            }
        }
    }

    /// Broyden's method (1965) on the components under stress control.
    fn corrected(
        &mut self,
        mut strain: Vector3<f64>,
        prescribed: &Prescribed,
        compliance: &mut Compliance,
    ) -> Result<Vector3<f64>, Failure> {
        self.trial(strain).map_err(Failure::Refused)?;
        if !prescribed.by_stress.contains(&true) {
            return Ok(strain);
        }
        let reach = TRUST * strain.amax().max((compliance.0 * self.misfit(prescribed).0).amax());
        let (mut residual, mut size) = self.misfit(prescribed);
        for _ in 0..CORRECTIONS {
            if size <= 1.0 {
                return Ok(strain);
            }
            let inverse = &mut compliance.0;
            let mut step = -(*inverse * residual);
            if !(step.amax() <= reach) {
                step *= reach / step.amax();
            }
            if !(step.amax() > 0.0) {
                break;
            }
            strain += step;
            self.trial(strain).map_err(Failure::Refused)?;
            let (next, next_size) = self.misfit(prescribed);
            let change = next - residual;
            let expected = *inverse * change;
            let slope = step.dot(&expected);
            if slope.abs() > f64::EPSILON * step.norm_squared() {
                let row = step.transpose() * *inverse;
                *inverse += (step - expected) * row / slope;
            }
            (residual, size) = (next, next_size);
        }
        if size <= 1.0 { Ok(strain) } else { Err(Failure::NotMet) }
    }
}
