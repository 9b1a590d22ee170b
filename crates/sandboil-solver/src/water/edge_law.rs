//! The law of water at edges, of ground at rest and in motion.
//!
//! A condition prescribes an inflow, or less where more would raise the head on the edge above a limit ([`Demand`]). So a
//! cell of an edge is in one of two states, and exactly one of them agrees with the heads of the nodes: it holds the
//! limiting head while the flow under that head is less than the prescribed inflow, and takes the prescribed inflow
//! otherwise. A seepage face holds its head while water leaves; rain ponds while the soil takes less than falls.

use crate::{
    section::description::Model,
    water::{
        conditions::{Cells, Demand, HydraulicCondition},
        conduction::{Across, Beyond, between},
    },
};
use sandboil_soil::VanGenuchten;

/// Head, as a share of the spacing, by which a cell must miss its state before it changes it: above the round-off of
/// heads, so that a cell with no flow keeps its state.
pub const HYSTERESIS: f64 = 1e-6;

/// Heads and conductivities of the nodes.
#[derive(Clone, Copy)]
pub struct Nodes<'a> {
    /// Total head, m.
    pub head: &'a [f64],
    /// Relative conductivity; none in saturated ground.
    pub relative: Option<&'a [f64]>,
}

impl Nodes<'_> {
    /// Relative conductivity of the soil between the nodes of a pair.
    fn soil(&self, pair: &Beyond) -> f64 {
        self.relative.map_or(1.0, |relative| between(relative, pair.node as usize, pair.owner as usize))
    }

    /// Difference of head that drives water in through an edge with a head (m) on it: the image shows as much above it as
    /// its node lies below.
    fn inward(&self, pair: &Beyond, edge: f64) -> f64 {
        2.0 * edge - self.head[pair.owner as usize] - self.head[pair.node as usize]
    }
}

/// A head on an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenEdge {
    /// Total head, m.
    pub head: f64,
    /// The cell that holds it; none where ground without a condition is open.
    pub cell: Option<u32>,
}

/// What a node sees beyond an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// The exchange.
    pub across: Across,
    /// The head on the edge, if water crosses it.
    pub open: Option<OpenEdge>,
}

impl Seen {
    /// Inflow by the exchange that does not depend on the heads of the nodes, m2/s.
    pub fn constant(&self) -> f64 {
        self.open.map_or(0.0, |open| self.across.strength * (2.0 * open.head))
    }
}

/// The soil beside a cell.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Beside {
    retention: Option<VanGenuchten>,
    /// Inflow of a drain per metre of head, m/s; none on an edge.
    drain: Option<f64>,
}

/// Flow into a cell that holds its head.
#[derive(Debug, Clone, Copy, Default)]
struct HeldFlow {
    /// Inflow, m2/s.
    taken: f64,
    /// Inflow per metre of head, m/s.
    strength: f64,
}

/// The cells of a section's boundaries, and the law by which they act.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct EdgeLaw {
    /// The cells.
    pub cells: Cells,
    beside: Vec<Beside>,
    /// Head by which a cell must miss its state before it changes it, m.
    margin: f64,
    #[serde(skip)]
    held_flow: Vec<HeldFlow>,
}

