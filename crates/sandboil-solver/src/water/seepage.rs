//! Flow of pore water through a skeleton at rest: Eq. 3 without its velocity, saturated or not.
//!
//! Water is stored by the air that leaves the pores, by compression of the water, and by expansion of the skeleton.
//!
//! In time: backward Euler in the mixed form, which keeps the water content itself, so that no water is lost however
//! long the steps (Celia, Bouloutas and Zarba 1990, Water Resour. Res. 26). A steady state knows no storage: it is
//! found without time, by solving for the heads and following them with the conductivities.

use crate::{
    error::SolverError,
    linear::{
        banded::BandedLu,
        conjugate_gradients::{Limits, Norm, conjugate_gradients},
    },
    section::{
        description::{Model, Operators, STRESS_NODES, Water, positive},
        node_id::id,
        order::sorted,
        stress_layout::{StressLayout, check_stress},
    },
    water::{
        conditions::{Cell, Cells, Demand, HydraulicBoundary},
        conduction::{Across, Conduction, Rows, between, collected, static_conduction},
        edge_law::{EdgeLaw, Nodes, OpenEdge},
    },
};
use sandboil_soil::{Moisture, Stress, VanGenuchten};
use sandboil_sph::Vec2;

/// Smoothing length over the spacing of the exchange between nodes beside the dual lattice.
const SMOOTHING_RATIO: f64 = 1.4;
/// Change of head in an iteration at which a step is solved, in spacings: Newton's next would be its square.
pub const HEAD_TOLERANCE: f64 = 1e-6;
/// Iterations, inner or outer, after which a step is repeated with a shorter length.
pub const MOST_ITERATIONS: u32 = 50;
/// Iterations along the retention curve itself after which a step is solved by the nested ones.
pub const DIRECT_ITERATIONS: u32 = 12;
/// Error of a transient step that is aimed at unless another is given: of the degree of saturation, and of heads over the
/// range of all heads.
pub const TOLERANCE: f64 = 0.002;
/// Change of the degree of saturation anywhere that a transient step aims at, over the tolerance: conductivities lag by one
/// step.
pub const CHANGE_FOR_ERROR: f64 = 10.0;
/// Estimate over the aim beyond which a step is taken back.
pub const REJECTED: f64 = 3.0;
/// Growth of a transient step: faster growth overshoots fronts and has to go back.
pub const GROWTH: f64 = 1.5;
/// What is left at least of a step that changed too much, or could not be solved.
pub const CUT: f64 = 0.4;
/// Switches of a cell within one step after which it stays as it is: two states that each call for the other differ by
/// less than the tolerance of the iteration.
pub const MOST_SWITCHES: u32 = 4;
/// Change of head in an iteration at which a state is steady, in spacings: flows then change in their sixth figure.
pub const STEADY_TOLERANCE: f64 = 1e-3;
/// Change of relative conductivity that a steady state may leave.
pub const STEADY_CONDUCTIVITY: f64 = 1e-3;
/// Iterations after which the search for a steady state gives up.
pub const MOST_STEADY_ITERATIONS: u64 = 1000;
/// Share of its change that a conductivity follows at first; conductivities that swing follow ever less, others more.
pub const FOLLOWED: f64 = 0.5;
/// Factor on the share of one that swings.
pub const CALMED: f64 = 0.5;
/// Factor on the share of one that does not.
pub const TRUSTED: f64 = 1.1;
/// Time over that in which the most permeable soil moves water by a spacing, in which even impermeable
/// soil keeps its pressure: it makes the equations of such soil solvable.
pub const AGES: f64 = 1e9;
/// Iterations of the conjugate gradients after which the preconditioner is renewed.
pub const STALE_AFTER: usize = 25;
/// Iterations after which a system has no solution: with fresh factors they go with the root of the anisotropy.
pub const MOST_GRADIENTS: usize = 500;
/// Residual of the conjugate gradients over that at their start: an iteration of a time step is to leave nothing.
pub const STEP_TOLERANCE: f64 = 1e-10;
/// The same on the way to a steady state, where the next iteration takes up what is left.
pub const APPROACH_TOLERANCE: f64 = 1e-3;
/// How far the flow goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Until {
    /// For so long, s.
    Time(f64),
    /// Until nothing changes any more.
    Steady,
}

