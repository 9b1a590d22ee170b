//! Hydraulic conditions (Section 4.1) while the ground moves: excess pressure on edges, and drains.
//!
//! Excess counts from the state at rest. The water that crosses the edges is the difference of two flows by the law of
//! [`EdgeLaw`]: the present one, and that of the state at rest. A condition that held at rest therefore brings what has
//! changed since. One that is new starts from the head that the ground shows at its edge. Lines move with the ground.

use crate::{
    error::SolverError,
    section::{
        bins::Bins,
        description::{Model, Water},
        node_id::id,
    },
    water::{
        conditions::{Cell, Cells, Demand, HydraulicBoundary},
        conduction::{Across, Beyond, Conduction, collected},
        edge_law::{EdgeLaw, Nodes, OpenEdge, Seen},
    },
    weights::points::point_weights,
};
use sandboil_sph::{Csr, Vec2, WendlandQuintic};

/// A hydraulic condition of a stage in which the ground moves.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct MovingBoundary {
    /// Where and what.
    pub boundary: HydraulicBoundary,
    /// What it prescribed at rest, if it already held there; zero where nothing is prescribed.
    pub at_rest: Option<f64>,
}

/// Distance from a surface cell within which the ground belongs to it, in spacings.
const REACH: f64 = 1.5;
/// Relative conductivities of the nodes of partly saturated ground.
#[derive(Debug, Clone, Copy)]
pub struct Relative<'a> {
    /// In the tables of conduction.
    pub tabled: &'a [f64],
    /// At rest.
    pub at_rest: &'a [f64],
}

/// Conditions on edges, and drains.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct WaterEdges {
    conditions: Vec<MovingBoundary>,
    law: EdgeLaw,
    unit_weight: f64,
    /// Total head of the nodes at rest, m.
    head_at_rest: Vec<f64>,
    /// Elevation of the nodes at rest, m.
    elevation: Vec<f64>,
    /// What each cell asked for at rest.
    at_rest: Vec<Demand>,
    /// Whether a cell held a head at rest.
    held_at_rest: Vec<bool>,
    /// What each cell asks for.
    now: Vec<Demand>,
    /// Whether it holds a head.
    holds: Vec<bool>,
    /// Excess pressure on each cell that holds a head, kPa, and inflow beyond that prescribed at rest through the others,
    /// m2/s.
    value: Vec<f64>,
    /// What a unit of a cell's value brings to nodes, 1/s of their volume per kPa or m2/s.
    drive: Csr<f64>,
    /// What the heads at rest bring to each node beyond what they brought at rest, 1/s of its volume; empty while cells and
    /// conductivities are those at rest.
    gained: Vec<f64>,
    drains: Vec<DrainCell>,
    /// Nodes near the ground surface, and the cell on it above each.
    above: Vec<(u32, u32)>,
    /// Excess pressure on the ground surface above each node near it, kPa.
    surface: Vec<f64>,
    /// Whether every value stays zero.
    is_still: bool,
    /// Exchange of water in the present geometry, kept where conductivities or cells can change.
    pub conduction: Option<Conduction>,
}

/// A cell of a drain.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct DrainCell {
    node: u32,
    cell: u32,
    /// Inflow per excess pressure, 1/(kPa s) of the node's volume.
    conductance: f64,
}

