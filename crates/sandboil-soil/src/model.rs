//! The interface of all soil models, and the list of the models.
//!
//! A new model is one file with its parameters, its state and its implementation of [`SoilModel`]
//! (`docs/theory/writing_a_model.md`), and one line each in [`Soil`] and in [`with_model!`](crate::with_model).

use crate::{
    Integrator, Moduli, SoilError, StrainIncrement, Stress, UpdateReport, drucker_prager::DruckerPrager,
    elastic::Elastic, mohr_coulomb::MohrCoulomb, pm4sand::PM4Sand, pressure_elastic::PressureElastic,
    total_stress::TotalStress,
};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::fmt::Debug;

/// A constitutive model: checked parameters, and pure functions that map a state and a strain increment to a new state.
///
/// Stress is effective, kPa, tension positive, in fixed axes; strain is tension positive with engineering shear.
/// A model rotates its state with the material: every increment contains a rotation, `StrainIncrement::spin`.
pub trait SoilModel: Clone + Debug + Send + Sync {
    /// The whole state of one point, including its stress. It can be stored, so that a run can be continued.
    type State: Copy + Debug + Send + Sync + Serialize + DeserializeOwned;

    /// State at rest under an effective stress (kPa, tension positive), at zero strain. `void_ratio` is that of the
    /// point; `None` means the model's default. A model that does not depend on density ignores it.
    ///
    /// A stress outside the strength surface is replaced by an admissible one near it, which [`SoilModel::stress`]
    /// returns.
    ///
    /// # Errors
    /// [`SoilError::NonFinite`] for a stress that is not finite, [`SoilError::InvalidParameter`] for a void ratio
    /// outside its range.
    fn initialise(&self, stress: Stress, void_ratio: Option<f64>) -> Result<Self::State, SoilError>;

    /// Updates a state by a strain increment. On error the state is unchanged.
    ///
    /// `integrator` is the integration method of rate equations; a model in closed form ignores it.
    ///
    /// # Errors
    /// [`SoilError::NonFinite`] for an increment or a result that is not finite,
    /// [`SoilError::StrainIncrementTooLarge`] for an increment above its limit.
    fn update(
        &self,
        state: &mut Self::State,
        de: &StrainIncrement,
        integrator: &Integrator,
    ) -> Result<UpdateReport, SoilError>;

    /// Effective stress in fixed axes, kPa, tension positive.
    fn stress(&self, state: &Self::State) -> Stress;

    /// Present elastic moduli, kPa. The solver computes wave speeds and the time step from them.
    fn moduli(&self, state: &Self::State) -> Moduli;

    /// Shear modulus of the elastic static stage, kPa.
    fn static_shear_modulus(&self) -> f64;

    /// Void ratio; `None` for a model without it.
    fn void_ratio(&self, _state: &Self::State) -> Option<f64> {
        None
    }

    /// Accumulated plastic shear strain (engineering); `None` for a model that does not soften with it.
    fn plastic_shear_strain(&self, _state: &Self::State) -> Option<f64> {
        None
    }

    /// Whether a stress is admissible, so that [`SoilModel::initialise`] keeps it.
    fn carries(&self, _stress: &Stress) -> bool {
        true
    }

    /// The model for reconsolidation after shaking; `state` is prepared for it. `None` for a model that is the same
    /// in reconsolidation.
    fn reconsolidating(&self, _state: &mut Self::State) -> Option<Self> {
        None
    }
}

/// The soil model of one region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Soil {
    /// Linear elasticity.
    Elastic(Elastic),
    /// Drucker-Prager plasticity.
    DruckerPrager(DruckerPrager),
    /// Mohr-Coulomb plasticity.
    MohrCoulomb(MohrCoulomb),
    /// PM4Sand.
    PM4Sand(Box<PM4Sand>),
    /// Elasticity with stiffness from the pressure at rest.
    PressureElastic(PressureElastic),
    /// Undrained strength on total stress.
    TotalStress(TotalStress),
}

/// Runs generic code on the model that a [`Soil`] holds: `with_model!(soil, model => model.moduli(..))`.
#[macro_export]
macro_rules! with_model {
    ($soil:expr, $model:ident => $body:expr) => {
        match $soil {
            $crate::Soil::Elastic($model) => $body,
            $crate::Soil::DruckerPrager($model) => $body,
            $crate::Soil::MohrCoulomb($model) => $body,
            $crate::Soil::PM4Sand($model) => $body,
            $crate::Soil::PressureElastic($model) => $body,
            $crate::Soil::TotalStress($model) => $body,
        }
    };
}

/// A boxed model is also a model, so [`Soil`] can hold large parameter sets in a box.
impl<M: SoilModel> SoilModel for Box<M> {
    type State = M::State;

    fn initialise(&self, stress: Stress, void_ratio: Option<f64>) -> Result<Self::State, SoilError> {
        (**self).initialise(stress, void_ratio)
    }

    fn update(
        &self,
        state: &mut Self::State,
        de: &StrainIncrement,
        integrator: &Integrator,
    ) -> Result<UpdateReport, SoilError> {
        (**self).update(state, de, integrator)
    }

    fn stress(&self, state: &Self::State) -> Stress {
        (**self).stress(state)
    }

    fn moduli(&self, state: &Self::State) -> Moduli {
        (**self).moduli(state)
    }

    fn static_shear_modulus(&self) -> f64 {
        (**self).static_shear_modulus()
    }

    fn void_ratio(&self, state: &Self::State) -> Option<f64> {
        (**self).void_ratio(state)
    }

    fn plastic_shear_strain(&self, state: &Self::State) -> Option<f64> {
        (**self).plastic_shear_strain(state)
    }

    fn carries(&self, stress: &Stress) -> bool {
        (**self).carries(stress)
    }

    fn reconsolidating(&self, state: &mut Self::State) -> Option<Self> {
        (**self).reconsolidating(state).map(Box::new)
    }
}

impl Soil {
    /// Shear modulus of the elastic static stage, kPa.
    pub fn static_shear_modulus(&self) -> f64 {
        with_model!(self, model => model.static_shear_modulus())
    }

    /// Small-strain elastic moduli, kPa, under an effective stress (kPa, tension positive).
    ///
    /// # Errors
    /// As [`SoilModel::initialise`].
    pub fn small_strain_moduli(&self, stress: Stress) -> Result<Moduli, SoilError> {
        with_model!(self, model => Ok(model.moduli(&model.initialise(stress, None)?)))
    }
}
