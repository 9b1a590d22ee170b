//! The record of a test.

use crate::Stress;

/// One line of a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Strain `xx`, `yy` and engineering `xy` since the specimen was made, tension positive.
    pub strain: [f64; 3],
    /// Effective stress, kPa, tension positive.
    pub stress: Stress,
    /// Void ratio; `None` if the model has none.
    pub void_ratio: Option<f64>,
    /// Number of cycles so far: 0.25 at the first turn, 0.5 more at each further turn, linear in the cycled quantity
    /// between turns.
    pub cycle: f64,
    /// Number of turns (or of legs of a path) completed so far, including one at this row.
    pub turns: usize,
}

/// Number of cycles so far, after `turns` turns. The cycled quantity (shear stress or strain) is now `value`, between
/// its value `from` at the last turn and `to` at the next. Where soil softens, the value may fall behind the last turn;
/// the number of cycles then stays at that of the last turn.
pub fn cycles(turns: usize, (from, to): (f64, f64), value: f64) -> f64 {
    let (begun, length) = if turns == 0 { (0.0, 0.25) } else { (0.5 * turns as f64 - 0.25, 0.5) };
    let share = if to == from { 1.0 } else { ((value - from) / (to - from)).clamp(0.0, 1.0) };
    begun + share * length
}

/// Smallest changes to be recorded. A row is left out if stress and strain have both changed less than this since the
/// last recorded row. Turns and the end are always recorded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resolution {
    /// Largest change of a stress component, kPa.
    pub stress: f64,
    /// Largest change of a strain component.
    pub strain: f64,
}

impl Resolution {
    /// Records every increment.
    pub const EVERY: Self = Self { stress: 0.0, strain: 0.0 };
    /// Records turns and ends only.
    pub const TURNS: Self = Self { stress: f64::INFINITY, strain: f64::INFINITY };
}

/// The rows of a test.
#[derive(Debug, Clone)]
pub struct Record {
    resolution: Resolution,
    rows: Vec<Row>,
}

impl Record {
    /// An empty record.
    pub fn new(resolution: Resolution) -> Self {
        Self { resolution, rows: Vec::new() }
    }

    /// The recorded rows, in order.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Records a row regardless of its distance from the last one; a repetition of the last row is left out.
    pub fn keep(&mut self, row: Row) {
        if self.rows.last() != Some(&row) {
            self.rows.push(row);
        }
    }

    /// Records a row if it is far enough from the last one.
    pub fn offer(&mut self, row: Row) {
        let Some(last) = self.rows.last() else {
            self.rows.push(row);
            return;
        };
        let (a, b) = (row.stress, last.stress);
        let stress = (a.xx - b.xx).abs().max((a.yy - b.yy).abs()).max((a.xy - b.xy).abs());
        let strain = (0..3).map(|k| (row.strain[k] - last.strain[k]).abs()).fold(0.0, f64::max);
        if stress >= self.resolution.stress || strain >= self.resolution.strain {
            self.rows.push(row);
        }
    }
}
