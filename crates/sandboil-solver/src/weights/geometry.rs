//! Weight tables of the current geometry. They are kept while strains are small.

use crate::{
    section::{
        description::{Model, Operators},
        node_id::id,
        outline::EdgesView,
        stress_layout::StressLayout,
    },
    weights::{
        balance,
        images::Surroundings,
        lists::{Lists, skin},
        printed::{PrintedTables, printed_strain_tables, printed_tables},
        rows::{Paired, VectorWeight, divergence_row, least_squares_tables},
        stencils::Stencils,
    },
};
use sandboil_sph::{Csr, GradientWeight, NeighbourList, Vec2, WendlandQuintic};
use std::collections::BTreeMap;

/// Tables that only a section with water has.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct FlowTables {
    /// `div v` at velocity nodes, weights of each component, images included (last term of Eq. 7). The
    /// transposed table is weighted with the row's volume: it gives the pressure force.
    pub divergence: Paired<Vec2>,
}

/// All weights of one geometry.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Geometry {
    /// Gradient at stress nodes from velocity nodes, without images.
    pub gradient: Paired<GradientWeight>,
    /// Position covariance `(xx, xy, yy)` of each stress node's stencil, m2: the filter's linear part.
    pub covariance: Vec<[f64; 3]>,
    /// Additional weights by the images beyond base and sides.
    pub wall: Paired<VectorWeight>,
    /// Flow tables, if there is water.
    pub flow: Option<FlowTables>,
    /// Tables of the printed operators, if chosen.
    pub printed: Option<PrintedTables>,
    /// Whether weights near the base were changed to bring stress into balance.
    pub is_balanced: bool,
    list: Lists,
}

impl Geometry {
    /// Builds all tables at `position` for nodes of `volume` (m2), with the stress points of a section at rest.
    pub fn build(model: &Model, position: &[Vec2], volume: &[f64], edges: EdgesView) -> Self {
        Self::renew(model, &StressLayout::new(model), position, volume, edges, None)
    }

    /// Builds all tables for the present stress points. The lists of `previous` are reused if they are still
    /// valid.
    pub fn renew(
        model: &Model,
        layout: &StressLayout,
        position: &[Vec2],
        volume: &[f64],
        edges: EdgesView,
        previous: Option<Self>,
    ) -> Self {
        let kernel = WendlandQuintic::new(model.smoothing_length());
        // Lists are reused after nodes have moved, so images are made for more nodes than the kernel reaches.
        let around =
            Surroundings::new(position, edges.outline, edges.walls, kernel.support() + 2.0 * skin(model));
        let stress_position = layout.positions(position, model.spacing);
        let list = previous
            .map(|geometry| geometry.list)
            .filter(|list| list.are_valid(model, &around, position))
            .unwrap_or_else(|| Lists::build(model, &around, kernel.support(), position, &stress_position));
        let stencils = Stencils { around: &around, volume, kernel, period: model.period };
        let (gradient, covariance, wall_table) = match model.numerics.operators {
            Operators::Conservative | Operators::Dual => {
                least_squares_tables(&stencils, &list.from_stress, &stress_position)
            }
            Operators::Printed => printed_strain_tables(&stencils, &list.from_stress, &stress_position),
        };
        let is_balanced = balance::is_needed(model, edges);
        let wall_table = if is_balanced {
            let list = &list.from_stress;
            wall_table.with_more(balance::corrections(
                model,
                edges.outline,
                &stencils,
                list,
                &stress_position,
                |s| layout.volume(s, volume),
            ))
        } else {
            wall_table
        };
        let flow = model.has_nodal_water().then(|| flow_tables(&stencils, &list.from_velocity, position));
        let printed = (model.numerics.operators == Operators::Printed)
            .then(|| printed_tables(&stencils, &list, position, &stress_position, edges));
        let nodes = position.len();
        Self {
            gradient: Paired::new(gradient, nodes),
            covariance,
            wall: Paired::new(wall_table, nodes),
            flow,
            printed,
            is_balanced,
            list,
        }
    }

