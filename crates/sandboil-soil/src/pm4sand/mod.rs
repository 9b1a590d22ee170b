//! PM4Sand version 3.1, plane strain (Boulanger and Ziotopoulou 2017, UCD/CGM-17/01), as implemented by
//! Chen and Arduino (2021, PEER 2021/02). Framework: Dafalias and Manzari (2004).
//!
//! Inside this module compression is positive, and a stress is stored as its in-plane mean `p = (xx + yy)/2` and its
//! deviator `s`. The types of the interface, [`Stress`] and [`StrainIncrement`], are tension positive. The whole state
//! is stored in a frame that rotates with the material; this gives the Jaumann rate of every tensor.

#[cfg(test)]
mod check_values;
mod flow;
mod initialise;
mod integrate;
mod parameters;
mod rates;
mod reversal;
mod state;
mod surfaces;

pub use parameters::{Constants, Options, PM4Sand, Parameters};
pub use state::State;
pub use surfaces::Surfaces;

use crate::{Deviator, Integrator, Moduli, SoilError, SoilModel, StrainIncrement, Stress, UpdateReport};
use state::Strain;

/// Largest number of parts of one increment. An increment that needs more is refused, because it would take too long.
const MAX_PARTS: f64 = 1e7;

impl SoilModel for PM4Sand {
    type State = State;

    fn initialise(&self, stress: Stress, void_ratio: Option<f64>) -> Result<State, SoilError> {
        self.first_state(stress, void_ratio.unwrap_or_else(|| self.constants.initial_void_ratio()))
    }

    /// Updates a state by a strain increment. On error the state is unchanged.
    ///
    /// # Errors
    /// [`SoilError::NonFinite`] for an increment or a result that is not finite,
    /// [`SoilError::StrainIncrementTooLarge`] above 1000 % or ten million parts of the integrator.
    fn update(
        &self,
        state: &mut State,
        de: &StrainIncrement,
        integrator: &Integrator,
    ) -> Result<UpdateReport, SoilError> {
        de.within(MAX_PARTS * integrator.max_increment())?;
        let mut next = *state;
        let mut strain = Strain {
            volume: -(de.xx + de.yy),
            deviator: Deviator { half_difference: -0.5 * (de.xx - de.yy), xy: -0.5 * de.xy },
        };
        if de.spin != 0.0 || state.rotation != 0.0 {
            // With the angle at mid-step, the combination of rotation and strain is second-order accurate.
            let middle = state.rotation - 0.5 * de.spin;
            strain.deviator = strain.deviator.in_axes_turned(double_angle(middle));
            next.rotation -= de.spin;
        }
        let mut report = UpdateReport::default();
        self.integrate(&mut next, strain, integrator, &mut report);
        *state = next.finite()?;
        Ok(report)
    }

    /// Effective stress in fixed axes, kPa, tension positive, including the offset of an inadmissible initial stress.
    fn stress(&self, state: &State) -> Stress {
        let mean = state.mean + state.offset.mean;
        let mut deviator = state.deviator + state.offset.deviator;
        if state.rotation != 0.0 {
            deviator = deviator.in_axes_turned(double_angle(-state.rotation));
        }
        Stress {
            xx: -(mean + deviator.half_difference),
            yy: -(mean - deviator.half_difference),
            xy: -deviator.xy,
            zz: -(state.out_of_plane + state.offset.out_of_plane),
        }
    }

    /// Elastic moduli of the last commit, kPa.
    fn moduli(&self, state: &State) -> Moduli {
        state.moduli
    }

    fn static_shear_modulus(&self) -> f64 {
        self.constants.g0 * self.constants.p_atm
    }

    fn void_ratio(&self, state: &State) -> Option<f64> {
        Some(state.void_ratio_at(state.volumetric_strain))
    }

    /// True inside the larger of bounding and dilatancy surface and at or above `p_min`.
    fn carries(&self, stress: &Stress) -> bool {
        self.first_state(*stress, self.constants.initial_void_ratio()).is_ok_and(|state| !state.has_offset())
    }

    fn reconsolidating(&self, state: &mut State) -> Option<Self> {
        let sand = self.clone().with_options(Options { post_shaking: true, ..self.options });
        sand.refresh_moduli(state);
        Some(sand)
    }
}

/// Cosine and sine of twice an angle.
fn double_angle(angle: f64) -> (f64, f64) {
    let (sin2, cos2) = (2.0 * angle).sin_cos();
    (cos2, sin2)
}
