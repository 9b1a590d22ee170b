//! Where the soil is computed: the stress points, and the nodes of which they are part.

use crate::{
    error::SolverError,
    section::{
        description::{Model, Operators, STRESS_NODES, stress_node_offset},
        dual_lattice::DualLattice,
        outline::Hand,
    },
};
use sandboil_sph::Vec2;
use std::borrow::Cow;

/// Stress points of a section.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub enum StressLayout {
    /// Two stress nodes of each node on its diagonal (Section 3, Fig. 1): `2 i` and `2 i + 1` belong to node `i`.
    Diagonal,
    /// Points at the corners of the nodes' cells.
    Dual(Box<DualLattice>),
}

/// Positions of the stress points of a section at rest, m.
pub fn stress_positions(model: &Model) -> Vec<Vec2> {
    StressLayout::new(model).positions(&model.position, model.spacing).into_owned()
}

/// Refuses a section with another number of stresses than stress points.
///
/// # Errors
/// [`SolverError::Shape`].
pub fn check_stress(model: &Model) -> Result<(), SolverError> {
    let (name, found) = ("vertical_effective_stress", model.vertical_effective_stress.len());
    let expected = StressLayout::new(model).count(model.nodes());
    if found == expected { Ok(()) } else { Err(SolverError::Shape { name, found, expected }) }
}

impl StressLayout {
    /// The stress points of a section at rest.
    pub fn new(model: &Model) -> Self {
        match model.numerics.operators {
            Operators::Dual => Self::Dual(Box::new(DualLattice::new(model))),
            Operators::Conservative | Operators::Printed => Self::Diagonal,
        }
    }

    /// The points at the corners of cells, if the layout has them.
    pub fn dual(&self) -> Option<&DualLattice> {
        match self {
            Self::Diagonal => None,
            Self::Dual(dual) => Some(dual),
        }
    }

    /// Number of stress points in a section of `nodes` nodes.
    pub fn count(&self, nodes: usize) -> usize {
        match self {
            Self::Diagonal => STRESS_NODES * nodes,
            Self::Dual(dual) => dual.node.len(),
        }
    }

    /// A node of the same soil whose cell a stress point touches: reports name it.
    #[inline]
    pub fn node(&self, point: usize) -> usize {
        match self {
            Self::Diagonal => point / STRESS_NODES,
            Self::Dual(dual) => dual.node[point] as usize,
        }
    }

    /// Region of a stress point.
    pub fn region(&self, model: &Model, point: usize) -> usize {
        model.region[self.node(point)] as usize
    }

    /// Present positions of the stress points for nodes at `position`, m.
    pub fn positions<'a>(&'a self, position: &[Vec2], spacing: Vec2) -> Cow<'a, [Vec2]> {
        match self {
            Self::Diagonal => {
                let offset = stress_node_offset(spacing);
                position.iter().flat_map(|&x| [x + offset, x - offset]).collect::<Vec<_>>().into()
            }
            Self::Dual(dual) => dual.position.as_slice().into(),
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.dual().map_or(0, DualLattice::bytes)
    }

    /// Volume of a stress point in a section whose nodes have the given volumes, m2. That of a corner is the one at rest.
    pub fn volume(&self, point: usize, of_nodes: &[f64]) -> f64 {
        match self {
            Self::Diagonal => of_nodes[point / STRESS_NODES] / STRESS_NODES as f64,
            Self::Dual(dual) => dual.volume[point],
        }
    }

    /// Stress points of a node beside a side, from which a column beyond it continues: its two stress nodes, or the lower
    /// and the upper corner of its cell on that side.
    pub fn beside(&self, node: usize, hand: Hand) -> [usize; STRESS_NODES] {
        match (self, hand) {
            (Self::Diagonal, _) => [STRESS_NODES * node, STRESS_NODES * node + 1],
            (Self::Dual(dual), Hand::Left) => [0, 3].map(|corner| dual.of_node[node][corner] as usize),
            (Self::Dual(dual), Hand::Right) => [1, 2].map(|corner| dual.of_node[node][corner] as usize),
        }
    }

    /// Which of the two points of [`Self::beside`] lies at the height of a point in the cell of its node.
    pub fn level(&self, point: usize) -> usize {
        match self {
            Self::Diagonal => point % STRESS_NODES,
            Self::Dual(dual) => {
                let corners = dual.of_node[dual.node[point] as usize];
                usize::from(corners[..STRESS_NODES].iter().all(|&corner| corner as usize != point))
            }
        }
    }

    /// Stress points of a node, and their shares in its means.
    #[inline]
    pub fn of_node(&self, node: usize) -> impl Iterator<Item = (usize, f64)> {
        let (points, count) = match self {
            Self::Diagonal => {
                let first = STRESS_NODES * node;
                ([first, first + 1, 0, 0], STRESS_NODES)
            }
            Self::Dual(dual) => (dual.of_node[node].map(|point| point as usize), dual.of_node[node].len()),
        };
        let share = 1.0 / count as f64;
        points.into_iter().take(count).map(move |point| (point, share))
    }
}