/// Totals since the start.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WaterBalance {
    /// Inflow through each boundary, m3 per m.
    pub inflow: Vec<f64>,
    /// Increase of the stored water, m3 per m.
    pub stored: f64,
}

/// Work done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SeepageCounters {
    /// Steps.
    pub steps: u64,
    /// Steps tried and given up.
    pub rejected: u64,
    /// Iterations of all steps.
    pub iterations: u64,
    /// Evaluations of retention curves.
    pub retention_calls: u64,
    /// Factors made of the matrix.
    pub factorings: u64,
}

/// Pore water of a section at rest. Arrays that leave are in the user's node order.
#[derive(Debug)]
pub struct Seepage {
    water: Water,
    order: Vec<usize>,
    position: Vec<Vec2>,
    spacing: f64,
    volume: Vec<f64>,
    porosity: Vec<f64>,
    retention: Vec<Option<VanGenuchten>>,
    conductivity: Vec<f64>,
    /// Compliance `1/M` of the skeleton of each node in confined compression, 1/kPa; zero: rigid.
    compliance: Vec<f64>,
    conduction: Conduction,
    boundaries: Vec<HydraulicBoundary>,
    law: EdgeLaw,
    /// Whether a cell holds a head.
    holds: Vec<bool>,
    head: Vec<f64>,
    moisture: Vec<Moisture>,
    /// Inflow through each cell at the end of the last step, m2/s.
    flow: Vec<f64>,
    /// Rates of head (m/s) and saturation (1/s) in the last step.
    rate: Vec<[f64; 2]>,
    /// Heads at the start and those of the conditions at any time lie within such a range, m; at least a spacing.
    head_range: f64,
    /// Error of a step that is aimed at.
    tolerance: f64,
    time: f64,
    dt: f64,
    following: Option<Following>,
    balance: WaterBalance,
    counters: SeepageCounters,
    preconditioner: Option<BandedLu>,
}

/// Relative conductivities on their way to those of a steady state.
#[derive(Debug, Clone)]
pub struct Following {
    relative: Vec<f64>,
    /// Share of its change that each follows.
    share: Vec<f64>,
    /// Last change of each.
    change: Vec<f64>,
    arrived: bool,
}

/// The state at the beginning of a step, s long, and its end, s.
pub struct Begun {
    head: Vec<f64>,
    moisture: Vec<Moisture>,
    relative: Vec<f64>,
    dt: f64,
    end: f64,
}

/// A linear system of one iteration: inflow of node `i` is `sum_j a_ij H_j + constant_i`, m2/s.
pub struct Inflow {
    rows: Rows,
    constant: Vec<f64>,
}

impl Seepage {
    /// The section of a model at the given pore pressures (kPa, user's order), under conditions on its edges.
    ///
    /// # Errors
    /// Bad input, a dry model.
    pub fn new(
        model: &Model,
        pore_pressure: &[f64],
        boundaries: Vec<HydraulicBoundary>,
    ) -> Result<Self, SolverError> {
        model.validate()?;
        check_stress(model)?;
        let Some(water) = model.water else {
            return Err(SolverError::Order { call: "seepage", needs: "a model with water" });
        };
        let (found, expected) = (pore_pressure.len(), model.nodes());
        if found != expected {
            return Err(SolverError::Shape { name: "pore_pressure", found, expected });
        }
        let (mut model, order) = sorted(model);
        if model.numerics.operators == Operators::Dual {
            // Seepage flows between nodes, for which the ratio of the dual lattice is too small.
            model.numerics.smoothing_ratio = SMOOTHING_RATIO;
        }
        let conduction = static_conduction(&model);
        let cells = Cells::new(&model, &model.position, &boundaries, conduction.beyond())?;
        let law = EdgeLaw::new(&model, cells, |boundary| &boundaries[boundary].condition);
        let of_region = |value: &dyn Fn(&crate::section::description::Region) -> f64| -> Vec<f64> {
            model.region.iter().map(|&region| value(&model.regions[region as usize])).collect()
        };
        let head = order
            .iter()
            .zip(&model.position)
            .map(|(&user, at)| at.y + pore_pressure[user] / water.unit_weight);
        let mut seepage = Self {
            water,
            spacing: model.spacing.y,
            volume: model.volume.clone(),
            porosity: of_region(&|region| region.porosity),
            conductivity: of_region(&|region| region.hydraulic_conductivity.minor),
            retention: model.region.iter().map(|&region| model.regions[region as usize].retention).collect(),
            compliance: vec![0.0; model.nodes()],
            holds: vec![false; law.cells.all.len()],
            flow: vec![0.0; law.cells.all.len()],
            head: head.collect(),
            moisture: vec![Moisture::SATURATED; model.nodes()],
            rate: vec![[0.0; 2]; model.nodes()],
            head_range: 0.0,
            tolerance: TOLERANCE,
            time: 0.0,
            dt: 0.0,
            following: None,
            balance: WaterBalance { inflow: vec![0.0; boundaries.len()], stored: 0.0 },
            counters: SeepageCounters::default(),
            preconditioner: None,
            position: model.position,
            order,
            conduction,
            boundaries,
            law,
        };
        seepage.head_range = seepage.range_of_heads().max(seepage.spacing);
        seepage.dt = seepage.first_step();
        seepage.moisture = seepage.moisture_at(&seepage.head.clone());
        seepage.begin_cells();
        Ok(seepage)
    }