impl WaterEdges {
    /// The conditions on a section that stands where its model says. `relative` conductivities are those at rest, in partly
    /// saturated ground.
    ///
    /// # Errors
    /// Those of [`Cells::new`].
    pub fn new(
        model: &Model,
        water: Water,
        conduction: &Conduction,
        conditions: &[MovingBoundary],
        relative: Option<&[f64]>,
    ) -> Result<Self, SolverError> {
        let boundaries: Vec<_> = conditions.iter().map(|condition| condition.boundary.clone()).collect();
        let cells = Cells::new(model, &model.position, &boundaries, conduction.beyond())?;
        let law = EdgeLaw::new(model, cells, |boundary| &boundaries[boundary].condition);
        let cells = &law.cells;
        let head: Vec<f64> = model
            .position
            .iter()
            .zip(&model.pore_pressure)
            .map(|(at, pressure)| at.y + pressure / water.unit_weight)
            .collect();
        let middles: Vec<Vec2> = cells.all.iter().map(|cell| cell.middle).collect();
        let weights = point_weights(model, &model.position, &middles);
        let shown = |(k, cell): (usize, &Cell)| {
            let MovingBoundary { boundary, at_rest } = &conditions[cell.boundary];
            match at_rest {
                Some(value) => {
                    boundary.condition.demand(*value, cell.middle.y, cell.slope, water.unit_weight)
                }
                None if boundary.condition.is_inside() => {
                    Demand { inflow: 0.0, head: head[cell.node as usize] }
                }
                None => {
                    let at_edge = weights.iter_row(k).map(|(node, w)| w * head[node]).sum();
                    Demand { inflow: 0.0, head: at_edge }
                }
            }
        };
        let at_rest: Vec<Demand> = cells.all.iter().enumerate().map(shown).collect();
        let mut on_surface = vec![false; cells.all.len()];
        for (pair, found) in conduction.beyond().iter().zip(&cells.of_pair) {
            if let (true, Some(cell)) = (pair.at_surface, found[0]) {
                on_surface[cell as usize] = true;
            }
        }
        let spacing = model.spacing.x.max(model.spacing.y);
        let bins = Bins::new(&middles, REACH * spacing);
        let tops: Vec<Vec2> = (0..model.nodes())
            .map(|node| Vec2::new(model.position[node].x, model.surface_elevation[node]))
            .collect();
        // Stencils that the surface cuts reach as far once more.
        let near = Bins::new(&tops, 2.0 * WendlandQuintic::new(model.smoothing_length()).support());
        let above = (0..model.nodes())
            .filter_map(|node| {
                let top = near.nearest(&tops, model.position[node], |_| true)?;
                bins.nearest(&middles, tops[top], |cell| on_surface[cell]).map(|cell| (id(node), id(cell)))
            })
            .collect();
        let count = cells.all.len();
        let mut edges = Self {
            conditions: conditions.to_vec(),
            law,
            unit_weight: water.unit_weight,
            elevation: model.position.iter().map(|at| at.y).collect(),
            head_at_rest: head,
            now: at_rest.clone(),
            at_rest,
            held_at_rest: Vec::new(),
            holds: vec![false; count],
            value: vec![0.0; count],
            drive: Csr::default(),
            gained: Vec::new(),
            drains: Vec::new(),
            above,
            surface: Vec::new(),
            is_still: false,
            conduction: None,
        };
        edges.find_state_at_rest(conduction, relative);
        edges.look_up(0.0);
        let head = edges.head_at_rest.clone();
        edges.switch(conduction, Nodes { head: &head, relative });
        let continues = |condition: &MovingBoundary| {
            condition.at_rest.is_some() && condition.boundary.condition.is_constant()
        };
        edges.is_still = edges.conditions.iter().all(continues) && edges.value.iter().all(|v| *v == 0.0);
        if !edges.is_still {
            edges.surface = vec![0.0; model.nodes()];
            edges.update_surface();
        }
        Ok(edges)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.law.bytes()
            + self.drive.bytes()
            + 2 * size_of_val(self.elevation.as_slice())
            + size_of_val(self.surface.as_slice())
            + size_of_val(self.gained.as_slice())
            + self.conduction.as_ref().map_or(0, Conduction::bytes)
    }

    /// Which cells held a head at rest: of conditions that were there.
    fn find_state_at_rest(&mut self, conduction: &Conduction, relative: Option<&[f64]>) {
        let was_there = |k: usize| self.conditions[self.law.cells.all[k].boundary].at_rest.is_some();
        let may_hold: Vec<bool> = (0..self.at_rest.len()).map(was_there).collect();
        let nodes = Nodes { head: &self.head_at_rest, relative };
        self.law.switch(conduction.beyond(), &self.at_rest, nodes, &mut self.holds, |k| may_hold[k]);
        self.held_at_rest.clone_from(&self.holds);
    }

    /// Whether each cell holds a head.
    #[cfg(test)]
    pub fn holds(&self) -> &[bool] {
        &self.holds
    }

    /// Whether only the inflow of a condition crosses the ground surface above a node.
    pub fn seals(&self, node: u32) -> bool {
        let cell = self.above.binary_search_by_key(&node, |entry| entry.0);
        cell.is_ok_and(|found| !self.holds[self.above[found].1 as usize])
    }

    /// Excess pressure on the ground surface above a node near it, kPa; zero elsewhere.
    #[inline]
    pub fn at_surface(&self, node: usize) -> f64 {
        self.surface.get(node).copied().unwrap_or(0.0)
    }

