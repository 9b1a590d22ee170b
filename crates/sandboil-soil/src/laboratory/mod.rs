//! The laboratory: tests on one material point, with any combination of prescribed strain and stress.
//!
//! A [`Specimen`] holds the same model and state as a stress node of the solver. It is sheared between turning points
//! ([`Specimen::shear`]) or follows a given path ([`Specimen::path`]). Strain is tension positive with engineering
//! shear; stress is effective, kPa, tension positive.

mod control;
mod path;
mod point;
mod record;
mod shear;

pub use path::Path;
pub use point::Point;
pub use record::{Record, Resolution, Row, cycles};
pub use shear::{Shear, Turn, Turns};

use crate::{Integrator, SoilError, SoilModel, Stress, UpdateReport};
use point::ModelPoint;

/// Why a test ended. The record holds all results up to the end.
#[derive(Debug, Clone, PartialEq)]
pub enum Ending {
    /// The whole test was carried out.
    Complete,
    /// Shear strain passed its limit.
    StrainLimit,
    /// No strain gives the prescribed stress: the soil cannot carry it, or fails under it.
    StressNotCarried {
        /// The prescribed stress, kPa, tension positive; components under strain control as in `reached`.
        wanted: Stress,
        /// The stress reached, kPa, tension positive.
        reached: Stress,
    },
    /// The model refused an increment.
    Refused(SoilError),
    /// The caller asked to stop.
    Interrupted,
}

/// Number of increments between two calls of the caller's `stop`.
const INCREMENTS_PER_CHECK: u32 = 1024;

/// Calls `stop` at regular intervals. Increments are counted over all legs, so short legs do not delay the call.
struct Watch<'a> {
    stop: &'a mut dyn FnMut() -> bool,
    increments: u32,
}

impl<'a> Watch<'a> {
    fn new(stop: &'a mut dyn FnMut() -> bool) -> Self {
        Self { stop, increments: 0 }
    }

    /// Counts an increment; true if the caller wants to stop.
    fn interrupts(&mut self) -> bool {
        self.increments = self.increments.wrapping_add(1);
        self.increments.is_multiple_of(INCREMENTS_PER_CHECK) && (self.stop)()
    }
}

/// A material point under test.
pub struct Specimen {
    point: Box<dyn Point>,
    integrator: Integrator,
    strain: [f64; 3],
    report: UpdateReport,
}

impl Specimen {
    /// A specimen of a model at rest under a stress (kPa, tension positive), at zero strain.
    ///
    /// # Errors
    /// As [`SoilModel::initialise`].
    pub fn new<M: SoilModel + 'static>(
        model: &M,
        stress: Stress,
        void_ratio: Option<f64>,
        integrator: Integrator,
    ) -> Result<Self, SoilError> {
        let state = model.initialise(stress, void_ratio)?;
        Ok(Self::of_point(Box::new(ModelPoint::new(model.clone(), state)), integrator))
    }

    /// A specimen made of an existing point.
    pub fn of_point(point: Box<dyn Point>, integrator: Integrator) -> Self {
        Self { point, integrator, strain: [0.0; 3], report: UpdateReport::default() }
    }

    /// Effective stress, kPa, tension positive.
    pub fn stress(&self) -> Stress {
        self.point.stress()
    }

    /// Strain `xx, yy`, engineering `xy` since the specimen was made, tension positive.
    pub fn strain(&self) -> [f64; 3] {
        self.strain
    }

    /// The point under test.
    pub fn point(&self) -> &dyn Point {
        &*self.point
    }

    /// Counters of the model, over accepted increments and rejected trials.
    pub fn report(&self) -> UpdateReport {
        self.report
    }

    /// Switches the model to reconsolidation after shaking; false if the model has no such state.
    pub fn reconsolidate(&mut self) -> bool {
        self.point.reconsolidate()
    }

    /// An independent specimen in the same state.
    #[must_use]
    pub fn copy(&self) -> Self {
        Self { point: self.point.copy(), ..*self }
    }

    fn row(&self, cycle: f64, turns: usize) -> Row {
        Row { strain: self.strain, stress: self.stress(), void_ratio: self.point.void_ratio(), cycle, turns }
    }
}