    /// The same flow through a skeleton that expands with the pressure of its water under a constant total vertical
    /// stress, by the small-strain moduli of its soils under the effective stress at rest: the stiffness with which
    /// the same soils consolidate when they move. A steady state does not depend on it.
    ///
    /// # Errors
    /// [`SolverError::Soil`] where a soil refuses the stress.
    pub fn with_expanding_skeleton(mut self, model: &Model) -> Result<Self, SolverError> {
        let layout = StressLayout::new(model);
        for (compliance, &node) in self.compliance.iter_mut().zip(&self.order) {
            *compliance = confined_modulus(model, &layout, node)?.recip();
        }
        Ok(self)
    }

    /// The same flow in time with another error of a step that is aimed at, of saturations and of heads over their range.
    ///
    /// # Errors
    /// A tolerance that is not positive.
    pub fn with_tolerance(self, tolerance: f64) -> Result<Self, SolverError> {
        positive("tolerance", tolerance)?;
        Ok(Self { tolerance, ..self })
    }

    /// A step in which the most permeable soil moves water by a spacing.
    fn first_step(&self) -> f64 {
        let fastest = self.conductivity.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        self.spacing / fastest
    }

    /// Continues until the end or until `go_on`, asked after every step with their number, says no. Returns whether the end
    /// is reached.
    ///
    /// # Errors
    /// [`SolverError::Seepage`] when no step, however short, can be solved.
    pub fn advance(&mut self, until: Until, mut go_on: impl FnMut(u64) -> bool) -> Result<bool, SolverError> {
        if let Until::Time(end) = until {
            positive("duration", end)?;
        }
        let mut begun = false;
        loop {
            let arrived = match until {
                Until::Time(end) => self.time >= end * (1.0 - f64::EPSILON),
                Until::Steady => self.following.as_ref().is_some_and(|following| following.arrived),
            };
            if arrived || (begun && !go_on(self.counters.steps)) {
                return Ok(arrived);
            }
            match until {
                Until::Time(end) => self.step(end - self.time)?,
                Until::Steady => self.approach_steady()?,
            }
            begun = true;
        }
    }

