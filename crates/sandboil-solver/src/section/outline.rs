//! The edges of a section that are not its ground surface, and the images that continue the soil beyond them
//! (Section 4.1).
//!
//! Every node near an edge has an image on the other side, mirrored at the nearest point of the edge. The
//! paper calls the image a boundary particle and the node its virtual node. No values are interpolated, also
//! at slopes and curves. The force on an image is added to its node by the transpose of the map.

use crate::error::SolverError;
use sandboil_sph::Vec2;

/// Support at an edge in the static stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Support {
    /// Rough: held in both directions.
    NoSlip,
    /// Smooth, a roller: held in the normal direction.
    FreeSlip,
}

impl Support {
    /// The condition at the edge.
    pub fn condition(self) -> Condition {
        match self {
            Self::NoSlip => Condition::NoSlip,
            Self::FreeSlip => Condition::FreeSlip,
        }
    }
}

/// A vertical side.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Side {
    /// Position, m.
    pub x: f64,
    /// Lower and upper end, m.
    pub extent: [f64; 2],
    /// Support in statics, and in later stages unless it becomes a free-field side.
    pub support: Support,
}

/// One of the two sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Hand {
    /// Low x.
    Left,
    /// High x.
    Right,
}

impl Hand {
    /// Both sides, in the order of all pairs of sides.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// Name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }

    /// Outward normal.
    pub fn normal(self) -> Vec2 {
        match self {
            Self::Left => Vec2::new(-1.0, 0.0),
            Self::Right => Vec2::new(1.0, 0.0),
        }
    }
}

/// The edges of a section.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Outline {
    /// Lower boundary from left to right, m; empty for a section without a base.
    pub base: Vec<Vec2>,
    /// Support of the base in statics.
    pub base_support: Support,
    /// Left and right side; `None` where the section is periodic or ends at a free surface.
    pub sides: [Option<Side>; 2],
}

impl Outline {
    /// A level base without sides.
    pub fn level(elevation: f64) -> Self {
        Self {
            base: vec![Vec2::new(0.0, elevation), Vec2::new(1.0, elevation)],
            base_support: Support::NoSlip,
            sides: [None, None],
        }
    }

    /// No edge at all.
    pub fn none() -> Self {
        Self { base: Vec::new(), base_support: Support::NoSlip, sides: [None, None] }
    }

    /// Refuses an invalid outline.
    ///
    /// # Errors
    /// A base that does not run from left to right, a side without height, or coordinates that are not
    /// finite.
    pub fn validate(&self) -> Result<(), SolverError> {
        if self.base.len() == 1 {
            let (name, value) = ("base", 1.0);
            return Err(SolverError::InvalidInput { name, value, expected: "at least two points" });
        }
        for pair in self.base.windows(2) {
            if !(pair[1].x > pair[0].x) || !pair.iter().all(|point| point.y.is_finite()) {
                let (name, value) = ("base", pair[1].x);
                let expected = "finite points with increasing x";
                return Err(SolverError::InvalidInput { name, value, expected });
            }
        }
        for side in self.sides.iter().flatten() {
            let [bottom, top] = side.extent;
            if !(top > bottom && side.x.is_finite() && (top - bottom).is_finite()) {
                let (name, value) = ("side", top);
                return Err(SolverError::InvalidInput { name, value, expected: "a side with height" });
            }
        }
        Ok(())
    }

    /// Elevation of the lowest point of the base, m.
    pub fn lowest(&self) -> f64 {
        self.base.iter().map(|point| point.y).fold(f64::INFINITY, f64::min)
    }

    /// Height of the highest point of the base over the lowest, m; zero if there is none.
    pub fn relief(&self) -> f64 {
        (self.base.iter().map(|point| point.y).fold(f64::NEG_INFINITY, f64::max) - self.lowest()).max(0.0)
    }

    /// Elevation of the base at `x`, m; its end segments are extended beyond its ends.
    pub fn base_elevation(&self, x: f64) -> f64 {
        self.base_segment(x).map_or(f64::NEG_INFINITY, |[a, b]| a.y + (b.y - a.y) * (x - a.x) / (b.x - a.x))
    }

    /// Outward normal of the base at `x`.
    pub fn base_normal(&self, x: f64) -> Vec2 {
        self.base_segment(x).map_or(Vec2::new(0.0, -1.0), |[a, b]| normal(b - a))
    }

