//! Corners of cells move with the nodes around them.

use crate::{
    section::{
        dual_lattice::DualLattice,
        outline::{Condition, Walls},
    },
    weights::geometry::Geometry,
};
use sandboil_sph::Vec2;

/// Moves the corners with the nodes, which are now at `position` (m), since the geometry was built: by the value at the
/// corner of a linear fit to the displacements. On base and sides they keep the components that are held there.
pub fn move_corners(dual: &mut DualLattice, geometry: &Geometry, position: &[Vec2], walls: Walls) {
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
            displacement.component_mul_assign(&freedom(walls.base, Vec2::y()));
        }
        if let Some(hand) = dual.on[s].side {
            displacement.component_mul_assign(&freedom(walls.sides[hand as usize], Vec2::x()));
        }
        dual.position[s] = at + displacement;
    }
    dual.nodes_at.copy_from_slice(position);
}

/// One for a component in which the ground moves on an edge across `normal`, else zero.
fn freedom(condition: Condition, normal: Vec2) -> Vec2 {
    match condition {
        Condition::NoSlip => Vec2::zeros(),
        Condition::FreeSlip => Vec2::repeat(1.0) - normal,
        Condition::VerticalRoller => Vec2::x(),
        Condition::Traction => Vec2::repeat(1.0),
    }
}
