//! A model together with its state, behind one interface for all models.

use crate::{Integrator, Moduli, SoilError, SoilModel, StrainIncrement, Stress, UpdateReport};

/// A soil at one point. A trial starts from the marked state and can be undone by restoring that state.
pub trait Point: Send + Sync {
    /// Stores the present state for [`Point::back`].
    fn mark(&mut self);
    /// Restores the marked state.
    fn back(&mut self);
    /// Applies a strain increment.
    ///
    /// # Errors
    /// As [`SoilModel::update`].
    fn update(&mut self, de: &StrainIncrement, integrator: &Integrator) -> Result<UpdateReport, SoilError>;
    /// Effective stress, kPa, tension positive.
    fn stress(&self) -> Stress;
    /// Present elastic moduli, kPa.
    fn moduli(&self) -> Moduli;
    /// Void ratio; `None` if the model has none.
    fn void_ratio(&self) -> Option<f64>;
    /// Accumulated plastic shear strain (engineering); `None` if the model has none.
    fn plastic_shear_strain(&self) -> Option<f64>;
    /// Switches to reconsolidation after shaking; false if the model has no such state.
    fn reconsolidate(&mut self) -> bool;
    /// An independent point in the same state.
    fn copy(&self) -> Box<dyn Point>;
}

/// A [`SoilModel`] with its present and its marked state.
#[derive(Clone)]
pub(super) struct ModelPoint<M: SoilModel> {
    model: M,
    state: M::State,
    marked: M::State,
}

impl<M: SoilModel> ModelPoint<M> {
    pub(super) fn new(model: M, state: M::State) -> Self {
        Self { model, state, marked: state }
    }
}

impl<M: SoilModel + 'static> Point for ModelPoint<M> {
    fn mark(&mut self) {
        self.marked = self.state;
    }

    fn back(&mut self) {
        self.state = self.marked;
    }

    fn update(&mut self, de: &StrainIncrement, integrator: &Integrator) -> Result<UpdateReport, SoilError> {
        self.model.update(&mut self.state, de, integrator)
    }

    fn stress(&self) -> Stress {
        self.model.stress(&self.state)
    }

    fn moduli(&self) -> Moduli {
        self.model.moduli(&self.state)
    }

    fn void_ratio(&self) -> Option<f64> {
        self.model.void_ratio(&self.state)
    }

    fn plastic_shear_strain(&self) -> Option<f64> {
        self.model.plastic_shear_strain(&self.state)
    }

    fn reconsolidate(&mut self) -> bool {
        match self.model.reconsolidating(&mut self.state) {
            Some(model) => {
                self.model = model;
                true
            }
            None => false,
        }
    }

    fn copy(&self) -> Box<dyn Point> {
        Box::new(self.clone())
    }
}
