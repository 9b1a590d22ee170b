//! Total-stress plasticity in plane strain: an undrained shear strength that does not depend on pressure, with
//! softening to a residual strength.
//!
//! Plastic flow is at constant volume, so the mean stress is elastic and the return to either surface is radial.

use crate::{
    Integrator, Moduli, SoilError, SoilModel, StrainIncrement, Stress, UpdateReport,
    elastic::Elastic,
    error::{check, positive},
};

/// The stress measure that is limited by the strength.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Criterion {
    /// The radius of the in-plane Mohr's circle. The out-of-plane stress stays elastic.
    #[default]
    Tresca,
    /// `sqrt(J2)`. The radius of the in-plane Mohr's circle at failure is smaller than the strength until plastic flow
    /// has brought the out-of-plane stress to the in-plane mean; then the two are equal.
    VonMises,
}

/// Decrease of strength from the peak `S_u` to the residual `S_r` with plastic shear strain `kappa`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Decay {
    /// `S_r + (S_u - S_r) exp(-kappa/kappa_s)`.
    #[default]
    Exponential,
    /// Linear in `kappa`; the residual strength is reached at `kappa_s`.
    Linear,
}

/// Loss of strength with plastic shear strain.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Softening {
    /// Residual strength, kPa.
    pub residual: f64,
    /// Scale `kappa_s` of plastic shear strain (engineering).
    pub strain: f64,
    /// Shape of the decrease.
    pub decay: Decay,
}

/// Total-stress material.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TotalStress {
    elastic: Elastic,
    criterion: Criterion,
    peak: f64,
    softening: Softening,
}

/// State of one point.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct State {
    stress: Stress,
    plastic_shear: f64,
}

impl TotalStress {
    /// Largest number of Newton iterations for the plastic shear strain under exponential softening. Convergence is
    /// quadratic; more than ten iterations occur only where softening is close to its steepest allowed slope.
    const MOST_ITERATIONS: u32 = 60;

    /// Material with elastic constants and the shear strength `peak`, kPa.
    ///
    /// # Errors
    /// [`SoilError::InvalidParameter`] for a parameter outside its range. Softening is also refused where strength
    /// falls faster with plastic shear strain than the shear modulus `G`.
    pub fn new(
        elastic: Elastic,
        criterion: Criterion,
        peak: f64,
        softening: Option<Softening>,
    ) -> Result<Self, SoilError> {
        let peak = positive("Su", peak)?;
        let Some(softening) = softening else {
            let none = Softening { residual: peak, strain: f64::INFINITY, decay: Decay::Linear };
            return Ok(Self { elastic, criterion, peak, softening: none });
        };
        let residual = positive("Sr", softening.residual)?;
        check("Sr", residual, "at most Su", residual <= peak)?;
        let strain = positive("softening_strain", softening.strain)?;
        check(
            "softening_strain",
            strain,
            "larger than (Su - Sr)/G, so that stress can follow the softening",
            elastic.constants().shear * strain > peak - residual,
        )?;
        Ok(Self { elastic, criterion, peak, softening })
    }

    /// Shear strength after a plastic shear strain, kPa.
    fn strength(&self, plastic_shear: f64) -> f64 {
        let Softening { residual, strain, decay } = self.softening;
        let share = plastic_shear / strain;
        match decay {
            Decay::Exponential => residual + (self.peak - residual) * (-share).exp(),
            Decay::Linear => self.peak + (residual - self.peak) * share.min(1.0),
        }
    }

    /// Increment of plastic shear strain that returns a trial stress of this size, kPa, to the surface, with the
    /// strength at the end of the step; zero for a trial stress inside.
    fn plastic_shear(&self, size: f64, before: f64) -> f64 {
        let excess = size - self.strength(before);
        if excess <= 0.0 {
            return 0.0;
        }
        let shear = self.elastic.constants().shear;
        let Softening { residual, strain, decay } = self.softening;
        let to_residual = (size - residual) / shear;
        if decay == Decay::Linear {
            let plastic = excess / (shear - (self.peak - residual) / strain);
            return if before + plastic <= strain { plastic } else { to_residual };
        }
        // The unbalanced stress decreases with plastic strain and is concave. Newton's method started above the root
        // therefore decreases to the root without passing it; the loop ends at round-off.
        let mut plastic = to_residual;
        for _ in 0..Self::MOST_ITERATIONS {
            let strength = self.strength(before + plastic);
            let slope = shear - (strength - residual) / strain;
            let next = plastic + (size - shear * plastic - strength) / slope;
            if next >= plastic {
                break;
            }
            plastic = next;
        }
        plastic
    }

