//! Pore water of moving ground: its pressure is computed at the nodes, or at the corners of cells on the dual lattice.

use crate::{
    section::{description::Model, stress_layout::StressLayout},
    skeleton::section_view::SectionView,
    water::{
        corner_pressure::CornerFlow,
        pore_pressure::{Flow, FlowScheme},
    },
};
use sandboil_sph::Vec2;

/// Pore water in a stage of moving ground.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub enum PoreWater {
    /// Pressure at the nodes.
    Nodes(Box<Flow>),
    /// Pressure at the corners of cells.
    Corners(Box<CornerFlow>),
}

impl PoreWater {
    /// The pressure at the nodes, if it is computed there.
    pub fn nodes(&self) -> Option<&Flow> {
        match self {
            Self::Nodes(flow) => Some(flow),
            Self::Corners(_) => None,
        }
    }

    /// The same, to be changed.
    pub fn nodes_mut(&mut self) -> Option<&mut Flow> {
        match self {
            Self::Nodes(flow) => Some(flow),
            Self::Corners(_) => None,
        }
    }

    /// The pressure at the corners of cells, if it is computed there.
    pub fn corners(&self) -> Option<&CornerFlow> {
        match self {
            Self::Nodes(_) => None,
            Self::Corners(flow) => Some(flow),
        }
    }

    /// Excess pore pressure since rest of a node, kPa, compression positive.
    #[inline]
    pub fn excess(&self, node: usize) -> f64 {
        match self {
            Self::Nodes(flow) => flow.excess(node),
            Self::Corners(flow) => flow.of_node(node),
        }
    }

    /// Takes over the porosities and places of a new geometry. `time` of the stage, s.
    pub fn follow(&mut self, section: SectionView, time: f64) {
        match self {
            Self::Nodes(flow) => flow.follow(section, time),
            Self::Corners(flow) => flow.follow(section, time),
        }
    }

    /// Force of still water around the ground on every node, kN/m, if it stands in one.
    pub fn buoyancy(&self, position: &[Vec2], volume: &[f64]) -> Option<Vec<Vec2>> {
        match self {
            Self::Nodes(flow) => flow.buoyancy(position, volume),
            Self::Corners(flow) => flow.buoyancy(position, volume),
        }
    }

    /// Degree of saturation of a node, if it can change.
    pub fn saturation<'a>(&'a self, layout: &'a StressLayout) -> Option<Box<dyn Fn(usize) -> f64 + 'a>> {
        match (self, layout) {
            (Self::Nodes(flow), _) => flow.saturation().map(|of_node| Box::new(of_node) as Box<_>),
            (Self::Corners(flow), StressLayout::Dual(dual)) => {
                flow.saturation(dual).map(|of_node| Box::new(of_node) as Box<_>)
            }
            (Self::Corners(_), StressLayout::Diagonal) => None,
        }
    }

    /// Makes new tables of diffusion if conductivities or conditions have changed.
    pub fn refresh(&mut self, model: &Model, layout: &StressLayout) {
        match (self, layout) {
            (Self::Nodes(flow), _) => flow.refresh(model),
            (Self::Corners(flow), StressLayout::Dual(dual)) => flow.refresh(model, dual),
            (Self::Corners(_), StressLayout::Diagonal) => {}
        }
    }

    /// Whether the water exerts forces on nodes besides its pressure at stress points.
    pub fn has_nodal_force(&self) -> bool {
        match self {
            Self::Nodes(_) => true,
            Self::Corners(flow) => flow.has_nodal_force(),
        }
    }

    /// How the pressure is advanced.
    pub fn scheme(&self) -> FlowScheme {
        match self {
            Self::Nodes(flow) => flow.scheme(),
            Self::Corners(flow) => flow.scheme(),
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Nodes(flow) => flow.bytes(),
            Self::Corners(flow) => flow.bytes(),
        }
    }
}