    fn base_segment(&self, x: f64) -> Option<[Vec2; 2]> {
        let inner = self.base.windows(2).find(|pair| x <= pair[1].x);
        inner.or_else(|| self.base.windows(2).last()).map(|pair| [pair[0], pair[1]])
    }

    /// The nearest point of the base, and the outward normal there.
    pub(crate) fn nearest_on_base(&self, at: Vec2) -> Option<(Vec2, Vec2)> {
        nearest_on(&self.base, at)
    }

    /// The outline moved: base, left and right side each by its own displacement, m.
    #[must_use]
    pub fn moved(&self, base: Vec2, sides: [Vec2; 2]) -> Self {
        let mut moved = self.clone();
        for point in &mut moved.base {
            *point += base;
        }
        for (side, by) in moved.sides.iter_mut().zip(sides) {
            if let Some(side) = side {
                side.x += by.x;
                side.extent = side.extent.map(|end| end + by.y);
            }
        }
        moved
    }
}

/// The nearest point of a line that runs from left to right and is extended beyond its ends, and the normal
/// there on the right-hand side of the line.
pub(crate) fn nearest_on(line: &[Vec2], at: Vec2) -> Option<(Vec2, Vec2)> {
    let last = line.len().checked_sub(2)?;
    let candidate = |(k, pair): (usize, &[Vec2])| {
        let along = pair[1] - pair[0];
        let place = (at - pair[0]).dot(&along) / along.norm_squared();
        // The end segments are rays: the line has no end inside the section's width.
        let low = if k == 0 { f64::NEG_INFINITY } else { 0.0 };
        let high = if k == last { f64::INFINITY } else { 1.0 };
        let foot = pair[0] + along * place.clamp(low, high);
        let outward = if (low..=high).contains(&place) { normal(along) } else { (foot - at).normalize() };
        (foot, outward)
    };
    line.windows(2)
        .enumerate()
        .map(candidate)
        .min_by(|(a, _), (b, _)| (a - at).norm_squared().total_cmp(&(b - at).norm_squared()))
}

/// Outward normal of a base segment, which runs along `along` from left to right.
pub fn normal(along: Vec2) -> Vec2 {
    Vec2::new(along.y, -along.x).normalize()
}

/// Condition at an edge in a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Condition {
    /// Zero velocity: images move in the opposite direction.
    NoSlip,
    /// Zero normal velocity: images move as in a mirror.
    FreeSlip,
    /// Zero vertical velocity; tractions act horizontally.
    VerticalRoller,
    /// Tractions act in both directions.
    Traction,
}

impl Condition {
    /// Components `(x, y)` in which the edge can move.
    pub fn free_components(self) -> [bool; 2] {
        match self {
            Self::NoSlip | Self::FreeSlip => [false, false],
            Self::VerticalRoller => [true, false],
            Self::Traction => [true, true],
        }
    }
}

/// The conditions of all edges in a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Walls {
    /// The base.
    pub base: Condition,
    /// Left and right side.
    pub sides: [Condition; 2],
}

impl Walls {
    /// Every edge on its support, as in the static stage.
    pub fn statics(outline: &Outline) -> Self {
        let side = |side: Option<Side>| side.map_or(Condition::NoSlip, |side| side.support.condition());
        Self { base: outline.base_support.condition(), sides: outline.sides.map(side) }
    }

    /// The edges of a shaking stage: a base with the given condition, free-field sides under tractions.
    pub fn shaken(outline: &Outline, base: Condition, free_field: [bool; 2]) -> Self {
        let statics = Self::statics(outline).sides;
        let sides = [0, 1].map(|k| if free_field[k] { Condition::Traction } else { statics[k] });
        Self { base, sides }
    }
}

/// The edges of a section: where they are, and their conditions.
#[derive(Debug, Clone, Copy)]
pub struct EdgesView<'a> {
    /// Base and sides.
    pub outline: &'a Outline,
    /// Their conditions.
    pub walls: Walls,
}

impl<'a> EdgesView<'a> {
    /// Every edge on its support, as in the static stage.
    pub fn statics(outline: &'a Outline) -> Self {
        Self { outline, walls: Walls::statics(outline) }
    }
}
