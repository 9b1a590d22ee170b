//! The one interface of all soil models, and the list of those there are.
//!
//! A new model is one file: its parameters, its state, and [`SoilModel`] for them (`docs/theory/writing_a_model.md`).
//! It joins the others by one line in [`Soil`] and one in [`with_model!`](crate::with_model).

use crate::{
    Integrator, Moduli, SoilError, StrainIncrement, Stress, UpdateReport, drucker_prager::DruckerPrager,
    elastic::Elastic, mohr_coulomb::MohrCoulomb, pm4sand::PM4Sand, pressure_elastic::PressureElastic,
    total_stress::TotalStress,
};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::fmt::Debug;

/// A constitutive model: checked parameters, and pure functions from state and strain to state.
///
/// Stress is effective, kPa, tension positive, in space axes; strain is tension positive with engineering shear.
/// A model turns its state with the material: `StrainIncrement::spin` is part of every increment.
pub trait SoilModel: Clone + Debug + Send + Sync {
    /// All that one point remembers, its stress included. It can be stored, so that a run can be gone on with.
    type State: Copy + Debug + Send + Sync + Serialize + DeserializeOwned;

    /// State at rest under an effective stress (kPa, tension positive), at zero strain. `void_ratio` is that of the
    /// point; `None` takes the model's own, and a model whose answer does not depend on density ignores it.
    ///
    /// A stress that the model cannot carry is replaced by the nearest one it can; [`SoilModel::stress`] tells it.
    ///
    /// # Errors
    /// [`SoilError::NonFinite`] or [`SoilError::InvalidParameter`] for input that means nothing.
    fn initialise(&self, stress: Stress, void_ratio: Option<f64>) -> Result<Self::State, SoilError>;

    /// Moves a state through a strain increment. On error the state is unchanged.
    ///
    /// `integrator` chooses how rate equations are integrated; a model solved in closed form ignores it.
    ///
    /// # Errors
    /// [`SoilError::NonFinite`] for an increment or a result that is not finite,
    /// [`SoilError::StrainIncrementTooLarge`] for one beyond all meaning.
    fn update(
        &self,
        state: &mut Self::State,
        de: &StrainIncrement,
        integrator: &Integrator,
    ) -> Result<UpdateReport, SoilError>;

    /// Effective stress in space axes, kPa, tension positive.
    fn stress(&self, state: &Self::State) -> Stress;

    /// Present elastic moduli, kPa: they set wave speeds and the time step.
    fn moduli(&self, state: &Self::State) -> Moduli;

    /// Shear modulus of the elastic static stage, kPa.
    fn static_shear_modulus(&self) -> f64;

    /// Void ratio, for models that know it.
    fn void_ratio(&self, _state: &Self::State) -> Option<f64> {
        None
    }

    /// Accumulated plastic shear strain (engineering), for models that soften with it.
    fn plastic_shear_strain(&self, _state: &Self::State) -> Option<f64> {
        None
    }

    /// Whether the model can carry a stress as it is, so that [`SoilModel::initialise`] replaces nothing.
    fn carries(&self, _stress: &Stress) -> bool {
        true
    }

    /// The model for reconsolidation after shaking, and the state made ready for it; `None` where that makes no
    /// difference.
    fn reconsolidating(&self, _state: &mut Self::State) -> Option<Self> {
        None
    }
}

/// A soil model as one region uses it.
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
    /// Elasticity stiffened by the pressure at rest.
    PressureElastic(PressureElastic),
    /// Undrained strength on total stress.
    TotalStress(TotalStress),
}

/// Runs generic code on whichever model a [`Soil`] holds: `with_model!(soil, model => model.moduli(..))`.
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

/// A boxed model is a model: large parameter sets stay out of line in [`Soil`].
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

    /// Elastic moduli of unsheared ground under an effective stress (kPa, tension positive), kPa.
    ///
    /// # Errors
    /// As [`SoilModel::initialise`].
    pub fn small_strain_moduli(&self, stress: Stress) -> Result<Moduli, SoilError> {
        with_model!(self, model => Ok(model.moduli(&model.initialise(stress, None)?)))
    }
}