    /// Heads for the present conductivities without storage, and conductivities that follow them.
    fn approach_steady(&mut self) -> Result<(), SolverError> {
        let nodes = self.head.len();
        let mut following = self.following.take().unwrap_or_else(|| Following {
            relative: self.moisture.iter().map(|moisture| moisture.relative_conductivity).collect(),
            share: vec![FOLLOWED; nodes],
            change: vec![0.0; nodes],
            arrived: false,
        });
        let failed = |reason| SolverError::Seepage { time: self.time, reason };
        let (not_found, unsolved) =
            (failed("no steady state is found"), failed("the heads cannot be solved for"));
        if self.counters.steps > MOST_STEADY_ITERATIONS {
            return Err(not_found);
        }
        let before = self.head.clone();
        let mut switches = vec![0_u32; self.holds.len()];
        let ages = AGES * self.first_step();
        let storage: Vec<f64> =
            (0..nodes).map(|i| self.compressibility(i, &Moisture::SATURATED) / ages).collect();
        for _ in 0..MOST_ITERATIONS {
            let mut inflow = self.inflow(0.0, &following.relative);
            let along = self.flow_along(&following.relative, &self.head);
            for ((left, row), along) in inflow.constant.iter_mut().zip(&inflow.rows).zip(along) {
                *left += along + row.iter().map(|&(j, a)| a * self.head[j as usize]).sum::<f64>();
            }
            self.counters.iterations += 1;
            let solved = self.solve_linear(
                inflow.rows,
                &following.relative,
                &storage,
                &inflow.constant,
                APPROACH_TOLERANCE,
            );
            let change = solved.ok_or_else(|| unsolved.clone())?;
            for (head, change) in self.head.iter_mut().zip(&change) {
                *head += change;
            }
            // Between switches the heads follow from one linear system.
            if !self.switch_cells(0.0, &following.relative, &mut switches) {
                break;
            }
        }
        self.inflow(0.0, &following.relative);
        self.moisture = self.moisture_at(&self.head.clone());
        let moved = self.head.iter().zip(&before).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
        following.arrived = moved <= STEADY_TOLERANCE * self.spacing;
        for (i, moisture) in self.moisture.iter().enumerate() {
            let wanted = moisture.relative_conductivity;
            following.arrived &= (wanted - following.relative[i]).abs() <= STEADY_CONDUCTIVITY;
            // Conductivities differ by orders of magnitude: they follow in proportion.
            let change = (wanted / following.relative[i]).ln();
            let factor = if change * following.change[i] < 0.0 { CALMED } else { TRUSTED };
            following.share[i] = (following.share[i] * factor).min(1.0);
            following.relative[i] *= (following.share[i] * change).exp();
            following.change[i] = change;
        }
        self.following = Some(following);
        self.counters.steps += 1;
        Ok(())
    }

    /// One step of at most `left` seconds.
    fn step(&mut self, left: f64) -> Result<(), SolverError> {
        // Conditions change at the corners of their series: no step goes over one.
        let corners = self.boundaries.iter().filter_map(|b| b.condition.next_after(self.time));
        let longest = corners.map(|corner| corner - self.time).fold(left, f64::min);
        let shortest = self.first_step() * f64::EPSILON;
        loop {
            let dt = self.dt.min(longest);
            let before = (self.head.clone(), self.moisture.clone(), self.holds.clone());
            let solved = self.solve(dt, self.time + dt).then(|| self.excess(&before.0, &before.1, dt));
            if let Some(excess) = solved.filter(|excess| *excess <= REJECTED) {
                for (cell, flow) in self.law.cells.all.iter().zip(&self.flow) {
                    self.balance.inflow[cell.boundary] += flow * dt;
                }
                self.balance.stored +=
                    (0..self.head.len()).map(|i| self.gained(i, &before.0, &before.1)).sum::<f64>();
                self.rate = self.rates(&before.0, &before.1, dt);
                self.time += dt;
                self.counters.steps += 1;
                let next = dt * excess.max(f64::MIN_POSITIVE).recip().clamp(CUT, GROWTH);
                // A step shortened by a corner of a series does not limit the next step.
                self.dt = if dt < self.dt { next.max(self.dt) } else { next };
                return Ok(());
            }
            (self.head, self.moisture, self.holds) = before;
            self.counters.rejected += 1;
            self.dt = dt * CUT;
            if self.dt < shortest {
                return Err(SolverError::Seepage { time: self.time, reason: "no step can be solved" });
            }
        }
    }