    /// Every drain that runs.
    pub fn drains(&self) -> impl Iterator<Item = RunningDrain> {
        let running = self.drains.iter().filter(|drain| self.holds[drain.cell as usize]);
        running.map(|drain| RunningDrain {
            node: drain.node as usize,
            pressure: self.value[drain.cell as usize],
            conductance: drain.conductance,
        })
    }

    /// What the heads at rest bring to a node beyond what they brought at rest, 1/s of its volume.
    #[inline]
    pub fn gained(&self, node: usize) -> f64 {
        self.gained.get(node).copied().unwrap_or(0.0)
    }

    /// Water that conditions bring to a node beyond that at rest, 1/s of its volume; drains aside.
    #[inline]
    pub fn inflow(&self, node: usize) -> f64 {
        if self.is_still {
            return 0.0;
        }
        self.drive.iter_row(node).map(|(cell, weight)| weight * self.value[cell]).sum()
    }

    /// Sets what the conditions ask for at a time, s.
    pub fn look_up(&mut self, time: f64) {
        if self.is_still {
            return;
        }
        for (cell, now) in self.law.cells.all.iter().zip(&mut self.now) {
            let condition = &self.conditions[cell.boundary].boundary.condition;
            *now = condition.demand(condition.value(time), cell.middle.y, cell.slope, self.unit_weight);
        }
        self.update_values();
    }

    /// What the cells bring beyond what they brought at rest.
    fn update_values(&mut self) {
        for (k, cell) in self.law.cells.all.iter().enumerate() {
            let (now, rest) = (self.now[k], self.at_rest[k]);
            self.value[k] = if self.holds[k] {
                self.unit_weight * (now.head - rest.head)
            } else {
                (prescribed(now) - prescribed(rest)) * cell.length
            };
        }
        self.update_surface();
    }

    /// Excess pressure of the water on the ground: none is left on a cell that holds no head.
    fn update_surface(&mut self) {
        if self.surface.is_empty() {
            return;
        }
        for &(node, cell) in &self.above {
            let cell = cell as usize;
            self.surface[node as usize] = if self.holds[cell] {
                self.value[cell]
            } else {
                let depth_at_rest = self.at_rest[cell].head - self.law.cells.all[cell].middle.y;
                -self.unit_weight * depth_at_rest.max(0.0)
            };
        }
    }

    /// Switches cells between their head and their inflow by the present state of the nodes. Returns whether one changed.
    pub fn switch(&mut self, conduction: &Conduction, nodes: Nodes) -> bool {
        let switched = self.law.switch(conduction.beyond(), &self.now, nodes, &mut self.holds, |_| true);
        if switched {
            self.update_values();
        }
        switched
    }

    /// Moves the lines with the ground to a new geometry.
    pub fn follow(&mut self, conduction: &Conduction, displacement: impl Fn(u32) -> Vec2) {
        self.law.cells.assign(conduction.beyond(), displacement);
    }

    /// What the node of the pair `k` sees beyond the edge in a state.
    fn seen(&self, k: usize, pair: &Beyond, state: &State) -> Seen {
        let mut heads = self.law.held(k, state.holds, state.demands);
        if self.law.cells.of_pair[k][0].is_none() {
            heads[0] = self.open_ground(pair, state.nodes);
        }
        self.law.seen(pair, heads, state.nodes)
    }

    /// The head on ground without a condition: it is open where water stands in it.
    fn open_ground(&self, pair: &Beyond, nodes: Nodes) -> Option<OpenEdge> {
        let elevation = pair.crossings[0].filter(|_| pair.at_surface)?.foot.y;
        let owner = pair.owner as usize;
        let at_rest = self.head_at_rest[owner];
        let is_wet = nodes.relative.is_none() || at_rest >= self.elevation[owner];
        let head = if is_wet { elevation.max(at_rest) } else { elevation.max(0.0) };
        (is_wet || nodes.head[owner] >= elevation).then_some(OpenEdge { head, cell: None })
    }

