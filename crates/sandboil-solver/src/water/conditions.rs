//! Hydraulic conditions on the edges of a section (Section 4.1) and where they act.

use crate::{
    error::SolverError,
    section::{bins::Bins, description::Model, node_id::id},
    water::conduction::Beyond,
    weights::images::Crossing,
};
use sandboil_sph::Vec2;

/// A value that changes with time: straight between samples, constant before the first and after the last.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Series {
    /// Rising times, s.
    pub time: Vec<f64>,
    /// Values at these times.
    pub value: Vec<f64>,
}

impl Series {
    /// The same at all times.
    pub fn constant(value: f64) -> Self {
        Self { time: vec![0.0], value: vec![value] }
    }

    /// The value at a time.
    pub fn at(&self, time: f64) -> f64 {
        let after = self.time.partition_point(|&t| t <= time);
        if after == 0 {
            return self.value[0];
        }
        if after == self.time.len() {
            return self.value[after - 1];
        }
        let share = (time - self.time[after - 1]) / (self.time[after] - self.time[after - 1]);
        self.value[after - 1] + share * (self.value[after] - self.value[after - 1])
    }

    /// The first sample after a time, s.
    pub fn next_after(&self, time: f64) -> Option<f64> {
        self.time.iter().copied().find(|&t| t > time)
    }

    fn validate(&self, name: &'static str) -> Result<(), SolverError> {
        let (found, expected) = (self.value.len(), self.time.len());
        if found != expected || found == 0 {
            return Err(SolverError::Shape { name, found, expected: expected.max(1) });
        }
        if let Some(pair) = self.time.windows(2).find(|pair| !(pair[1] > pair[0])) {
            return Err(SolverError::InvalidInput {
                name,
                value: pair[1],
                expected: "later than the sample before",
            });
        }
        match self.time.iter().chain(&self.value).find(|value| !value.is_finite()) {
            Some(&value) => Err(SolverError::InvalidInput { name, value, expected: "finite" }),
            None => Ok(()),
        }
    }
}

/// What happens on a stretch of edge. Edges without a condition are impermeable.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum HydraulicCondition {
    /// Total head, m.
    Head(Series),
    /// Pore pressure, kPa.
    Pressure(Series),
    /// Inflow per area of the edge, m/s; negative flows out.
    Flux(Series),
    /// Rain per horizontal area, m/s: water that does not infiltrate runs off.
    Rain(Series),
    /// Level of open water, m: its head below the level, a seepage face above.
    Reservoir(Series),
    /// Open to the air: water may leave at zero pressure, none comes in.
    SeepageFace,
    /// A line inside the section at which water leaves at zero pressure.
    Drain,
}

impl HydraulicCondition {
    fn series(&self) -> Option<(&'static str, &Series)> {
        match self {
            Self::Head(series) => Some(("head", series)),
            Self::Pressure(series) => Some(("pressure", series)),
            Self::Flux(series) => Some(("flux", series)),
            Self::Rain(series) => Some(("rain", series)),
            Self::Reservoir(series) => Some(("reservoir", series)),
            Self::SeepageFace | Self::Drain => None,
        }
    }

    /// Refuses a series that is none.
    ///
    /// # Errors
    /// Times that do not rise, or values that are not finite.
    pub fn validate(&self) -> Result<(), SolverError> {
        self.series().map_or(Ok(()), |(name, series)| series.validate(name))
    }

    /// The next moment after `time` at which the condition has a corner, s.
    pub fn next_after(&self, time: f64) -> Option<f64> {
        self.series().and_then(|(_, series)| series.next_after(time))
    }

    /// What is prescribed at a time; zero where nothing is.
    pub fn value(&self, time: f64) -> f64 {
        self.series().map_or(0.0, |(_, series)| series.at(time))
    }

    /// All values that are prescribed at some time; none where nothing is.
    pub fn values(&self) -> &[f64] {
        self.series().map_or(&[], |(_, series)| &series.value)
    }

    /// Whether the prescribed value is constant in time.
    pub fn is_constant(&self) -> bool {
        self.series().is_none_or(|(_, series)| series.value.len() == 1)
    }

    /// What the condition asks of a place where it prescribes `value`; `unit_weight` of water in kN/m3, `slope` the
    /// horizontal share of its length.
    pub fn demand(&self, value: f64, elevation: f64, slope: f64, unit_weight: f64) -> Demand {
        let held = |head: f64| Demand { inflow: f64::INFINITY, head };
        let open = |inflow: f64| Demand { inflow, head: elevation };
        match self {
            Self::Head(_) => held(value),
            Self::Pressure(_) => held(elevation + value / unit_weight),
            Self::Flux(_) => Demand { inflow: value, head: f64::INFINITY },
            Self::Rain(_) => open(value * slope),
            Self::Reservoir(_) if elevation < value => held(value),
            Self::Reservoir(_) | Self::SeepageFace | Self::Drain => open(0.0),
        }
    }

    /// Whether the line lies inside the section.
    pub fn is_inside(&self) -> bool {
        *self == Self::Drain
    }
}

/// What a place on an edge takes: an inflow, or less where more would raise its head above a limit.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Demand {
    /// Most that flows in, m/s; infinite where the head alone is prescribed.
    pub inflow: f64,
    /// Highest total head on the edge, m; infinite where the inflow alone is prescribed.
    pub head: f64,
}

/// A condition and the line on which it holds.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct HydraulicBoundary {
    /// Points of the line, m.
    pub line: Vec<Vec2>,
    /// The condition.
    pub condition: HydraulicCondition,
}

