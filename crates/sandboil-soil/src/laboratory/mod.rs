//! The laboratory: one material point under test, with any mixture of prescribed strain and stress.
//!
//! A [`Specimen`] is the very model and state that a solver would have at a stress node; it is sheared to turning
//! points ([`Specimen::shear`]) or led along a path ([`Specimen::path`]). Strain is tension positive with
//! engineering shear, stress effective, kPa, tension positive.

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

/// Why a test ended. Whatever was measured up to then is in the record.
#[derive(Debug, Clone, PartialEq)]
pub enum Ending {
    /// All that was asked for was done.
    Complete,
    /// Shear strain left the range allowed to it.
    StrainLimit,
    /// No strain was found that gives the prescribed stress: the soil cannot carry it, or flows under it.
    StressNotCarried {
        /// The stress asked for, kPa, tension positive; components under strain control as they are.
        wanted: Stress,
        /// The stress reached.
        reached: Stress,
    },
    /// The model refused an increment.
    Refused(SoilError),
    /// The caller asked to stop.
    Interrupted,
}

/// Increments between looks at whether the caller wants to stop.
const INCREMENTS_PER_LOOK: u32 = 1024;

/// Asks the caller now and then whether to stop, however short the legs of a test are.
struct Watch<'a> {
    stop: &'a mut dyn FnMut() -> bool,
    increments: u32,
}

impl<'a> Watch<'a> {
    fn new(stop: &'a mut dyn FnMut() -> bool) -> Self {
        Self { stop, increments: 0 }
    }

    /// Counts an increment; true where the caller wants to stop.
    fn interrupts(&mut self) -> bool {
        self.increments = self.increments.wrapping_add(1);
        self.increments.is_multiple_of(INCREMENTS_PER_LOOK) && (self.stop)()
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
    /// A specimen of a model at rest under a stress, at zero strain.
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

    /// A specimen of a point that is already there.
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

    /// What the model counted in accepted increments and in trials that were given up.
    pub fn report(&self) -> UpdateReport {
        self.report
    }

    /// Switches the model to reconsolidation after shaking; returns whether that makes any difference to it.
    pub fn reconsolidate(&mut self) -> bool {
        self.point.reconsolidate()
    }

    /// Another specimen in the same state, to go on with while this one stays.
    #[must_use]
    pub fn copy(&self) -> Self {
        Self { point: self.point.copy(), ..*self }
    }

    fn row(&self, cycle: f64, turns: usize) -> Row {
        Row { strain: self.strain, stress: self.stress(), void_ratio: self.point.void_ratio(), cycle, turns }
    }
}
