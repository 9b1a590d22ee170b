//! The nodes along the edges of a section.

use crate::section::description::Model;
use sandboil_sph::Vec2;
use std::collections::BTreeMap;

/// Largest height over the base, in spacings, at which a column's lowest node is a base node. Nodes that are
/// nearer to an inclined base may have been left out.
pub const FARTHEST_FROM_BASE: f64 = 2.0;
/// The nodes along the edges: tractions are read from them and act on them.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct EdgeNodes {
    /// The lowest node of every column of the lattice, from left to right.
    pub base: Vec<usize>,
    /// The outermost node of every row along each side, from below.
    pub sides: [Vec<usize>; 2],
}

impl EdgeNodes {
    /// Finds the nodes on the undeformed lattice.
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
                // Only the outermost column: the next one is a spacing and a half away.
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

    /// Points of the base below the base nodes, m.
    pub fn base_points(&self, model: &Model, position: &[Vec2]) -> Vec<Vec2> {
        let below =
            |&node: &usize| Vec2::new(position[node].x, model.outline.base_elevation(position[node].x));
        self.base.iter().map(below).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        section::outline::{Side, Support},
        testing::square_block,
    };

    /// Above an uneven base the lowest nodes may be a quarter of a row off the lattice.
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
