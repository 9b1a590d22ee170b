//! Contact of single nodes with edges. A node without neighbours has no strain, and so no stress that would
//! stop it at an edge: it is stopped there.

use crate::edges::dashpots::NodalMotion;
use crate::section::{
    description::Model,
    outline::{Hand, Outline, Side},
};
use sandboil_sph::Vec2;

/// Least distance of a node from an edge, in spacings; that of the lowest row of a layer is 0.5.
pub const LEAST_DISTANCE: f64 = 0.2;
/// Stops nodes that would come too near to an edge in the step. Returns how many were stopped.
pub fn stop_near_edges(
    model: &Model,
    outline: &Outline,
    position: &[Vec2],
    NodalMotion { velocity, acceleration }: NodalMotion,
    dt: f64,
) -> u64 {
    let least = LEAST_DISTANCE * model.mean_spacing();
    let comes_near = |from: Vec2, to: Vec2| {
        let nears_base = outline.nearest_on_base(to).is_some_and(|(foot, _)| {
            let beyond = outline.base_elevation(to.x) > to.y;
            (beyond || (to - foot).norm() < least) && (to - from).dot(&outline.base_normal(to.x)) > 0.0
        });
        let nears_side = |(hand, side): (Hand, &Option<Side>)| {
            side.is_some_and(|side| {
                let out = hand.normal().x;
                (side.extent[0]..=side.extent[1]).contains(&to.y)
                    && out * (side.x - to.x) < least
                    && out * (to.x - from.x) > 0.0
            })
        };
        nears_base || Hand::BOTH.into_iter().zip(&outline.sides).any(nears_side)
    };
    let mut stopped = 0;
    for ((at, v), a) in position.iter().zip(velocity).zip(acceleration) {
        if *v != Vec2::zeros() && comes_near(*at, at + *v * dt) {
            *a -= *v / dt;
            *v = Vec2::zeros();
            stopped += 1;
        }
    }
    stopped
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{section::outline::Support, testing::square_block};

    /// A single node that moves towards the base or a wall stops in front of it; one that moves away
    /// continues.
    #[test]
    fn single_nodes_stop_at_edges() {
        let mut model = square_block(1);
        model.outline = Outline::level(0.0);
        model.outline.sides[1] = Some(Side { x: 5.0, extent: [0.0, 3.0], support: Support::FreeSlip });
        let stopped = |at: Vec2, velocity: Vec2| {
            let (mut v, mut a) = ([velocity], [Vec2::zeros()]);
            let count = stop_near_edges(
                &model,
                &model.outline,
                &[at],
                NodalMotion { velocity: &mut v, acceleration: &mut a },
                0.1,
            );
            assert_eq!(count == 1, v[0] == Vec2::zeros());
            assert!((a[0] * 0.1 + velocity - v[0]).norm() < 1e-15);
            count == 1
        };
        assert!(stopped(Vec2::new(1.0, 0.3), Vec2::new(1.0, -2.0)));
        assert!(stopped(Vec2::new(1.0, 0.3), Vec2::new(1.0, -9.0)));
        assert!(!stopped(Vec2::new(1.0, 0.3), Vec2::new(1.0, 0.1)));
        assert!(!stopped(Vec2::new(1.0, 0.9), Vec2::new(1.0, -2.0)));
        assert!(stopped(Vec2::new(4.7, 1.0), Vec2::new(2.0, 0.0)));
        assert!(!stopped(Vec2::new(4.7, 4.0), Vec2::new(2.0, 0.0)));
    }
}
