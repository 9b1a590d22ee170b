//! The edges of a section that are not its ground surface, and the images that continue the soil beyond them
//! (Section 4.1).
//!
//! Every node near an edge has an image on the other side, at the mirror point across the nearest point of the edge:
//! what the paper calls a boundary particle, with the node itself as its virtual node. Values need no interpolation,
//! on slopes and curves neither, and the force on an image goes back to its node by the transpose of the map.

use crate::{
    error::SolverError,
    model::{Model, Operators},
};
use sandboil_sph::{Mat2, Source, Vec2};
use std::collections::BTreeMap;

/// What an edge is in statics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Support {
    /// Rough: nothing moves on it.
    NoSlip,
    /// Smooth: nothing crosses it. A roller.
    FreeSlip,
}

impl Support {
    fn condition(self) -> Condition {
        match self {
            Self::NoSlip => Condition::NoSlip,
            Self::FreeSlip => Condition::FreeSlip,
        }
    }
}

/// A vertical side.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Side {
    /// Where it stands, m.
    pub x: f64,
    /// Its lower and upper end, m.
    pub extent: [f64; 2],
    /// What it is in statics, and as long as it is a wall.
    pub support: Support,
}

/// Which of the two sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Hand {
    /// Low x.
    Left,
    /// High x.
    Right,
}

impl Hand {
    /// Both, in the order of every pair of sides.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// In the user's words.
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
    /// Lower boundary from left to right, m; empty: none, the section floats.
    pub base: Vec<Vec2>,
    /// What the base is in statics.
    pub base_support: Support,
    /// Left and right side; none where the section is periodic or ends freely.
    pub sides: [Option<Side>; 2],
}

impl Outline {
    /// A level base on which soil stands without sides.
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

