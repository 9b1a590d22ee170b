//! The record of a free-field column in a stage.

use crate::{edges::base::Impedance, error::SolverError, section::description::STRESS_NODES};

/// Number of components of a nominal stress or pressure.
pub const COMPONENTS: usize = 4;

/// Motion, stress and pore pressure of a column in a stage. A section with the same column under the same motion reads
/// the record instead of solving the column.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ColumnRecord {
    /// Time between frames, s; the first frame is at the start of the stage. Values between frames are linear.
    pub interval: f64,
    /// Density and small-strain wave speeds of each row from below, at the start of the stage.
    pub impedance: Vec<Impedance>,
    /// Whether the values contain pore pressure.
    pub wet: bool,
    /// For each frame: increments of the nominal stress of each stress node and of the nominal pore pressure
    /// of each row (kPa), the velocity of each row (m/s), and the traction of the base (kPa).
    pub values: Vec<f64>,
}

impl ColumnRecord {
    /// Number of values in a frame of a column of `rows` rows.
    pub fn width(rows: usize, wet: bool) -> usize {
        let per_row = STRESS_NODES * COMPONENTS + if wet { COMPONENTS } else { 0 } + 2;
        per_row * rows + 2
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.impedance.len()
    }

    /// Refuses a record that is not of a column of `rows` rows, or is shorter than `duration` (s).
    ///
    /// # Errors
    /// The first value that does not fit.
    pub fn validate(&self, rows: usize, wet: bool, duration: f64) -> Result<(), SolverError> {
        if self.rows() != rows || self.wet != wet {
            let (found, expected) = (self.rows(), rows);
            return Err(SolverError::Shape { name: "column_record", found, expected });
        }
        let width = Self::width(rows, wet);
        let frames = self.values.len() / width;
        let covered = self.interval * frames.saturating_sub(1) as f64;
        if !self.values.len().is_multiple_of(width) || !(covered >= duration) {
            let (name, value) = ("column_record", covered);
            return Err(SolverError::InvalidInput { name, value, expected: "as long as the stage, s" });
        }
        if let Some(&value) = self.values.iter().find(|value| !value.is_finite()) {
            return Err(SolverError::InvalidInput { name: "column_record", value, expected: "finite" });
        }
        Ok(())
    }

    /// Values at a time (s), linear between frames; after the last frame those of the last.
    pub fn at(&self, time: f64, into: &mut [f64]) {
        let width = into.len();
        let place = (time / self.interval).max(0.0);
        let last = self.values.len() / width - 1;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a frame's number, not negative
        let before = (place.floor() as usize).min(last);
        let after = (before + 1).min(last);
        let fraction = (place - before as f64).min(1.0);
        let (from, to) = (&self.values[width * before..][..width], &self.values[width * after..][..width]);
        for ((value, from), to) in into.iter_mut().zip(from).zip(to) {
            *value = from + fraction * (to - from);
        }
    }
}