/// The stretch of a boundary that belongs to one node.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Cell {
    /// Index of the boundary.
    pub boundary: usize,
    /// The node beside it.
    pub node: u32,
    /// Length, m.
    pub length: f64,
    /// Horizontal length over length.
    pub slope: f64,
    /// Its middle, m.
    pub middle: Vec2,
}

impl Cell {
    /// Inflow of a drain's cell per metre of head, m/s, in soil of so much conductivity (m/s): water comes to it from both
    /// of its sides, over half a spacing.
    pub fn drain_conductance(&self, conductivity: f64, spacing: f64) -> f64 {
        4.0 * conductivity * self.length / spacing
    }
}

/// Boundaries cut into cells, and which of them each pair across an edge belongs to.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct Cells {
    /// The cells.
    pub all: Vec<Cell>,
    /// Cells that each pair beyond an edge is seen across; none where the edge is impermeable.
    pub of_pair: Vec<[Option<u32>; 2]>,
    /// Pieces of the boundaries, to find the cells of images' feet by.
    samples: Vec<Sample>,
    spacing: f64,
}

/// Samples of a boundary line per spacing.
const SAMPLES: f64 = 8.0;
/// Distance from a line within which nodes and the feet of images belong to it, in spacings.
const REACH: f64 = 1.5;
/// Distance of an image's foot from the line on which it lies, in spacings: the ground between two columns is straight for
/// images, its line may have a corner there.
const ON_THE_LINE: f64 = 0.75;
/// Distance past the end of a line up to which a foot is still on it, in spacings: the same rounding along the line.
const PAST_THE_END: f64 = 0.1;
/// Cosine of the angle between a line and an edge's normal up to which they are the same edge: 45 degrees from parallel.
const LARGEST_COSINE: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// A short piece of a boundary line.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Sample {
    at: Vec2,
    direction: Vec2,
    /// Half its length, m.
    half: f64,
    cell: u32,
}

impl Cells {
    /// Cuts the boundaries along the nodes at `position`.
    ///
    /// # Errors
    /// A condition that is no series, a line without length, or one that no node is near.
    pub fn new(
        model: &Model,
        position: &[Vec2],
        boundaries: &[HydraulicBoundary],
        beyond: &[Beyond],
    ) -> Result<Self, SolverError> {
        let spacing = model.spacing.x.max(model.spacing.y);
        let bins = Bins::new(position, REACH * spacing);
        let mut cells: Vec<Cell> = Vec::new();
        // Samples to find those of the images' feet.
        let mut samples: Vec<Sample> = Vec::new();
        for (boundary, HydraulicBoundary { line, condition }) in boundaries.iter().enumerate() {
            condition.validate()?;
            let first = cells.len();
            for pair in line.windows(2) {
                let along = pair[1] - pair[0];
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                // a positive count far below 2^63
                let count = (along.norm() / spacing * SAMPLES).ceil() as usize;
                for k in 0..count {
                    let at = pair[0] + along * ((k as f64 + 0.5) / count as f64);
                    let Some(node) = bins.nearest(position, at, |_| true) else { continue };
                    let length = along.norm() / count as f64;
                    let found = cells[first..].iter().position(|cell| cell.node == id(node));
                    let place = first + found.unwrap_or(cells.len() - first);
                    if found.is_none() {
                        cells.push(Cell {
                            boundary,
                            node: id(node),
                            length: 0.0,
                            slope: 0.0,
                            middle: Vec2::zeros(),
                        });
                    }
                    let cell = &mut cells[place];
                    cell.length += length;
                    cell.slope += along.x.abs() / count as f64;
                    cell.middle += at * length;
                    if !condition.is_inside() {
                        samples.push(Sample {
                            at,
                            direction: along.normalize(),
                            half: 0.5 * length,
                            cell: id(place),
                        });
                    }
                }
            }
            if cells.len() == first {
                let (name, value) = ("hydraulic boundary", boundary as f64);
                return Err(SolverError::InvalidInput {
                    name,
                    value,
                    expected: "a line with nodes beside it",
                });
            }
        }
        for cell in &mut cells {
            cell.slope /= cell.length;
            cell.middle /= cell.length;
        }
        let mut all = Self { all: cells, of_pair: Vec::new(), samples, spacing };
        all.assign(beyond, |_| Vec2::zeros());
        Ok(all)
    }

    /// Finds the cell of every pair beyond an edge, on boundaries that have gone with the ground: each piece of them by the
    /// displacement of the node beside it, m.
    pub fn assign(&mut self, beyond: &[Beyond], displacement: impl Fn(u32) -> Vec2) {
        let spacing = self.spacing;
        let place = |sample: &Sample| sample.at + displacement(self.all[sample.cell as usize].node);
        let places: Vec<Vec2> = self.samples.iter().map(place).collect();
        let bins = Bins::new(&places, ON_THE_LINE * spacing);
        let cell_of = |crossing: Option<Crossing>| {
            let Crossing { foot, normal } = crossing?;
            let belongs = |sample: usize| {
                let Sample { direction, half, .. } = self.samples[sample];
                // The end of a line does not belong to the edge that meets it in a corner, nor to the rest of its own edge.
                direction.dot(&normal).abs() < LARGEST_COSINE
                    && (foot - places[sample]).dot(&direction).abs() < half + PAST_THE_END * spacing
            };
            bins.nearest(&places, foot, belongs).map(|sample| self.samples[sample].cell)
        };
        self.of_pair = beyond.iter().map(|pair| pair.crossings.map(cell_of)).collect();
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.all.as_slice())
            + size_of_val(self.of_pair.as_slice())
            + size_of_val(self.samples.as_slice())
    }
}
