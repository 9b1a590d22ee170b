//! Nodes tied to the drained surface (half-cell rule).

use super::Flow;
use crate::section::{
    description::{Model, Water},
    node_id::id,
};
use sandboil_sph::Vec2;

/// A node whose pressure follows from that prescribed on the free surface and that of a node below (half-cell rule): only
/// where the soil is permeable.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SurfaceNode {
    /// The node.
    pub node: u32,
    /// The node below that it is tied to.
    pub inner: u32,
    /// Depth of the node over the depth of the inner node.
    pub fraction: f64,
}

impl Flow {
    /// Excess pressure on the surface above a node, kPa; zero without a condition.
    pub(super) fn outside(&self, node: usize) -> f64 {
        self.edges.as_ref().map_or(0.0, |edges| edges.at_surface(node))
    }

    /// The excess pressure of a tied node, kPa: that on the surface belongs there, not to the centre of the node below it.
    pub(super) fn tied(&self, tie: &SurfaceNode) -> f64 {
        let outside = self.outside(tie.node as usize);
        let inner = self.excess[tie.inner as usize];
        outside + tie.fraction * (inner - outside)
    }

    /// Ties the nodes above which no condition takes its inflow. A node that has been tied exerts no force from then on: a
    /// row at the surface of full ground that starts to push amplifies waves.
    pub(super) fn update_ties(&mut self) {
        let is_sealed = |tie: &SurfaceNode| self.edges.as_ref().is_some_and(|edges| edges.seals(tie.node));
        self.surface = self.ties.iter().copied().filter(|tie| !is_sealed(tie)).collect();
        for tie in &self.surface {
            self.pushes[tie.node as usize] = false;
        }
    }

    /// Sets the excess pressure of every tied node.
    pub(super) fn hold_surface(&mut self) {
        for k in 0..self.surface.len() {
            let tie = self.surface[k];
            self.excess[tie.node as usize] = self.tied(&tie);
        }
    }
}

/// Nodes within one spacing of the drained surface, each with the node below that it interpolates to. That surface is the
/// ground, or the water table where that lies deeper and soil above it holds no water that could move.
pub fn surface_nodes(model: &Model, water: Water) -> Vec<SurfaceNode> {
    let is_partly_saturated = !model.saturation.is_empty();
    let has_curve = |node: usize| model.regions[model.region[node] as usize].retention.is_some();
    let depth = |node: usize| {
        let below_ground = model.surface_elevation[node] - model.position[node].y;
        if !is_partly_saturated || has_curve(node) {
            return below_ground;
        }
        if model.saturation(node) < 1.0 {
            0.0
        } else {
            below_ground.min(model.pore_pressure[node] / water.unit_weight)
        }
    };
    // Suction does not end at a surface.
    let is_held = |node: usize| !has_curve(node) || model.pore_pressure[node] >= 0.0;
    let near: Vec<usize> =
        (0..model.nodes()).filter(|&node| is_held(node) && depth(node) < model.spacing.y).collect();
    let below = |node: usize| Vec2::new(model.position[node].x, model.position[node].y - model.spacing.y);
    near.iter()
        .filter_map(|&node| {
            if is_partly_saturated && !has_curve(node) && depth(node) <= 0.0 {
                return Some(SurfaceNode { node: id(node), inner: id(node), fraction: 0.0 });
            }
            let wanted = below(node);
            let miss = |other: usize| {
                let mut offset = model.position[other] - wanted;
                if let Some(period) = model.period {
                    offset.x -= period.width * (offset.x / period.width).round();
                }
                offset.norm_squared()
            };
            let inner = (0..model.nodes())
                .filter(|&other| depth(other) > depth(node))
                .min_by(|&a, &b| miss(a).total_cmp(&miss(b)))?;
            Some(SurfaceNode { node: id(node), inner: id(inner), fraction: depth(node) / depth(inner) })
        })
        .collect()
}
