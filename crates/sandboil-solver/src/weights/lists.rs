//! Neighbour lists with a skin: they are valid until a node has moved by half of it.

use crate::{section::description::Model, weights::images::Surroundings};
use sandboil_sph::{NeighbourList, Vec2};

/// Skin of the neighbour lists over the particle spacing: the lists stay valid for displacements of half of
/// it.
const SKIN: f64 = 0.3;

/// Skin of a section's lists, m.
pub fn skin(model: &Model) -> f64 {
    SKIN * model.mean_spacing()
}

/// Neighbours of the stress nodes and of the velocity nodes.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Lists {
    /// Positions of the nodes when the lists were built, m.
    reference: Vec<Vec2>,
    /// Owners of the sources when the lists were built: a node that moves towards an edge gets an image
    /// later.
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

    /// Whether the lists are still valid: no node has left the skin, and the sources have the same owners.
    pub fn are_valid(&self, model: &Model, around: &Surroundings, position: &[Vec2]) -> bool {
        !self.is_skin_left(model, position) && self.owners.iter().copied().eq(around.owners())
    }

    /// Whether a node has left the skin.
    pub fn is_skin_left(&self, model: &Model, position: &[Vec2]) -> bool {
        let bound = 0.5 * skin(model);
        position.iter().zip(&self.reference).any(|(now, then)| (now - then).norm() > bound)
    }

    /// Nodes listed near node `i`, itself included, and the number of periods by which each is shifted to the
    /// right; without images.
    pub fn nodes_near(&self, i: usize) -> impl Iterator<Item = (usize, f64)> {
        let nodes = self.reference.len();
        let near = self.from_velocity.of(i).iter();
        near.map(|pair| (pair.source as usize, f64::from(pair.wraps))).filter(move |(j, _)| *j < nodes)
    }
}