    /// The stress measure that is limited by the strength, kPa.
    fn size(&self, stress: &Stress) -> f64 {
        match self.criterion {
            Criterion::Tresca => stress.radius(),
            Criterion::VonMises => stress.root_j2(),
        }
    }

    /// State after the radial return of a trial stress.
    fn returned(&self, trial: Stress, plastic_shear: f64) -> State {
        let (size, strength) = (self.size(&trial), self.strength(plastic_shear));
        if size <= strength {
            return State { stress: trial, plastic_shear };
        }
        let factor = strength / size;
        let stress = match self.criterion {
            Criterion::Tresca => {
                Stress::of_plane(trial.plane_mean(), trial.plane_deviator() * factor, trial.zz)
            }
            Criterion::VonMises => trial.with(trial.first_invariant(), factor),
        };
        State { stress, plastic_shear }
    }
}

impl SoilModel for TotalStress {
    type State = State;

    /// The deviator of a stress outside the surface is reduced to the surface.
    fn initialise(&self, stress: Stress, _void_ratio: Option<f64>) -> Result<State, SoilError> {
        let state = self.returned(stress.finite("initial stress")?, 0.0);
        state.stress.finite("initial stress")?;
        Ok(state)
    }

    fn update(
        &self,
        state: &mut State,
        de: &StrainIncrement,
        _integrator: &Integrator,
    ) -> Result<UpdateReport, SoilError> {
        de.bounded()?;
        let trial = self.elastic.moved(&state.stress, de);
        let plastic = self.plastic_shear(self.size(&trial), state.plastic_shear);
        let next = self.returned(trial, state.plastic_shear + plastic);
        next.stress.finite("stress")?;
        *state = next;
        Ok(UpdateReport::default())
    }

    fn stress(&self, state: &State) -> Stress {
        state.stress
    }

    fn moduli(&self, _state: &State) -> Moduli {
        self.elastic.constants()
    }

    fn static_shear_modulus(&self) -> f64 {
        self.elastic.constants().shear
    }

    fn plastic_shear_strain(&self, state: &State) -> Option<f64> {
        Some(state.plastic_shear)
    }

    fn carries(&self, stress: &Stress) -> bool {
        self.size(stress) <= self.peak
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const G: f64 = 1.0e4;

    fn clay(decay: Decay, strain: f64) -> Result<TotalStress, SoilError> {
        let softening = Softening { residual: 5.0, strain, decay };
        TotalStress::new(Elastic::new(G, 3.0 * G)?, Criterion::Tresca, 25.0, Some(softening))
    }

    #[test]
    fn plastic_shear_balances_the_stress() {
        for decay in [Decay::Exponential, Decay::Linear] {
            // The second strain is a millionth above the smallest one allowed.
            for strain in [0.05, 2e-3 * (1.0 + 1e-6)] {
                let clay = clay(decay, strain).unwrap();
                for before in [0.0, 0.3 * strain, 0.999 * strain, 30.0 * strain] {
                    for excess in [1e-9, 1e-3, 1.0, 30.0, 1e5] {
                        let size = clay.strength(before) + excess;
                        let plastic = clay.plastic_shear(size, before);
                        let left = size - G * plastic - clay.strength(before + plastic);
                        assert!(left.abs() <= 1e-12 * size, "{decay:?} {strain} {before} {excess}: {left}");
                        assert!(plastic > 0.0);
                    }
                }
            }
        }
    }

    #[test]
    fn no_plastic_strain_inside_the_surface() {
        let clay = clay(Decay::Exponential, 0.05).unwrap();
        assert_eq!(clay.plastic_shear(25.0, 0.0), 0.0);
        assert_eq!(clay.plastic_shear(24.0, 0.0), 0.0);
        assert!(clay.plastic_shear(24.0, 0.05) > 0.0);
    }

    #[test]
    fn impossible_strengths_are_refused() {
        assert!(clay(Decay::Exponential, 2e-3).is_err());
        assert!(clay(Decay::Linear, 1e-3).is_err());
        assert!(clay(Decay::Linear, f64::INFINITY).is_err());
        let elastic = Elastic::new(G, 3.0 * G).unwrap();
        for strength in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(TotalStress::new(elastic, Criterion::VonMises, strength, None).is_err());
        }
        for residual in [0.0, 25.1, f64::NAN] {
            let softening = Some(Softening { residual, strain: 0.05, decay: Decay::Linear });
            assert!(TotalStress::new(elastic, Criterion::Tresca, 25.0, softening).is_err());
        }
    }
}