    /// Largest difference between heads at present and heads that conditions prescribe at any time, m.
    fn range_of_heads(&self) -> f64 {
        let prescribed = self.law.cells.all.iter().flat_map(|cell| {
            let condition = &self.boundaries[cell.boundary].condition;
            let demand = |&value| condition.demand(value, cell.middle.y, cell.slope, self.water.unit_weight);
            condition.values().iter().map(move |value| demand(value).head)
        });
        let heads = prescribed.filter(|head| head.is_finite()).chain(self.head.iter().copied());
        let (low, high) =
            heads.fold((f64::MAX, f64::MIN), |(low, high), head| (low.min(head), high.max(head)));
        high - low
    }

    /// Rates of head and saturation of a step, m/s and 1/s.
    fn rates(&self, head: &[f64], moisture: &[Moisture], dt: f64) -> Vec<[f64; 2]> {
        let now = self.head.iter().zip(&self.moisture);
        let rate = |((now, wet), (then, was)): ((&f64, &Moisture), (&f64, &Moisture))| {
            [(now - then) / dt, (wet.saturation - was.saturation) / dt]
        };
        now.zip(head.iter().zip(moisture)).map(rate).collect()
    }

    /// The larger of two ratios to their aims that decide the length of a step: of its error, and of the change of
    /// saturation. The error of backward Euler is half the step times the change of the rate since the last step
    /// (Kavetski, Binning and Sloan 2001, Adv. Water Resour. 24); that of a head counts where pores stay full.
    fn excess(&self, head: &[f64], moisture: &[Moisture], dt: f64) -> f64 {
        let (mut error, mut change) = (0.0_f64, 0.0_f64);
        for (i, [rise, wetting]) in self.rates(head, moisture, dt).into_iter().enumerate() {
            let [rose, wetted] = self.rate[i];
            error = error.max(0.5 * dt * (wetting - wetted).abs());
            change = change.max(dt * wetting.abs());
            let is_full = self.moisture[i].saturation.min(moisture[i].saturation) >= 1.0;
            if is_full {
                error = error.max(0.5 * dt * (rise - rose).abs() / self.head_range);
            }
        }
        let part = error / self.tolerance;
        part.sqrt().max(change / (CHANGE_FOR_ERROR * self.tolerance))
    }

    /// Time since the start, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Total head of every node, m.
    pub fn head(&self) -> Vec<f64> {
        self.in_user_order(|i| self.head[i])
    }

    /// Pore pressure of every node, kPa, compression positive; suction is negative.
    pub fn pore_pressure(&self) -> Vec<f64> {
        self.in_user_order(|i| self.water.unit_weight * (self.head[i] - self.position[i].y))
    }

    /// Degree of saturation of every node.
    pub fn saturation(&self) -> Vec<f64> {
        self.in_user_order(|i| self.moisture[i].saturation)
    }

    fn in_user_order(&self, value: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut values = vec![0.0; self.order.len()];
        for (i, &user) in self.order.iter().enumerate() {
            values[user] = value(i);
        }
        values
    }

    /// Inflow through each boundary at the end of the last step, m3/s per m.
    pub fn discharge(&self) -> Vec<f64> {
        let mut discharge = vec![0.0; self.boundaries.len()];
        for (cell, flow) in self.law.cells.all.iter().zip(&self.flow) {
            discharge[cell.boundary] += flow;
        }
        discharge
    }

    /// Middles of the cells of a boundary through which water flows, and the flow through each, m3/s per m.
    pub fn outlets(&self, boundary: usize) -> Vec<(Vec2, f64)> {
        let cells = self.law.cells.all.iter().zip(&self.flow);
        cells.filter(|(cell, _)| cell.boundary == boundary).map(|(cell, flow)| (cell.middle, *flow)).collect()
    }

    /// Whether each cell holds a head.
    #[cfg(test)]
    pub fn holds(&self) -> &[bool] {
        &self.holds
    }

    /// Totals since the start.
    pub fn balance(&self) -> &WaterBalance {
        &self.balance
    }

    /// Work done.
    pub fn counters(&self) -> SeepageCounters {
        self.counters
    }

    /// Names and bytes of the arrays that exist.
    pub fn arrays(&self) -> Vec<(&'static str, usize)> {
        let mut arrays = vec![
            ("conduction", self.conduction.bytes()),
            ("pore_pressure", 3 * size_of_val(self.head.as_slice()) + size_of_val(self.moisture.as_slice())),
        ];
        if let Some(factors) = &self.preconditioner {
            arrays.push(("factors", factors.bytes()));
        }
        arrays
    }

