//! Corners of cells move with the nodes around them.

use crate::{
    section::{
        dual_lattice::DualLattice,
        outline::{Condition, EdgesView},
    },
    weights::geometry::Geometry,
};
use sandboil_sph::Vec2;

/// Moves the corners with the nodes, which are now at `position` (m), since the geometry was built: by the value at the
/// corner of a linear fit to the displacements. On base and sides they keep the components that are held there.
pub fn move_corners(dual: &mut DualLattice, geometry: &Geometry, position: &[Vec2], edges: EdgesView) {
    let EdgesView { outline, walls } = edges;
    for s in 0..dual.position.len() {
        let at = dual.position[s];
        let moved = |j: usize| position[j] - dual.nodes_at[j];
        let (mut mean, mut share) = (Vec2::zeros(), 0.0);
        for (j, weight) in geometry.gradient.forward.iter_row(s) {
            mean += (dual.nodes_at[j] - at) * weight.share;
            share += weight.share;
        }
        let mut displacement: Vec2 = geometry
            .gradient
            .forward
            .iter_row(s)
            .map(|(j, weight)| moved(j) * (weight.share - weight.gradient.dot(&mean)))
            .sum();
        if share == 0.0 {
            // Without a fit it moves with a node.
            displacement = moved(dual.node[s] as usize);
        }
        if dual.on[s].base {
            let normal = outline.nearest_on_base(at).map_or(Vec2::y(), |(_, normal)| normal);
            displacement = allowed(walls.base, normal, displacement);
        }
        if let Some(hand) = dual.on[s].side {
            displacement = allowed(walls.sides[hand as usize], hand.normal(), displacement);
        }
        dual.position[s] = at + displacement;
    }
    dual.nodes_at.copy_from_slice(position);
}

/// The part of a displacement (m) that the condition of an edge with this normal allows.
fn allowed(condition: Condition, normal: Vec2, displacement: Vec2) -> Vec2 {
    match condition {
        Condition::NoSlip => Vec2::zeros(),
        Condition::FreeSlip => displacement - normal * displacement.dot(&normal),
        Condition::VerticalRoller => Vec2::new(displacement.x, 0.0),
        Condition::Traction => displacement,
    }
}