    /// The exchange of water in a state, m/s, and what the heads and inflows at rest bring to each node by it, m2/s.
    fn exchange(&self, conduction: &Conduction, state: &State) -> (Csr<f64>, Vec<f64>) {
        let beyond = conduction.beyond();
        let seen: Vec<Seen> = beyond.iter().enumerate().map(|(k, pair)| self.seen(k, pair, state)).collect();
        let table = conduction.exchange(state.nodes.relative, |k| seen[k].across);
        let row = |node| table.iter_row(node).map(|(j, weight)| weight * self.head_at_rest[j]).sum();
        let mut inflow: Vec<f64> = (0..table.rows()).map(row).collect();
        for (pair, seen) in beyond.iter().zip(&seen) {
            if let Some(OpenEdge { head, cell }) = seen.open {
                let rest = cell.map_or(head, |cell| self.at_rest[cell as usize].head);
                inflow[pair.node as usize] += 2.0 * seen.across.strength * rest;
            }
        }
        for (k, cell) in self.law.cells.all.iter().enumerate() {
            let node = cell.node as usize;
            inflow[node] += match (state.holds[k], self.law.drain(k)) {
                (true, Some(open)) => open * (self.at_rest[k].head - self.head_at_rest[node]),
                (true, None) => 0.0,
                (false, _) => prescribed(self.at_rest[k]) * cell.length,
            };
        }
        (table, inflow)
    }

    /// Makes the tables of the present state: returns the exchange between nodes, m/s.
    pub fn tabulate(
        &mut self,
        conduction: &Conduction,
        inverse_volume: &[f64],
        head: &[f64],
        relative: Option<Relative>,
    ) -> Csr<f64> {
        let nodes = Nodes { head, relative: relative.map(|relative| relative.tabled) };
        let state = State { nodes, holds: &self.holds, demands: &self.now };
        let (table, mut gained) = self.exchange(conduction, &state);
        let drive = self.drive(conduction, inverse_volume, &state);
        if relative.is_some() || self.holds != self.held_at_rest {
            let nodes =
                Nodes { head: &self.head_at_rest, relative: relative.map(|relative| relative.at_rest) };
            let at_rest = State { nodes, holds: &self.held_at_rest, demands: &self.at_rest };
            let (_, then) = self.exchange(conduction, &at_rest);
            for ((now, then), inverse_volume) in gained.iter_mut().zip(then).zip(inverse_volume) {
                *now = (*now - then) * inverse_volume;
            }
        } else {
            gained.clear();
        }
        (self.drive, self.gained) = (drive, gained);
        self.drains = self.drain_cells(inverse_volume);
        table
    }

    /// What a unit of each cell's value brings to the nodes; drains aside.
    fn drive(&self, conduction: &Conduction, inverse_volume: &[f64], state: &State) -> Csr<f64> {
        let mut rows = vec![Vec::new(); inverse_volume.len()];
        for (k, pair) in conduction.beyond().iter().enumerate() {
            let Seen { across, open } = self.seen(k, pair, state);
            if let Some(OpenEdge { cell: Some(cell), .. }) = open {
                let node = pair.node as usize;
                rows[node].push((cell, 2.0 * across.strength * inverse_volume[node] / self.unit_weight));
            }
        }
        for (k, cell) in self.law.cells.all.iter().enumerate() {
            let node = cell.node as usize;
            if self.law.drain(k).is_none() && !self.holds[k] {
                rows[node].push((id(k), inverse_volume[node]));
            }
        }
        collected(rows)
    }

    fn drain_cells(&self, inverse_volume: &[f64]) -> Vec<DrainCell> {
        let of_cell = |(k, cell): (usize, &Cell)| {
            let open = self.law.drain(k)? * inverse_volume[cell.node as usize];
            Some(DrainCell { node: cell.node, cell: id(k), conductance: open / self.unit_weight })
        };
        self.law.cells.all.iter().enumerate().filter_map(of_cell).collect()
    }
}

/// The inflow that is prescribed where no head is held, m/s. A cell with a head alone never needs it.
fn prescribed(demand: Demand) -> f64 {
    if demand.inflow.is_finite() { demand.inflow } else { 0.0 }
}

/// What decides how water crosses edges.
struct State<'a> {
    nodes: Nodes<'a>,
    holds: &'a [bool],
    demands: &'a [Demand],
}

/// A drain's cell that takes water from its node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunningDrain {
    /// The node.
    pub node: usize,
    /// Excess pressure that the drain holds, kPa.
    pub pressure: f64,
    /// Inflow per difference of pressure, 1/(kPa s) of the node's volume.
    pub conductance: f64,
}

/// What nodes see across the edges of a section without conditions: water passes the ground surface alone.
pub fn open_surface(conduction: &Conduction) -> impl Fn(usize) -> Across {
    |k| {
        let pair = &conduction.beyond()[k];
        if pair.at_surface {
            Across { strength: pair.open, sign: -1.0 }
        } else {
            Across { strength: pair.closed, sign: 1.0 }
        }
    }
}