    /// Present time step, s.
    pub fn time_step(&self) -> f64 {
        self.dt
    }

    /// Water that node `i` has gained since a state, m3 per m.
    fn gained(&self, i: usize, head: &[f64], moisture: &[Moisture]) -> f64 {
        let pores = self.volume[i] * self.porosity[i];
        let swelling = self.compressibility(i, &moisture[i]) * (self.head[i] - head[i]);
        pores * (self.moisture[i].saturation - moisture[i].saturation) + swelling
    }

    /// Water that node `i` takes up per metre of head at a constant saturation, m2 per m:
    /// `V gamma_f (S_r n / K_f + S_r^2 / M)`. The skeleton carries `S_r p` (Bishop), and the part `S_r` of the pores that
    /// its expansion opens fills with water.
    fn compressibility(&self, i: usize, moisture: &Moisture) -> f64 {
        let water = self.porosity[i] / self.water.bulk_modulus;
        let skeleton = moisture.saturation * self.compliance[i];
        self.volume[i] * moisture.saturation * self.water.unit_weight * (water + skeleton)
    }

    fn moisture_at(&mut self, head: &[f64]) -> Vec<Moisture> {
        self.retention
            .iter()
            .zip(head.iter().zip(&self.position))
            .map(|(retention, (head, at))| match retention {
                None => Moisture::SATURATED,
                Some(curve) => {
                    self.counters.retention_calls += 1;
                    curve.at(head - at.y)
                }
            })
            .collect()
    }

    /// Solves one backward Euler step to `end`, s. Returns whether it was solved.
    ///
    /// Conductivities are those at the start of the step. What is left is monotone in the heads, and two nested Newton
    /// iterations find its solution from anywhere (Casulli and Zanolli 2010, SIAM J. Sci. Comput. 32): the retention
    /// curve is the difference of two curves that steepen as they rise, of which the outer iteration follows one and the
    /// inner the other. A step from which little changes follows the retention curve itself, and needs no nesting.
    fn solve(&mut self, dt: f64, end: f64) -> bool {
        let begun = Begun {
            head: self.head.clone(),
            relative: self.moisture.iter().map(|moisture| moisture.relative_conductivity).collect(),
            moisture: self.moisture.clone(),
            dt,
            end,
        };
        let holds = self.holds.clone();
        let mut switches = vec![0_u32; self.holds.len()];
        let mut solved = self.newton(&begun, None, &mut switches, DIRECT_ITERATIONS);
        if !solved {
            self.holds = holds;
            switches.fill(0);
            // The first outer iterate is where only the inner curve bends.
            for ((k, head), at) in self.head.iter_mut().enumerate().zip(&self.position) {
                *head = begun.head[k]
                    .min(self.retention[k].map_or(f64::INFINITY, |curve| at.y + curve.steepest()));
            }
            for _ in 0..MOST_ITERATIONS {
                let outer = self.head.clone();
                if !self.newton(&begun, Some(&outer), &mut switches, MOST_ITERATIONS) {
                    return false;
                }
                let moved =
                    self.head.iter().zip(&outer).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
                if moved < HEAD_TOLERANCE * self.spacing {
                    solved = true;
                    break;
                }
            }
        }
        if solved {
            self.inflow(end, &begun.relative);
            self.moisture = self.moisture_at(&self.head.clone());
        }
        solved
    }