impl EdgeLaw {
    /// The law for the cells of boundaries with these conditions.
    pub fn new<'a>(model: &Model, cells: Cells, condition: impl Fn(usize) -> &'a HydraulicCondition) -> Self {
        let beside = cells.all.iter().map(|cell| {
            let region = &model.regions[model.region[cell.node as usize] as usize];
            let conductance = cell.drain_conductance(region.hydraulic_conductivity.minor, model.spacing.y);
            let drain = condition(cell.boundary).is_inside().then_some(conductance);
            Beside { retention: region.retention, drain }
        });
        Self { beside: beside.collect(), margin: HYSTERESIS * model.spacing.y, held_flow: Vec::new(), cells }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.cells.bytes() + size_of_val(self.beside.as_slice()) + size_of_val(self.held_flow.as_slice())
    }

    /// Inflow of a drain's cell per metre of head, m/s; none if the cell lies on an edge.
    pub fn drain(&self, cell: usize) -> Option<f64> {
        self.beside[cell].drain
    }

    /// The heads that the cells of a pair hold.
    pub fn held(&self, pair: usize, holds: &[bool], demands: &[Demand]) -> [Option<OpenEdge>; 2] {
        self.cells.of_pair[pair].map(|cell| {
            let held = cell.filter(|&cell| holds[cell as usize])?;
            Some(OpenEdge { head: demands[held as usize].head, cell: Some(held) })
        })
    }

    /// What the node of a pair sees beyond edges with these heads.
    pub fn seen(&self, pair: &Beyond, heads: [Option<OpenEdge>; 2], nodes: Nodes) -> Seen {
        match heads {
            [Some(open), None] | [None, Some(open)] => {
                let strength = pair.open * self.edge_conductivity(pair, open, nodes);
                Seen { across: Across { strength, sign: -1.0 }, open: Some(open) }
            }
            // Beyond a corner of two heads a node sees an image of itself: what passes is left to the edges.
            _ => {
                let strength = pair.closed * nodes.soil(pair);
                Seen { across: Across { strength, sign: 1.0 }, open: None }
            }
        }
    }

    /// Relative conductivity across an edge with a head: of soil at that head where water flows in, of the soil as it is
    /// where water flows out.
    fn edge_conductivity(&self, pair: &Beyond, open: OpenEdge, nodes: Nodes) -> f64 {
        let soil = nodes.soil(pair);
        if nodes.inward(pair, open.head) <= 0.0 {
            return soil;
        }
        let wetted = open.cell.map_or(1.0, |cell| {
            let curve = self.beside[cell as usize].retention;
            let pressure_head = open.head - self.cells.all[cell as usize].middle.y;
            curve.map_or(1.0, |curve| curve.at(pressure_head).relative_conductivity)
        });
        wetted.max(soil)
    }

    /// Switches cells that `may_switch` between their head and their inflow by the heads of the nodes. Returns whether a cell
    /// changed its state.
    pub fn switch(
        &mut self,
        beyond: &[Beyond],
        demands: &[Demand],
        nodes: Nodes,
        holds: &mut [bool],
        mut may_switch: impl FnMut(usize) -> bool,
    ) -> bool {
        self.find_held_flow(beyond, demands, nodes);
        let mut switched = false;
        for (k, demand) in demands.iter().enumerate() {
            let HeldFlow { taken, strength } = self.held_flow[k];
            let margin = self.margin * strength;
            let most = demand.inflow * self.cells.all[k].length + if holds[k] { margin } else { -margin };
            // Where nothing passes the edge a head would shut out what falls on it.
            let wanted = taken < most && (strength > 0.0 || demand.inflow.is_infinite());
            if wanted != holds[k] && may_switch(k) {
                holds[k] = wanted;
                switched = true;
            }
        }
        switched
    }

    /// What each cell would take if it held its head.
    fn find_held_flow(&mut self, beyond: &[Beyond], demands: &[Demand], nodes: Nodes) {
        let mut flow = std::mem::take(&mut self.held_flow);
        flow.clear();
        flow.resize(demands.len(), HeldFlow::default());
        if flow.is_empty() {
            return;
        }
        for (pair, cells) in beyond.iter().zip(&self.cells.of_pair) {
            for &cell in cells.iter().flatten() {
                let head = demands[cell as usize].head;
                let strength =
                    pair.open * self.edge_conductivity(pair, OpenEdge { head, cell: Some(cell) }, nodes);
                flow[cell as usize].taken += strength * nodes.inward(pair, head);
                flow[cell as usize].strength += strength;
            }
        }
        for (k, flow) in flow.iter_mut().enumerate() {
            if let Some(strength) = self.drain(k) {
                let taken = strength * (demands[k].head - nodes.head[self.cells.all[k].node as usize]);
                *flow = HeldFlow { taken, strength };
            }
        }
        self.held_flow = flow;
    }
}
