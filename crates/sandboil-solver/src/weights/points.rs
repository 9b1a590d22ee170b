//! Weights of arbitrary points and of stress nodes from the nodes around them.

use crate::{
    section::{
        description::{Model, stress_node_offset},
        node_id::id,
        outline::EdgesView,
        stress_layout::StressLayout,
    },
    weights::{images::Surroundings, stencils::Stencils},
};
use sandboil_sph::{Csr, LeastSquaresFit, NeighbourList, Vec2, WendlandQuintic, operators::consistent_fit};

/// Positions of all stress nodes of the given velocity nodes (offsets do not rotate), m.
pub fn stress_node_positions(position: &[Vec2], spacing: Vec2) -> Vec<Vec2> {
    let offset = stress_node_offset(spacing);
    position.iter().flat_map(|&x| [x + offset, x - offset]).collect()
}

/// Gradient of Eq. 9 of a nodal field at the velocity nodes, unit of the field per m.
pub fn consistent_gradient(model: &Model, position: &[Vec2], volume: &[f64], field: &[f64]) -> Vec<Vec2> {
    let kernel = WendlandQuintic::new(model.smoothing_length());
    let around = Surroundings::bare(position);
    let list = NeighbourList::build(position, &around.sources, kernel.support(), 0.0, model.period);
    let stencils = Stencils { around: &around, volume, kernel, period: model.period };
    position
        .iter()
        .enumerate()
        .map(|(i, &at)| {
            let members = stencils.all(&list, i, at);
            let fit = consistent_fit(&members, kernel).unwrap_or_default();
            members.iter().zip(fit).map(|(m, (_, gradient))| gradient * field[m.owner as usize]).sum()
        })
        .collect()
}

/// Linear least-squares weights of arbitrary points from nodes at `position`: rows are points.
pub fn point_weights(model: &Model, position: &[Vec2], points: &[Vec2]) -> Csr<f64> {
    let kernel = WendlandQuintic::new(model.smoothing_length());
    let volume = vec![0.0; position.len()];
    let around = Surroundings::bare(position);
    let list = NeighbourList::build(points, &around.sources, kernel.support(), 0.0, model.period);
    let stencils = Stencils { around: &around, volume: &volume, kernel, period: model.period };
    let mut table = Csr::with_capacity(points.len(), list.pairs());
    for (k, &at) in points.iter().enumerate() {
        let members = stencils.all(&list, k, at);
        let mut row: Vec<_> = match LeastSquaresFit::new(&members, kernel) {
            Ok(fit) => members.iter().enumerate().map(|(k, m)| (m.owner, fit.value_weight(k, m))).collect(),
            // Too few nodes for a fit: use the nearest.
            Err(_) => nearest_node(position, at).into_iter().collect(),
        };
        table.push_row(&mut row);
    }
    table
}

/// Value of the linear fit at every stress node, as weights of the nodes that sum to one. Images continue the
/// ground beyond a held edge: their weights are added to those of their nodes.
pub fn stress_node_values(
    model: &Model,
    layout: &StressLayout,
    position: &[Vec2],
    edges: EdgesView,
) -> Csr<f64> {
    let kernel = WendlandQuintic::new(model.smoothing_length());
    let points = layout.positions(position, model.spacing);
    let around = Surroundings::new(position, edges.outline, edges.walls, kernel.support());
    let list = NeighbourList::build(&points, &around.sources, kernel.support(), 0.0, model.period);
    let volume = vec![0.0; position.len()];
    let stencils = Stencils { around: &around, volume: &volume, kernel, period: model.period };
    let mut table = Csr::with_capacity(points.len(), list.pairs());
    for (s, &at) in points.iter().enumerate() {
        let members =
            stencils.including(&stencils.all(&list, s, at), |image| image.strain[0] && image.strain[1]);
        let mut row: Vec<_> = match LeastSquaresFit::new(&members, kernel) {
            Ok(fit) => members.iter().enumerate().map(|(k, m)| (m.owner, fit.value_weight(k, m))).collect(),
            // A detached node keeps its mass.
            Err(_) => vec![(id(layout.node(s)), 1.0)],
        };
        table.push_row(&mut row);
    }
    table
}

/// The node nearest to a point, with the weight one; `None` without nodes.
fn nearest_node(position: &[Vec2], at: Vec2) -> Option<(u32, f64)> {
    let distance = |x: &Vec2| (x - at).norm_squared();
    position
        .iter()
        .enumerate()
        .min_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)))
        .map(|(i, _)| (id(i), 1.0))
}
