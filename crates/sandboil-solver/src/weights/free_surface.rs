//! The free surface, found from the nodes alone: no line is tracked in a run-out.

use crate::{
    parallel::{Rows, chunks, for_each_chunk},
    section::{description::Model, outline::EdgesView},
    weights::{images::Surroundings, stencils::Stencils},
};
use sandboil_sph::{NeighbourList, Vec2, WendlandQuintic};

/// Divergence of the position, `sum V_j x_ji . grad W_ij`, below which a node is at a free surface. It is 2
/// inside, 1.25 in the uppermost row and 1.85 in the second; with disordered nodes 0.86 to 1.54 and 1.43 to
/// 1.91.
const SURFACE: f64 = 1.5;
/// Range of the divergence that does not decide: there a node is at the surface if no node is in front of it.
const UNDECIDED: std::ops::Range<f64> = 1.4..1.6;
/// Cosine of the half angle of the cone that must be empty in front of a surface node.
const CONE: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// The outward normal of every node at a free surface; `None` inside.
pub fn free_surface(
    threaded: bool,
    model: &Model,
    position: &[Vec2],
    volume: &[f64],
    edges: EdgesView,
) -> Vec<Option<Vec2>> {
    let kernel = WendlandQuintic::new(model.smoothing_length());
    // At a base or a wall images continue the ground: it has no free surface there.
    let around = Surroundings::new(position, edges.outline, edges.walls, kernel.support());
    let list = NeighbourList::build(position, &around.sources, kernel.support(), 0.0, model.period);
    let stencils = Stencils { around: &around, volume, kernel, period: model.period };
    let mut normals = vec![None; position.len()];
    let mut unit = [vec![(); position.len()], vec![(); position.len()]];
    let [b, c] = &mut unit;
    let rows = Rows { a: &mut normals, b, c };
    for_each_chunk(threaded, rows, &mut vec![(); chunks(position.len())], |first, rows, ()| {
        for (k, normal) in rows.a.iter_mut().enumerate() {
            let members = stencils.all(&list, first + k, position[first + k]);
            let (mut divergence, mut slope) = (0.0, Vec2::zeros());
            for member in &members {
                let gradient = kernel.gradient(member.offset) * member.volume;
                divergence += gradient.dot(&member.offset);
                slope += gradient;
            }
            let outward = (-slope).try_normalize(0.0).unwrap_or_else(|| Vec2::new(0.0, 1.0));
            let is_in_front = |offset: Vec2| {
                let distance = offset.norm();
                distance > 0.0 && offset.dot(&outward) > CONE * distance
            };
            let is_surface = if UNDECIDED.contains(&divergence) {
                !members.iter().any(|member| is_in_front(member.offset))
            } else {
                divergence < SURFACE
            };
            *normal = is_surface.then_some(outward);
        }
    });
    normals
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{section::outline::Outline, testing::square_block};

    /// Ground with a slope on a base: the nodes within a spacing of the slope and the crest are found, and no
    /// other nodes.
    #[test]
    fn only_the_outer_layer_is_a_free_surface() {
        const SIDE: usize = 30;
        for slope in [0.0, 0.25, 0.4, 1.0] {
            let mut model = square_block(SIDE);
            model.outline = Outline::level(-0.5);
            let middle = 0.5 * (SIDE as f64 - 1.0);
            let depth = |at: &Vec2| (middle + slope * (at.x - middle) - at.y) / f64::hypot(1.0, slope);
            model.position.retain(|at| depth(at) > 0.0);
            let volume = vec![1.0; model.position.len()];
            let edges = EdgesView::statics(&model.outline);
            let found = free_surface(false, &model, &model.position, &volume, edges);
            let mut errors = 0;
            for (at, normal) in model.position.iter().zip(&found) {
                // The stencils at both ends of the block are cut: the ends are free too.
                if (3.0..SIDE as f64 - 4.0).contains(&at.x) {
                    let is_outer = depth(at) < 1.0;
                    errors += usize::from(is_outer != normal.is_some());
                    if let Some(normal) = normal {
                        let exact = Vec2::new(-slope, 1.0).normalize();
                        assert!(normal.dot(&exact) > 0.95, "{slope} {at} {normal}");
                    }
                }
            }
            println!("slope {slope}: {errors} of {} nodes", found.len());
            assert_eq!(errors, 0, "{slope}");
        }
    }
}
