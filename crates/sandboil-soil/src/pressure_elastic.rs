//! Elasticity with stiffness from the effective pressure at rest, `G = G_ref (p'/p_ref)^n` with K/G constant.
//!
//! The moduli of a point follow from its initial stress and stay constant. If they changed with pressure during a
//! load cycle, the cycle would create or dissipate energy (Zytynski, Randolph, Nova and Wroth 1978).

use crate::{
    Integrator, Moduli, SoilError, SoilModel, StrainIncrement, Stress, UpdateReport,
    elastic::Elastic,
    error::{check, positive},
};

/// Elastic material with stiffness from the pressure at rest.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PressureElastic {
    reference: Moduli,
    exponent: f64,
    reference_pressure: f64,
}

/// State of one point: its stress and its elastic constants.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct State {
    stress: Stress,
    elastic: Elastic,
}

impl PressureElastic {
    /// Lower limit of the pressure, relative to the reference pressure, so that soil at the ground surface has some
    /// stiffness. For an atmospheric reference pressure it is the pressure below 5 cm of soil.
    const PRESSURE_FLOOR: f64 = 0.01;

    /// Material with elastic constants at the mean effective stress `reference_pressure`, kPa, compression positive,
    /// and an exponent in [0, 1].
    ///
    /// # Errors
    /// [`SoilError::InvalidParameter`] for an exponent or a pressure outside its range.
    pub fn new(reference: Elastic, exponent: f64, reference_pressure: f64) -> Result<Self, SoilError> {
        Ok(Self {
            reference: reference.constants(),
            exponent: check("exponent", exponent, "in [0, 1]", (0.0..=1.0).contains(&exponent))?,
            reference_pressure: positive("p_ref", reference_pressure)?,
        })
    }
}

impl SoilModel for PressureElastic {
    type State = State;

    fn initialise(&self, stress: Stress, _void_ratio: Option<f64>) -> Result<State, SoilError> {
        let stress = stress.finite("initial stress")?;
        let pressure = -stress.first_invariant() / 3.0;
        let factor = (pressure / self.reference_pressure).max(Self::PRESSURE_FLOOR).powf(self.exponent);
        let Moduli { bulk, shear } = self.reference;
        Ok(State { stress, elastic: Elastic::new(factor * shear, factor * bulk)? })
    }

    fn update(
        &self,
        state: &mut State,
        de: &StrainIncrement,
        _integrator: &Integrator,
    ) -> Result<UpdateReport, SoilError> {
        de.bounded()?;
        state.stress = state.elastic.moved(&state.stress, de).finite("stress")?;
        Ok(UpdateReport::default())
    }

    fn stress(&self, state: &State) -> Stress {
        state.stress
    }

    fn moduli(&self, state: &State) -> Moduli {
        state.elastic.constants()
    }

    fn static_shear_modulus(&self) -> f64 {
        self.reference.shear
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn soil(exponent: f64) -> PressureElastic {
        PressureElastic::new(Elastic::new(8.0e4, 1.7e5).unwrap(), exponent, 100.0).unwrap()
    }

    fn at_rest(pressure: f64) -> Stress {
        Stress { xx: -0.5 * pressure, yy: -1.5 * pressure, xy: 10.0, zz: -pressure }
    }

    #[test]
    fn stiffness_follows_the_mean_effective_stress() {
        for (exponent, pressure, factor) in
            [(0.5, 400.0, 2.0), (0.5, 100.0, 1.0), (0.5, 25.0, 0.5), (1.0, 200.0, 2.0), (0.0, 7.0, 1.0)]
        {
            let soil = soil(exponent);
            let Moduli { bulk, shear } = soil.moduli(&soil.initialise(at_rest(pressure), None).unwrap());
            assert!((shear / (factor * 8.0e4) - 1.0).abs() < 1e-14, "{exponent} {pressure}: {shear}");
            assert!((bulk / (factor * 1.7e5) - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn stiffness_at_no_pressure_and_in_tension_is_a_tenth() {
        for pressure in [0.0, 1e-9, 1.0, -50.0] {
            let soil = soil(0.5);
            let shear = soil.moduli(&soil.initialise(at_rest(pressure), None).unwrap()).shear;
            assert!((shear - 8.0e3).abs() < 1e-9, "{shear}");
        }
    }

    #[test]
    fn moduli_stay_constant_when_pressure_changes() {
        let soil = soil(0.5);
        let mut state = soil.initialise(at_rest(100.0), None).unwrap();
        let before = soil.moduli(&state);
        let de = StrainIncrement { xx: -0.01, yy: -0.01, ..StrainIncrement::default() };
        soil.update(&mut state, &de, &Integrator::default()).unwrap();
        assert!(soil.stress(&state).first_invariant() < -1000.0);
        assert_eq!(soil.moduli(&state), before);
    }

    #[test]
    fn impossible_constants_are_refused() {
        let reference = Elastic::new(8.0e4, 1.7e5).unwrap();
        for exponent in [-0.1, 1.1, f64::NAN] {
            assert!(PressureElastic::new(reference, exponent, 100.0).is_err());
        }
        for pressure in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(PressureElastic::new(reference, 0.5, pressure).is_err());
        }
    }
}