    /// Refuses what is no outline.
    ///
    /// # Errors
    /// A base that does not run from left to right, sides without height, or that are no numbers.
    pub fn validate(&self) -> Result<(), SolverError> {
        if self.base.len() == 1 {
            let (name, value) = ("base", 1.0);
            return Err(SolverError::InvalidInput { name, value, expected: "at least two points" });
        }
        for pair in self.base.windows(2) {
            if !(pair[1].x > pair[0].x) || !pair.iter().all(|point| point.y.is_finite()) {
                let (name, value) = ("base", pair[1].x);
                let expected = "finite points in the order of rising x";
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

    /// Elevation of the base at `x`, m; its end segments go on beyond its ends.
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

/// The nearest point of a line that runs from left to right and goes on beyond its ends, and the normal there on its
/// right-hand side.
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

/// Outward normal of a stretch of base.
fn normal(along: Vec2) -> Vec2 {
    Vec2::new(along.y, -along.x).normalize()
}

/// What an edge does to the soil in a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Condition {
    /// Held at zero velocity: images move against.
    NoSlip,
    /// Held in its normal direction: images move as in a mirror.
    FreeSlip,
    /// Held vertically; the horizontal motion is left to tractions.
    VerticalRoller,
    /// Left to tractions altogether.
    Traction,
}

impl Condition {
    /// Which components of the edge's own motion it leaves free.
    pub fn lets_go(self) -> [bool; 2] {
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
    /// Every edge as its support says: the static stage.
    pub fn statics(outline: &Outline) -> Self {
        let side = |side: Option<Side>| side.map_or(Condition::NoSlip, |side| side.support.condition());
        Self { base: outline.base_support.condition(), sides: outline.sides.map(side) }
    }

    /// The base let go, and those sides that become free-field sides.
    pub fn shaken(outline: &Outline, base: Condition, free_field: [bool; 2]) -> Self {
        let statics = Self::statics(outline).sides;
        let sides = [0, 1].map(|k| if free_field[k] { Condition::Traction } else { statics[k] });
        Self { base, sides }
    }
}

/// What an image shows of its node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Image {
    /// Velocity of the image from that of its node.
    pub map: Mat2,
    /// Which components of the velocity enter strain.
    pub strain: [bool; 2],
    /// Which components enter the divergence that moves water. A component along an edge that is left to tractions
    /// goes on beyond it, so that the row stays complete; one across it must not.
    pub flow: [bool; 2],
    /// Whether the image lies beyond the base.
    pub below: bool,
}

impl Image {
    /// Shows its node as it is.
    pub(crate) const WHOLE: Self =
        Self { map: Mat2::new(1.0, 0.0, 0.0, 1.0), strain: [true; 2], flow: [true; 2], below: false };

    fn new(condition: Condition, normal: Vec2, below: bool) -> Self {
        let mirror = Mat2::identity() - normal * normal.transpose() * 2.0;
        let (map, strain, flow) = match condition {
            Condition::NoSlip => (-Mat2::identity(), [true, true], [true, true]),
            Condition::FreeSlip => (mirror, [true, true], [true, true]),
            Condition::VerticalRoller => {
                (Mat2::from_diagonal(&Vec2::new(1.0, -1.0)), [false, true], [true, true])
            }
            Condition::Traction => {
                (Mat2::identity(), [false, false], if below { [true, false] } else { [false, true] })
            }
        };
        Self { map, strain, flow, below }
    }

    /// The image of an image: beyond a corner.
    fn seen_in(self, other: Self) -> Self {
        let both = |a: [bool; 2], b: [bool; 2]| [a[0] && b[0], a[1] && b[1]];
        Self {
            map: other.map * self.map,
            strain: both(self.strain, other.strain),
            flow: both(self.flow, other.flow),
            below: true,
        }
    }
}

/// Where an image is seen across an edge.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Crossing {
    /// Point of the edge, m.
    pub foot: Vec2,
    /// Normal of the edge there.
    pub normal: Vec2,
}

/// Real nodes followed by their images.
#[derive(Debug, Clone)]
pub struct Surroundings {
    /// Nodes, then images.
    pub sources: Vec<Source>,
    /// What the images show, in the order of their sources.
    pub images: Vec<Image>,
    /// The edge that an image is seen across, two beyond a corner; in the order of the images.
    pub crossings: Vec<[Option<Crossing>; 2]>,
}

impl Surroundings {
    /// Nodes alone.
    pub fn bare(position: &[Vec2]) -> Self {
        let real = |(i, &position): (usize, &Vec2)| Source { owner: id(i), position, mirrored: false };
        Self {
            sources: position.iter().enumerate().map(real).collect(),
            images: Vec::new(),
            crossings: Vec::new(),
        }
    }

    /// Nodes and all images of those within `reach` of an edge, m.
    pub fn new(position: &[Vec2], outline: &Outline, walls: Walls, reach: f64) -> Self {
        let mut all = Self::bare(position);
        // Images beyond the base, to be seen once more in the sides.
        let mut below = vec![None; position.len()];
        for (i, &at) in position.iter().enumerate() {
            if let Some((foot, outward)) = outline.nearest_on_base(at)
                && (foot - at).dot(&outward) < reach
            {
                let image = Image::new(walls.base, outward, true);
                let crossing = Crossing { foot, normal: outward };
                below[i] = Some((2.0 * foot - at, image, crossing));
                all.add(id(i), 2.0 * foot - at, image, [Some(crossing), None]);
            }
        }
        for ((hand, side), condition) in Hand::BOTH.into_iter().zip(outline.sides).zip(walls.sides) {
            let Some(side) = side else { continue };
            let across = |at: Vec2| Vec2::new(2.0 * side.x - at.x, at.y);
            let mirror = Image::new(condition, hand.normal(), false);
            for (i, &at) in position.iter().enumerate() {
                let [bottom, top] = side.extent;
                if (Vec2::new(side.x, at.y) - at).dot(&hand.normal()) < reach
                    && (bottom..=top).contains(&at.y)
                {
                    let crossing = Crossing { foot: Vec2::new(side.x, at.y), normal: hand.normal() };
                    all.add(id(i), across(at), mirror, [Some(crossing), None]);
                    if let Some((place, image, base)) = below[i] {
                        let crossings = [Some(base), Some(crossing)];
                        all.add(id(i), across(place), image.seen_in(mirror), crossings);
                    }
                }
            }
        }
        all
    }

    pub(crate) fn add(&mut self, owner: u32, position: Vec2, image: Image, crossings: [Option<Crossing>; 2]) {
        self.crossings.push(crossings);
        self.sources.push(Source { owner, position, mirrored: true });
        self.images.push(image);
    }

    /// What the source shows of its node; none for the node itself.
    pub fn image(&self, source: u32) -> Option<&Image> {
        (source as usize).checked_sub(self.sources.len() - self.images.len()).map(|k| &self.images[k])
    }

    /// Owners of all sources: the lists of another moment serve while these are the same.
    pub fn owners(&self) -> impl Iterator<Item = u32> {
        self.sources.iter().map(|source| source.owner)
    }
}

#[allow(clippy::cast_possible_truncation)] // node counts stay far below 2^32
pub(crate) fn id(index: usize) -> u32 {
    index as u32
}

/// Height over the base up to which the lowest node of a column stands on it, in spacings: the one below it may have been
/// left out for being almost on an inclined base.
const FARTHEST_FROM_BASE: f64 = 2.0;

/// The nodes along the edges, from which tractions are read and on which they act.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct EdgeNodes {
    /// The lowest node of every column of the lattice, from left to right.
    pub base: Vec<usize>,
    /// The outermost node of every row along each side, from below.
    pub sides: [Vec<usize>; 2],
}

impl EdgeNodes {
    /// Finds them on the undeformed lattice.
    pub fn new(model: &Model) -> Self {
        let (spacing, outline) = (model.spacing, &model.outline);
        let first = model.position.iter().fold(Vec2::repeat(f64::INFINITY), |low, x| low.inf(x));
        let place = |x: f64| {
            #[allow(clippy::cast_possible_truncation)] // far fewer cells than 2^63
            let cell = ((x - first.x) / spacing.x).round() as i64;
            cell
        };
        let mut columns: BTreeMap<i64, usize> = BTreeMap::new();
        let mut sides: [Vec<usize>; 2] = Default::default();
        for (node, at) in model.position.iter().enumerate() {
            let column = columns.entry(place(at.x)).or_insert(node);
            if at.y < model.position[*column].y {
                *column = node;
            }
            for (nodes, side) in sides.iter_mut().zip(outline.sides) {
                let Some(side) = side else { continue };
                // The outermost column alone: the next one stands a spacing and a half away.
                let near = (at.x - side.x).abs() < spacing.x;
                if near && (side.extent[0]..=side.extent[1]).contains(&at.y) {
                    nodes.push(node);
                }
            }
        }
        let near_base = |node: &usize| {
            let at = model.position[*node];
            at.y - outline.base_elevation(at.x) < FARTHEST_FROM_BASE * spacing.y
        };
        let base = columns.into_values().filter(near_base).collect();
        for nodes in &mut sides {
            nodes.sort_by(|&a, &b| model.position[a].y.total_cmp(&model.position[b].y));
        }
        Self { base, sides }
    }

