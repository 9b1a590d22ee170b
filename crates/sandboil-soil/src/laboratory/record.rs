//! What a test writes down.

use crate::Stress;

/// One line of a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Strain `xx, yy`, engineering `xy`, tension positive.
    pub strain: [f64; 3],
    /// Effective stress, kPa, tension positive.
    pub stress: Stress,
    /// Void ratio, if the model knows it.
    pub void_ratio: Option<f64>,
    /// Cycles so far: 0.25 at the first turn, half a cycle from turn to turn, between turns in proportion to the
    /// quantity that is turned.
    pub cycle: f64,
    /// Turns (or legs of a path) completed so far, that at this row included.
    pub turns: usize,
}

/// Cycles so far after `turns` turns, where the quantity that is turned has come to `value` on its way `from` the last
/// turn `to` the next. Soil may soften on the way: cycles never go back beyond the last turn.
pub fn cycles(turns: usize, (from, to): (f64, f64), value: f64) -> f64 {
    let (begun, length) = if turns == 0 { (0.0, 0.25) } else { (0.5 * turns as f64 - 0.25, 0.5) };
    let share = if to == from { 1.0 } else { ((value - from) / (to - from)).clamp(0.0, 1.0) };
    begun + share * length
}

/// Changes that are worth a line: rows closer than all of these to the last one written are left out, except turns
/// and the end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resolution {
    /// Change of a stress component, kPa.
    pub stress: f64,
    /// Change of a strain component.
    pub strain: f64,
}

impl Resolution {
    /// Every increment.
    pub const EVERY: Self = Self { stress: 0.0, strain: 0.0 };
    /// Turns and ends only.
    pub const TURNS: Self = Self { stress: f64::INFINITY, strain: f64::INFINITY };
}

/// The lines of a test.
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

    /// The lines.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Writes a line whatever its distance, once.
    pub fn keep(&mut self, row: Row) {
        if self.rows.last() != Some(&row) {
            self.rows.push(row);
        }
    }

    /// Writes a line if it is far enough from the last one.
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
