//! Images of nodes beyond base and sides.

use crate::section::{
    node_id::id,
    outline::{Condition, Hand, Outline, Walls},
};
use sandboil_sph::{Mat2, Source, Vec2};

/// How an image depends on its node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Image {
    /// Map from the velocity of the node to that of the image.
    pub map: Mat2,
    /// Which components of the velocity enter strain.
    pub strain: [bool; 2],
    /// Which components enter the divergence that changes the pore pressure. At an edge under tractions the
    /// component along the edge is continued beyond it, so that the row stays complete; the component across
    /// it must not be.
    pub flow: [bool; 2],
    /// Whether the image lies beyond the base.
    pub below: bool,
}

impl Image {
    /// Moves as its node.
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

    /// The image of this image across the edge of `other`: beyond a corner.
    fn mirrored_by(self, other: Self) -> Self {
        let both = |a: [bool; 2], b: [bool; 2]| [a[0] && b[0], a[1] && b[1]];
        Self {
            map: other.map * self.map,
            strain: both(self.strain, other.strain),
            flow: both(self.flow, other.flow),
            below: true,
        }
    }
}

/// Where the line from a node to its image crosses an edge.
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
    /// The images, in the order of their sources.
    pub images: Vec<Image>,
    /// The edge between each image and its node, two beyond a corner; in the order of the images.
    pub crossings: Vec<[Option<Crossing>; 2]>,
}

impl Surroundings {
    /// Nodes without images.
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
        // Images beyond the base: the sides mirror them again.
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
                        all.add(id(i), across(place), image.mirrored_by(mirror), crossings);
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

    /// The image at a source; `None` for a node.
    pub fn image(&self, source: u32) -> Option<&Image> {
        (source as usize).checked_sub(self.sources.len() - self.images.len()).map(|k| &self.images[k])
    }

    /// Whether a source is an image beyond a corner of two edges.
    pub fn is_beyond_corner(&self, source: u32) -> bool {
        let image = (source as usize).checked_sub(self.sources.len() - self.images.len());
        image.is_some_and(|k| self.crossings[k][1].is_some())
    }

    /// Owners of all sources: neighbour lists are valid only for the same owners.
    pub fn owners(&self) -> impl Iterator<Item = u32> {
        self.sources.iter().map(|source| source.owner)
    }
}
