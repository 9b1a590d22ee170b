//! A view of the present section.

use crate::{
    section::{
        description::Model,
        edge_nodes::EdgeNodes,
        outline::{Outline, Walls},
        stress_layout::StressLayout,
    },
    skeleton::{phases::Phases, point::StressPoint},
    weights::geometry::Geometry,
};
use sandboil_sph::Vec2;

/// The present section.
#[derive(Clone, Copy)]
pub struct SectionView<'a> {
    /// Its description.
    pub model: &'a Model,
    /// Its edges at their present place.
    pub outline: &'a Outline,
    /// How the edges act.
    pub walls: Walls,
    /// Its nodes along the edges.
    pub edges: &'a EdgeNodes,
    /// Present positions of the nodes, m.
    pub position: &'a [Vec2],
    /// Volumes, porosities and densities.
    pub phases: &'a Phases,
    /// Where its stress points are.
    pub layout: &'a StressLayout,
    /// Its stress points.
    pub points: &'a [StressPoint],
    /// Mass of each node, Mg/m.
    pub mass: &'a [f64],
    /// Weights at the present positions.
    pub geometry: &'a Geometry,
    /// Outward normals of the nodes at the free surface, if it is found from the nodes and not given by the
    /// lattice.
    pub free_surface: Option<&'a [Option<Vec2>]>,
}