    /// Adds the weights of copied velocities, whose indices follow those of the nodes, to strain and
    /// divergence. No force acts on the copies.
    pub fn add_copied_velocities(
        &mut self,
        strain: BTreeMap<usize, Vec<(u32, VectorWeight)>>,
        divergence: BTreeMap<usize, Vec<(u32, Vec2)>>,
    ) {
        self.wall.forward = self.wall.forward.with_more(strain);
        if let Some(flow) = &mut self.flow {
            flow.divergence.forward = flow.divergence.forward.with_more(divergence);
        }
    }

    /// Adds weights to the gradients at some stress nodes, and to the force, which is their transpose.
    pub fn enhance(&mut self, more: BTreeMap<usize, Vec<(u32, VectorWeight)>>, nodes: usize) {
        self.wall = Paired::new(self.wall.forward.with_more(more), nodes);
    }

    /// The neighbour lists of the tables.
    pub fn lists(&self) -> &Lists {
        &self.list
    }

    /// Upper bounds of the largest squared wave numbers of strain and divergence, 1/m2 (Gershgorin): how
    /// sharp the weights are. `volume` holds the volumes of the nodes, m2.
    pub fn sharpness(&self, layout: &StressLayout, volume: &[f64]) -> [f64; 2] {
        let of_point = |s: usize| layout.volume(s, volume);
        let strain = |s: usize| -> f64 {
            let free = self.gradient.forward.iter_row(s).map(|(_, weight)| weight.gradient.norm());
            free.sum::<f64>() + self.wall.forward.iter_row(s).map(|(_, w)| w.magnitude()).sum::<f64>()
        };
        let of_points: Vec<f64> =
            (0..self.gradient.forward.rows()).map(|s| of_point(s) * strain(s)).collect();
        let of_node = |j: usize| -> f64 {
            let free = self.gradient.transposed.iter_row(j).map(|(s, w)| w.gradient.norm() * of_points[s]);
            let walls = self.wall.transposed.iter_row(j).map(|(s, w)| w.magnitude() * of_points[s]);
            (free.sum::<f64>() + walls.sum::<f64>()) / volume[j]
        };
        let skeleton = (0..volume.len()).map(of_node).fold(0.0, f64::max);
        let water = self.flow.as_ref().map_or(0.0, |flow| {
            let reach: Vec<f64> = (0..volume.len())
                .map(|i| flow.divergence.forward.iter_row(i).map(|(_, w)| w.norm()).sum())
                .collect();
            // The transposed weights include the volumes of their rows.
            let row = |j| flow.divergence.transposed.iter_row(j);
            let of_node = |j: usize| row(j).map(|(i, w)| w.norm() * reach[i]).sum::<f64>() / volume[j];
            (0..volume.len()).map(of_node).fold(0.0, f64::max)
        });
        [skeleton, water]
    }

    /// Pairs of a stress node and a velocity node; images count as their nodes.
    pub fn pairs(&self) -> usize {
        self.gradient.forward.entries()
    }

    /// Bytes of the weight tables.
    pub fn bytes(&self) -> usize {
        let flow = self.flow.as_ref().map_or(0, |flow| flow.divergence.bytes());
        let printed = self.printed.as_ref().map_or(0, |tables| {
            let values = [&tables.interpolation, &tables.ghost_stress, &tables.mirror_stress];
            let vectors = [&tables.kernel_gradient, &tables.ghost_gradient, &tables.pressure_gradient];
            values.map(Csr::bytes).iter().sum::<usize>() + vectors.map(Csr::bytes).iter().sum::<usize>()
        });
        let covariance = size_of_val(self.covariance.as_slice());
        self.gradient.bytes() + self.wall.bytes() + covariance + flow + printed
    }
}

/// Divergence at velocity nodes (Eq. 7), images included.
pub fn flow_tables(stencils: &Stencils, list: &NeighbourList, points: &[Vec2]) -> FlowTables {
    let mut divergence = Csr::with_capacity(points.len(), list.pairs());
    for (i, &at) in points.iter().enumerate() {
        divergence.push_row(&mut divergence_row(stencils, &stencils.all(list, i, at), id(i)));
    }
    let mut divergence = Paired::new(divergence, points.len());
    divergence.transposed.scale_by_column(stencils.volume);
    FlowTables { divergence }
}
