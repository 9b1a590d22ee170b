//! Hydraulic conditions (Section 4.1) while the ground moves: excess pressure on edges, and drains.
//!
//! Excess counts from the state at rest, so a condition that already held there asks for what has changed since, and one
//! that is new for its distance from what the ground shows at its edge. Lines go with the ground.

use crate::{
    error::SolverError,
    section::{
        bins::Bins,
        description::{Model, Water},
        node_id::id,
    },
    water::{
        conditions::{Cell, Cells, Demand, HydraulicBoundary},
        conduction::{Across, Beyond, Conduction, between},
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
/// What conditions ask of the edges and of drains.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct WaterEdges {
    conditions: Vec<MovingBoundary>,
    cells: Cells,
    unit_weight: f64,
    /// Total head of the nodes at rest, m.
    head_at_rest: Vec<f64>,
    /// Elevation of the nodes at rest, m.
    elevation: Vec<f64>,
    /// What each cell asked for at rest.
    at_rest: Vec<Demand>,
    /// Whether a cell held a head at rest.
    held_at_rest: Vec<bool>,
    /// Whether it holds one.
    holds: Vec<bool>,
    /// Excess pressure on each cell that holds a head, kPa, and inflow beyond that at rest through the others, m2/s.
    value: Vec<f64>,
    /// What a unit of a cell's value brings to nodes, 1/s of their volume per kPa or m2/s.
    drive: Csr<f64>,
    /// Node and cell of drains, and inflow per excess pressure, 1/(kPa s) of the node's volume.
    drains: Vec<(u32, u32, f64)>,
    /// Nodes near the ground surface, and the cell on it above each.
    above: Vec<(u32, u32)>,
    /// Excess pressure on the ground surface above each node near it, kPa.
    surface: Vec<f64>,
    /// Whether every value stays zero.
    is_still: bool,
}

impl WaterEdges {
    /// The conditions on a section that stands where its model says.
    ///
    /// # Errors
    /// Those of [`Cells::new`].
    pub fn new(
        model: &Model,
        water: Water,
        conduction: &Conduction,
        conditions: &[MovingBoundary],
    ) -> Result<Self, SolverError> {
        let boundaries: Vec<_> = conditions.iter().map(|condition| condition.boundary.clone()).collect();
        let cells = Cells::new(model, &model.position, &boundaries, conduction.beyond())?;
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
        let at_rest = cells.all.iter().enumerate().map(shown).collect();
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
            cells,
            unit_weight: water.unit_weight,
            elevation: model.position.iter().map(|at| at.y).collect(),
            head_at_rest: head,
            at_rest,
            held_at_rest: Vec::new(),
            holds: vec![true; count],
            value: vec![0.0; count],
            drive: Csr::default(),
            drains: Vec::new(),
            above,
            surface: Vec::new(),
            is_still: false,
        };
        let head = edges.head_at_rest.clone();
        let held = |(cell, demand): (&Cell, &Demand)| is_held(demand, cell, &|node| head[node]);
        edges.held_at_rest = edges.cells.all.iter().zip(&edges.at_rest).map(held).collect();
        for (k, held) in edges.held_at_rest.iter_mut().enumerate() {
            *held &= edges.conditions[edges.cells.all[k].boundary].at_rest.is_some();
        }
        edges.switch(0.0, &|node| head[node]);
        edges.look_up(0.0);
        let goes_on = |condition: &MovingBoundary| {
            condition.at_rest.is_some() && condition.boundary.condition.is_constant()
        };
        edges.is_still = edges.conditions.iter().all(goes_on) && edges.value.iter().all(|v| *v == 0.0);
        if !edges.is_still {
            edges.surface = vec![0.0; model.nodes()];
            edges.show_surface();
        }
        Ok(edges)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.cells.bytes()
            + self.drive.bytes()
            + 2 * size_of_val(self.elevation.as_slice())
            + size_of_val(self.surface.as_slice())
    }

    /// Whether a condition lets no water through the ground surface above a node but what it prescribes.
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
        let runs = |&&(_, cell, _): &&(u32, u32, f64)| self.holds[cell as usize];
        self.drains.iter().filter(runs).map(|&(node, cell, conductance)| RunningDrain {
            node: node as usize,
            pressure: self.value[cell as usize],
            conductance,
        })
    }

    /// Water that conditions bring to a node beyond that at rest, 1/s of its volume; drains aside.
    #[inline]
    pub fn inflow(&self, node: usize) -> f64 {
        if self.is_still {
            return 0.0;
        }
        self.drive.iter_row(node).map(|(cell, weight)| weight * self.value[cell]).sum()
    }

    /// What the conditions ask for at a time, s.
    pub fn look_up(&mut self, time: f64) {
        let unit_weight = self.unit_weight;
        if self.is_still {
            return;
        }
        for (k, cell) in self.cells.all.iter().enumerate() {
            let condition = &self.conditions[cell.boundary].boundary.condition;
            let now = condition.demand(condition.value(time), cell.middle.y, cell.slope, unit_weight);
            let rest = self.at_rest[k];
            self.value[k] = if self.holds[k] {
                unit_weight * (now.head - rest.head)
            } else {
                // What was held at rest let through what the state at rest lets through still; what is to hold a head does so
                // when it is next looked at.
                let finite = |inflow: f64| if inflow.is_finite() { inflow } else { 0.0 };
                (finite(now.inflow) - finite(rest.inflow)) * cell.length
            };
        }
        self.show_surface();
    }

    fn show_surface(&mut self) {
        if self.surface.is_empty() {
            return;
        }
        for &(node, cell) in &self.above {
            let cell = cell as usize;
            self.surface[node as usize] = if self.holds[cell] { self.value[cell] } else { 0.0 };
        }
    }

    /// Lets one-sided conditions hold where water stands at the edge, and go where there is suction. `head` is the present
    /// total head of the nodes, m. Returns whether one changed.
    pub fn switch(&mut self, time: f64, head: &dyn Fn(usize) -> f64) -> bool {
        let mut switched = false;
        for (cell, holds) in self.cells.all.iter().zip(&mut self.holds) {
            let condition = &self.conditions[cell.boundary].boundary.condition;
            let asked = condition.demand(condition.value(time), cell.middle.y, cell.slope, self.unit_weight);
            let wanted = is_held(&asked, cell, head);
            switched |= wanted != *holds;
            *holds = wanted;
        }
        switched
    }

    /// Goes with the ground to a new geometry.
    pub fn follow(&mut self, conduction: &Conduction, displacement: impl Fn(u32) -> Vec2) {
        self.cells.assign(conduction.beyond(), displacement);
    }

    /// What the node of the pair `k` sees beyond the edge in a state.
    fn seen(&self, k: usize, pair: &Beyond, state: &State) -> Seen {
        let (i, j) = (pair.node as usize, pair.owner as usize);
        let (mut sign, mut held, mut head) = (1.0, None, 0.0);
        for (place, (cell, crossing)) in self.cells.of_pair[k].iter().zip(&pair.crossings).enumerate() {
            let open = match (cell, crossing) {
                (Some(cell), _) => {
                    let cell = *cell as usize;
                    let value = if state.is_rest { 0.0 } else { self.value[cell] / self.unit_weight };
                    state.holds[cell].then(|| self.at_rest[cell].head + value)
                }
                // Ground without a condition is open where water stands in it.
                (None, Some(crossing)) if place == 0 && pair.at_surface => {
                    let is_wet = state.relative.is_none() || self.head_at_rest[j] >= self.elevation[j];
                    (is_wet || (state.head)(j) >= crossing.foot.y)
                        .then(|| crossing.foot.y.max(if is_wet { self.head_at_rest[j] } else { 0.0 }))
                }
                _ => None,
            };
            if let Some(open) = open {
                (sign, held, head) = (-sign, *cell, open);
            }
        }
        let soil = state.relative.map_or(1.0, |relative| between(relative, i, j));
        if sign > 0.0 {
            return Seen { across: Across { strength: pair.closed * soil, sign }, head: 0.0, cell: None };
        }
        // Water that comes in through an edge under pressure finds it full.
        let enters = 2.0 * head > (state.head)(i) + (state.head)(j);
        let strength = pair.open * if enters { 1.0 } else { soil };
        Seen { across: Across { strength, sign }, head, cell: held }
    }

    /// The exchange of water under these conditions, m/s, and what heads at rest bring to each node, m2/s. Conductivities
    /// of partly saturated soil are `relative`.
    fn exchange(&self, conduction: &Conduction, state: &State) -> (Csr<f64>, Vec<f64>) {
        let seen: Vec<Seen> =
            (0..conduction.beyond().len()).map(|k| self.seen(k, &conduction.beyond()[k], state)).collect();
        let table = conduction.exchange(state.relative, |k| seen[k].across);
        let row = |node| table.iter_row(node).map(|(j, weight)| weight * self.head_at_rest[j]).sum();
        let mut inflow: Vec<f64> = (0..table.rows()).map(row).collect();
        for (pair, seen) in conduction.beyond().iter().zip(&seen) {
            if seen.across.sign < 0.0 {
                let rest = seen.cell.map_or(seen.head, |cell| self.at_rest[cell as usize].head);
                inflow[pair.node as usize] += 2.0 * seen.across.strength * rest;
            }
        }
        (table, inflow)
    }

    /// Tables for the present state: the exchange between nodes, m/s, and what the heads at rest bring beyond what they
    /// brought at rest, m2/s, by conductivities that have changed since.
    pub fn tables(
        &mut self,
        model: &Model,
        conduction: &Conduction,
        inverse_volume: &[f64],
        moisture: Option<[&[f64]; 2]>,
        head: &dyn Fn(usize) -> f64,
    ) -> (Csr<f64>, Option<Vec<f64>>) {
        let unit_weight = self.unit_weight;
        let state =
            State { is_rest: false, relative: moisture.map(|[now, _]| now), holds: &self.holds, head };
        let (table, mut inflow) = self.exchange(conduction, &state);
        let gained = moisture.map(|[_, then]| {
            let at_rest = |node: usize| self.head_at_rest[node];
            let state =
                State { is_rest: true, relative: Some(then), holds: &self.held_at_rest, head: &at_rest };
            let (_, then) = self.exchange(conduction, &state);
            inflow.iter_mut().zip(then).for_each(|(now, then)| *now -= then);
            inflow
        });
        let mut drive = vec![Vec::new(); inverse_volume.len()];
        for (k, pair) in conduction.beyond().iter().enumerate() {
            let Seen { across, cell, .. } = self.seen(k, pair, &state);
            if let Some(cell) = cell {
                let node = pair.node as usize;
                drive[node].push((cell, 2.0 * across.strength * inverse_volume[node] / unit_weight));
            }
        }
        self.drains.clear();
        for (k, cell) in self.cells.all.iter().enumerate() {
            let node = cell.node as usize;
            if self.conditions[cell.boundary].boundary.condition.is_inside() {
                let soil = model.regions[model.region[node] as usize].hydraulic_conductivity.minor;
                let open = cell.drain_conductance(soil, model.spacing.y) * inverse_volume[node];
                self.drains.push((cell.node, id(k), open / unit_weight));
            } else if !self.holds[k] {
                drive[node].push((id(k), inverse_volume[node]));
            }
        }
        self.drive = Csr::with_capacity(drive.len(), drive.iter().map(Vec::len).sum());
        for mut row in drive {
            self.drive.push_row(&mut row);
        }
        (table, gained)
    }
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

/// Whether a cell holds its head while the nodes have theirs, m.
fn is_held(demand: &Demand, cell: &Cell, head: &dyn Fn(usize) -> f64) -> bool {
    demand.inflow.is_infinite() || (demand.head.is_finite() && head(cell.node as usize) >= demand.head)
}

/// What decides how water crosses edges.
struct State<'a> {
    is_rest: bool,
    relative: Option<&'a [f64]>,
    holds: &'a [bool],
    head: &'a dyn Fn(usize) -> f64,
}

/// What a node sees beyond an edge.
#[derive(Clone, Copy)]
struct Seen {
    across: Across,
    /// Head on the edge, if one stands there, m.
    head: f64,
    /// The cell that asks for it; none where the ground is open by itself.
    cell: Option<u32>,
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
