//! Neighbour lists with a skin: they serve until a node has moved by half of it.

use crate::{section::description::Model, weights::images::Surroundings};
use sandboil_sph::{NeighbourList, Vec2};

/// Skin of the neighbour lists over the particle spacing: the lists survive displacements of half of it.
const SKIN: f64 = 0.3;

/// Skin of a section's lists, m.
pub fn skin(model: &Model) -> f64 {
    SKIN * model.mean_spacing()
}

/// Neighbours of the stress nodes and of the velocity nodes.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Lists {
    /// Places of the nodes when the lists were built, m.
    reference: Vec<Vec2>,
    /// Owners of the sources: a node may have entered an edge's reach since.
    owners: Vec<u32>,
    /// Nodes and images near every stress node.
    pub from_stress: NeighbourList,
    /// The same near every velocity node.
    pub from_velocity: NeighbourList,
}

impl Lists {
    /// Lists of all sources within `support` (m) of the stress nodes, at `stress_position`, and of the nodes, at `position`
    /// (m).
    pub fn build(
        model: &Model,
        around: &Surroundings,
        support: f64,
        position: &[Vec2],
        stress_position: &[Vec2],
    ) -> Self {
        let list = |queries: &[Vec2]| {
            NeighbourList::build(queries, &around.sources, support, skin(model), model.period)
        };
        Self {
            reference: position.to_vec(),
            owners: around.owners().collect(),
            from_stress: list(stress_position),
            from_velocity: list(position),
        }
    }

    /// Whether the lists still hold: no node has left the skin, and the sources have the same owners.
    pub fn hold(&self, model: &Model, around: &Surroundings, position: &[Vec2]) -> bool {
        !self.are_left(model, position) && self.owners.iter().copied().eq(around.owners())
    }

    /// Whether some node has left the skin.
    pub fn are_left(&self, model: &Model, position: &[Vec2]) -> bool {
        let bound = 0.5 * skin(model);
        position.iter().zip(&self.reference).any(|(now, then)| (now - then).norm() > bound)
    }

    /// Nodes listed near node `i`, itself among them, and how many periods to the right each stands; without images.
    pub fn nodes_near(&self, i: usize) -> impl Iterator<Item = (usize, f64)> {
        let nodes = self.reference.len();
        let near = self.from_velocity.of(i).iter();
        near.map(|pair| (pair.source as usize, f64::from(pair.wraps))).filter(move |(j, _)| *j < nodes)
    }
}