    /// Newton's iteration for the heads at the end of a step, along the outer curve's tangent at `outer`, or along the
    /// retention curve itself. Returns whether it settled.
    fn newton(&mut self, begun: &Begun, outer: Option<&[f64]>, switches: &mut [u32], most: u32) -> bool {
        let Begun { head: start, moisture: wet, relative, dt, end } = begun;
        for _ in 0..most {
            let switched = self.switch_cells(*end, relative, switches);
            let mut inflow = self.inflow(*end, relative);
            let along = self.flow_along(relative, &self.head);
            let (mut storage, mut largest) = (vec![0.0; self.head.len()], 0.0_f64);
            for (i, storage) in storage.iter_mut().enumerate() {
                let pores = self.volume[i] * self.porosity[i];
                let own = self.head[i];
                let (content, slope) = self.content(i, own, outer.map_or(own, |outer| outer[i]));
                let squeezed = self.compressibility(i, &wet[i]);
                let gained = pores * (content - wet[i].saturation) + squeezed * (own - start[i]);
                let row = inflow.rows[i].iter();
                let into = along[i] + row.map(|&(j, a)| a * self.head[j as usize]).sum::<f64>();
                inflow.constant[i] += into - gained / dt;
                *storage = (pores * slope + squeezed) / dt;
                largest = largest.max((inflow.constant[i] * dt / pores).abs());
            }
            if !largest.is_finite() {
                return false;
            }
            self.counters.iterations += 1;
            let left = &inflow.constant;
            let Some(change) = self.solve_linear(inflow.rows, relative, &storage, left, STEP_TOLERANCE)
            else {
                return false;
            };
            for (head, change) in self.head.iter_mut().zip(&change) {
                *head += change;
            }
            let moved = change.iter().fold(0.0_f64, |most, c| most.max(c.abs()));
            if moved < HEAD_TOLERANCE * self.spacing && !switched {
                return true;
            }
        }
        false
    }

    /// Degree of saturation of node `i` at a head by its inner curve, and by the tangent of its outer curve at `outer`;
    /// and the slope, 1/m.
    fn content(&mut self, i: usize, head: f64, outer: f64) -> (f64, f64) {
        let Some(curve) = self.retention[i] else { return (1.0, 0.0) };
        if head == outer {
            self.counters.retention_calls += 1;
            let Moisture { saturation, capacity, .. } = curve.at(head - self.position[i].y);
            return (saturation, capacity);
        }
        self.counters.retention_calls += 2;
        let steepest = curve.steepest();
        let peak = curve.at(steepest);
        // The inner curve continues along its steepest tangent, where the true one becomes flatter.
        let inner = |head: f64| {
            let pressure_head = head - self.position[i].y;
            let moisture = curve.at(pressure_head.min(steepest));
            let beyond = (pressure_head - steepest).max(0.0);
            (moisture.saturation + peak.capacity * beyond, moisture.capacity)
        };
        let at_outer = curve.at(outer - self.position[i].y);
        let (content, slope) = inner(head);
        let (outer_content, outer_slope) = inner(outer);
        let bend = outer_slope - at_outer.capacity;
        (content - (outer_content - at_outer.saturation) - bend * (head - outer), slope - bend)
    }

    /// Inflow that follows the gradient at stress nodes, whose conductivities are those of their nodes, m2/s.
    fn flow_along(&self, relative: &[f64], head: &[f64]) -> Vec<f64> {
        let mut inflow = vec![0.0; head.len()];
        self.conduction.flow_along(head, |s| relative[s / STRESS_NODES], &mut inflow);
        inflow
    }

    /// Inflow of every node at the present heads' conductivities. Fills the cells' flow.
    fn inflow(&mut self, time: f64, relative: &[f64]) -> Inflow {
        let mut rows = self.conduction.pair_rows(|i, j| between(relative, i, j));
        let mut constant = vec![0.0; self.head.len()];
        self.flow.fill(0.0);
        let demands = self.demands(time);
        let nodes = Nodes { head: &self.head, relative: Some(relative) };
        for (k, pair) in self.conduction.beyond().iter().enumerate() {
            let (i, j) = (pair.node as usize, pair.owner as usize);
            let seen = self.law.seen(pair, self.law.held(k, &self.holds, &demands), nodes);
            let Across { strength, sign } = seen.across;
            if let Some(OpenEdge { head, cell: Some(cell) }) = seen.open {
                self.flow[cell as usize] += strength * (sign * self.head[j] + 2.0 * head - self.head[i]);
            }
            rows[i].push((pair.owner, sign * strength));
            rows[i].push((pair.node, -strength));
            constant[i] += seen.constant();
        }
        for (k, cell) in self.law.cells.all.iter().enumerate() {
            let i = cell.node as usize;
            match (self.holds[k], self.law.drain(k)) {
                (true, Some(open)) => {
                    let head = demands[k].head;
                    rows[i].push((cell.node, -open));
                    constant[i] += open * head;
                    self.flow[k] = open * (head - self.head[i]);
                }
                (true, None) => {}
                (false, _) => {
                    let flow = demands[k].inflow * cell.length;
                    constant[i] += flow;
                    self.flow[k] = flow;
                }
            }
        }
        Inflow { rows, constant }
    }