    /// Points of the base below its nodes, m.
    pub fn base_points(&self, model: &Model, position: &[Vec2]) -> Vec<Vec2> {
        let below =
            |&node: &usize| Vec2::new(position[node].x, model.outline.base_elevation(position[node].x));
        self.base.iter().map(below).collect()
    }
}

/// The compliant base of a set of operators, held vertically or not.
pub fn base_condition(operators: Operators, absorbs_vertically: bool) -> Condition {
    match (operators, absorbs_vertically) {
        (_, true) => Condition::Traction,
        (Operators::Conservative, false) => Condition::VerticalRoller,
        // Free slip, with the odd shear stress of the images (Section 4.2).
        (Operators::Printed, false) => Condition::FreeSlip,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skeleton::tests::square_block;

    /// Above a base that is not level the lowest nodes stand up to a quarter of a row off the lattice.
    #[test]
    fn no_row_along_a_side_is_lost_above_an_uneven_base() {
        const SIDE: usize = 5;
        let mut model = square_block(SIDE);
        for (x, shift) in model.position[..SIDE].iter_mut().zip([0.25, -0.25, 0.1, 0.0, -0.2]) {
            x.y += shift;
        }
        let side = |x: f64| Some(Side { x, extent: [-1.0, 9.0], support: Support::FreeSlip });
        model.outline.sides = [side(-0.5), side(SIDE as f64 - 0.5)];
        let edges = EdgeNodes::new(&model);
        let column = |first: usize| (0..SIDE).map(|row| first + SIDE * row).collect::<Vec<_>>();
        assert_eq!(edges.sides, [column(0), column(SIDE - 1)]);
    }
}
