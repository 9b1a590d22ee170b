//! A view of a section as it stands.

use crate::{
    section::{
        description::Model,
        edge_nodes::EdgeNodes,
        outline::{Outline, Walls},
    },
    skeleton::phases::Phases,
};
use sandboil_sph::Vec2;

/// What the tables are built from: the section as it stands.
pub struct Section<'a> {
    /// Its description.
    pub model: &'a Model,
    /// Its edges as they stand.
    pub outline: &'a Outline,
    /// What they do.
    pub walls: Walls,
    /// Its nodes along the edges.
    pub edges: &'a EdgeNodes,
    /// Where the nodes are, m.
    pub position: &'a [Vec2],
    /// Volumes and densities.
    pub phases: &'a Phases,
    /// Mass of each node, Mg/m.
    pub mass: &'a [f64],
}