    fn demands(&self, time: f64) -> Vec<Demand> {
        let demand = |cell: &Cell| {
            let condition = &self.boundaries[cell.boundary].condition;
            condition.demand(condition.value(time), cell.middle.y, cell.slope, self.water.unit_weight)
        };
        self.law.cells.all.iter().map(demand).collect()
    }

    fn begin_cells(&mut self) {
        let mut switches = vec![0; self.holds.len()];
        let relative: Vec<f64> = self.moisture.iter().map(|m| m.relative_conductivity).collect();
        self.switch_cells(0.0, &relative, &mut switches);
    }

    /// Switches cells between their head and their inflow, each a limited number of times. Returns whether one changed.
    fn switch_cells(&mut self, time: f64, relative: &[f64], switches: &mut [u32]) -> bool {
        let demands = self.demands(time);
        let nodes = Nodes { head: &self.head, relative: Some(relative) };
        self.law.switch(self.conduction.beyond(), &demands, nodes, &mut self.holds, |k| {
            switches[k] += 1;
            switches[k] <= MOST_SWITCHES
        })
    }

    /// Solves `(storage - a) x = residual` by conjugate gradients; the preconditioner is an older matrix, factored.
    fn solve_linear(
        &mut self,
        pairs: Rows,
        relative: &[f64],
        storage: &[f64],
        residual: &[f64],
        tolerance: f64,
    ) -> Option<Vec<f64>> {
        let mut rows = pairs;
        for (i, row) in rows.iter_mut().enumerate() {
            for entry in row.iter_mut() {
                entry.1 = -entry.1;
            }
            row.push((id(i), storage[i]));
        }
        let pairs = collected(rows);
        let mut older = self.preconditioner.take();
        let apply = |direction: &[f64]| {
            let image = if self.conduction.has_direction() {
                self.flow_along(relative, direction)
            } else {
                vec![0.0; direction.len()]
            };
            let row = |(i, along): (usize, f64)| {
                pairs.iter_row(i).map(|(j, a)| a * direction[j]).sum::<f64>() - along
            };
            image.into_iter().enumerate().map(row).collect()
        };
        let solve = |factors: &mut BandedLu, iterations: usize| {
            let precondition = |residual: &[f64]| {
                let mut eased = residual.to_vec();
                factors.solve(&mut eased);
                eased
            };
            let limits = Limits { norm: Norm::Preconditioned, tolerance, iterations };
            conjugate_gradients(apply, precondition, residual, limits).ok()
        };
        if let Some(factors) = &mut older
            && let Some(solution) = solve(factors, STALE_AFTER)
        {
            self.preconditioner = older;
            return Some(solution);
        }
        // The pairs alone reach half as far, so their band is half as wide.
        let mut factors = BandedLu::factor(&pairs)?;
        let solution = solve(&mut factors, MOST_GRADIENTS);
        self.preconditioner = Some(factors);
        self.counters.factorings += 1;
        solution
    }
}

/// Small-strain modulus of confined compression of a node's soil under its effective stress at rest, kPa.
fn confined_modulus(model: &Model, layout: &StressLayout, node: usize) -> Result<f64, SolverError> {
    let region = model.region[node] as usize;
    let soil = &model.regions[region];
    let of_point = |(point, share): (usize, f64)| share * model.vertical_effective_stress[point];
    let vertical = -layout.of_node(node).map(of_point).sum::<f64>();
    let lateral = soil.earth_pressure_coefficient * vertical;
    let stress = Stress { xx: lateral, yy: vertical, xy: 0.0, zz: lateral };
    let moduli = soil.soil.small_strain_moduli(stress);
    let moduli = moduli.map_err(|source| SolverError::Soil { region, node, source })?;
    Ok(moduli.bulk + 4.0 / 3.0 * moduli.shear)
}
