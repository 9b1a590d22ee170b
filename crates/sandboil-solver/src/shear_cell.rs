//! The paper's cyclic direct simple shear test (Section 6.1, Fig. 3a): a block whose outer nodes move by Eq.
//! 17 and whose centre moves freely by the momentum equation, at constant volume.
//!
//! Eq. 17 is taken in the frame of the block's centre: a rigid translation causes no strain, and without it
//! the centre stays in place. A servo controls the strain rate. A sudden reversal of the velocity, as in the
//! paper, would send shear waves `rho C_s dv` into the centre. Here the strain rate changes so slowly that
//! the inertia of the centre takes only a given share of the confining stress, and it decreases before each
//! reversal. Velocities therefore need no reset.

use crate::{
    error::SolverError,
    parallel::{Pool, Rows, chunks, for_each_chunk},
    run::{
        clock::{CHECK_INTERVAL, Counters, is_outgrown},
        domain::RUNAWAY_SPEED,
        time_step::{Limits, PressureCoupling, PressureSpectrum, region_limit},
    },
    section::{
        description::{Conductivity, Model, Numerics, Region, STRESS_NODES, positive},
        outline::{EdgesView, Outline},
        stress_layout::StressLayout,
    },
    skeleton::{
        local_damping::local_damping,
        point::StressPoint,
        soils::{SoilField, StrainStep, StressRows},
        strain_and_force::{NodalShare, conservative_force, motion},
    },
    stages::shaking::MOVING_FACTOR,
    weights::{geometry::Geometry, points::stress_node_positions},
};
use sandboil_soil::{
    Soil, Stress,
    laboratory::{Record, Resolution, Row, cycles},
};
use sandboil_sph::{Vec2, WendlandQuintic};

/// Overshoot of the shear stress that is allowed at a reversal, over the target.
const OVERSHOOT: f64 = 1e-3;
/// Shear strain over which the tangent stiffness is averaged.
const TANGENT_WINDOW: f64 = 1e-4;
/// Least confining stress that the servo assumes, over the initial vertical stress: liquefied soil must still
/// be moved.
const LEAST_CONFINEMENT: f64 = 0.005;
/// Gravity, m/s2: the block has no weight, but a model needs a value.
const STANDARD_GRAVITY: f64 = 9.81;
/// Least tangent stiffness that the servo assumes, over the elastic one: liquefied sand is about to dilate,
/// and its tangent then becomes up to 0.06 of the elastic one.
const LEAST_TANGENT: f64 = 0.1;
/// Description of a test.
#[derive(Debug, Clone)]
pub struct CellTest {
    /// The soil.
    pub soil: Soil,
    /// Void ratio at the start; `None` takes the soil's own.
    pub void_ratio: Option<f64>,
    /// Density, Mg/m3: it scales inertia alone.
    pub density: f64,
    /// Vertical effective stress at the start, kPa, compression positive.
    pub vertical_stress: f64,
    /// Horizontal over vertical effective stress at the start.
    pub earth_pressure_coefficient: f64,
    /// Shear stress at which the direction reverses, over the initial vertical stress.
    pub stress_ratio: f64,
    /// Side of the block, m.
    pub size: f64,
    /// Side of its free centre, m.
    pub free_size: f64,
    /// Particle spacing, m.
    pub spacing: f64,
    /// Largest shear strain of a step.
    pub strain_step: f64,
    /// Largest shear stress that the centre's inertia may take, over the mean confining stress.
    pub inertia: f64,
    /// Local damping `xi` of Eq. 16.
    pub local_damping: f64,
    /// The test ends when the shear strain reaches this.
    pub strain_limit: f64,
    /// The test ends after this number of turns.
    pub turn_limit: usize,
    /// Changes after which a row is recorded.
    pub resolution: Resolution,
    /// Whether stress nodes that do not act on free nodes are computed too.
    pub every_stress_node: bool,
    /// Numerical choices.
    pub numerics: Numerics,
}

impl CellTest {
    /// Checks the values that [`Model::validate`] does not check.
    fn validate(&self) -> Result<(), SolverError> {
        positive("density", self.density)?;
        positive("vertical_stress", self.vertical_stress)?;
        positive("stress_ratio", self.stress_ratio)?;
        positive("strain_step", self.strain_step)?;
        positive("inertia", self.inertia)?;
        positive("strain_limit", self.strain_limit)?;
        positive("spacing", self.spacing)?;
        positive("free_size", self.free_size)?;
        if self.numerics.dispersion_correction {
            let expected = "left out: the cell is strained too slowly for waves";
            return Err(SolverError::InvalidInput { name: "dispersion_correction", value: 1.0, expected });
        }
        if !(self.local_damping >= 0.0 && self.local_damping < 1.0) {
            let (name, value) = ("local_damping", self.local_damping);
            return Err(SolverError::InvalidInput { name, value, expected: "in [0, 1)" });
        }
        // Forces on free nodes must not depend on the ends of the block, where stencils are cut: a uniform
        // stress would move the nodes. Two supports must fit between a free node and the first missing node,
        // a spacing beyond the last one.
        let support = WendlandQuintic::new(self.numerics.smoothing_ratio * self.spacing).support();
        if !(0.5 * (self.size - self.free_size) + self.spacing >= 2.0 * support) {
            return Err(SolverError::InvalidInput {
                name: "size",
                value: self.size,
                expected: "larger than free_size by four kernel supports less two spacings (9.2 spacings by default)",
            });
        }
        Ok(())
    }

    /// The block with sorted nodes, the lattice index of each, and the number of free nodes. Free nodes are
    /// first; the others are sorted by the distance of their nearer stress node from the free centre, so that
    /// those whose stress acts on free nodes come next.
    fn model(&self) -> Result<(Model, Vec<usize>, usize), SolverError> {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // validated: a few hundred at most
        let side = (self.size / self.spacing).round() as usize;
        let place = |index: usize| (index as f64 + 0.5) * self.spacing;
        let lattice: Vec<Vec2> =
            (0..side * side).map(|k| Vec2::new(place(k % side), place(k / side))).collect();
        let stress_position = stress_node_positions(&lattice, Vec2::repeat(self.spacing));
        let half = 0.5 * self.free_size;
        let centre = Vec2::repeat(0.5 * self.size);
        let is_free = |x: &Vec2| (x - centre).amax() < half;
        let distance = |x: &Vec2| {
            let beyond = (x - centre).abs() - Vec2::repeat(half);
            beyond.sup(&Vec2::zeros()).norm()
        };
        let key = |k: usize| {
            let nearer = distance(&stress_position[STRESS_NODES * k]);
            (!is_free(&lattice[k]), nearer.min(distance(&stress_position[STRESS_NODES * k + 1])))
        };
        let mut order: Vec<usize> = (0..lattice.len()).collect();
        order.sort_by(|&a, &b| {
            let ((held_a, far_a), (held_b, far_b)) = (key(a), key(b));
            held_a.cmp(&held_b).then(far_a.total_cmp(&far_b)).then(a.cmp(&b))
        });
        let nodes = lattice.len();
        let model = Model {
            spacing: Vec2::repeat(self.spacing),
            position: order.iter().map(|&k| lattice[k]).collect(),
            volume: vec![self.spacing * self.spacing; nodes],
            region: vec![0; nodes],
            // Without pores the mixture has the given density.
            regions: vec![Region {
                soil: self.soil.clone(),
                porosity: 0.0,
                solid_density: self.density,
                hydraulic_conductivity: Conductivity::isotropic(0.0),
                retention: None,
                earth_pressure_coefficient: self.earth_pressure_coefficient,
                static_poisson_ratio: self.earth_pressure_coefficient
                    / (1.0 + self.earth_pressure_coefficient),
            }],
            surface_elevation: vec![self.size; nodes],
            vertical_effective_stress: vec![self.vertical_stress; STRESS_NODES * nodes],
            pore_pressure: Vec::new(),
            saturation: Vec::new(),
            water: None,
            gravity: STANDARD_GRAVITY,
            period: None,
            outline: Outline::none(),
            numerics: self.numerics,
        };
        model.validate()?;
        Ok((model, order, lattice.iter().filter(|x| is_free(x)).count()))
    }

    /// Eq. 17 in the frame of the block's centre, m/s.
    fn driven(&self, rate: f64, x: Vec2) -> Vec2 {
        Vec2::new(rate * (x.y - 0.5 * self.size), 0.0)
    }
}

/// A model of the first nodes alone.
fn first_nodes(model: &Model, nodes: usize) -> Model {
    Model {
        position: model.position[..nodes].to_vec(),
        volume: model.volume[..nodes].to_vec(),
        region: model.region[..nodes].to_vec(),
        surface_elevation: model.surface_elevation[..nodes].to_vec(),
        vertical_effective_stress: model.vertical_effective_stress[..STRESS_NODES * nodes].to_vec(),
        ..model.clone()
    }
}

/// Departure of the centre from homogeneous shear up to the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Departure {
    /// Standard deviation of the shear strain.
    pub gamma_spread: f64,
    /// Standard deviation of the shear stress, kPa.
    pub tau_spread: f64,
    /// Standard deviation of the vertical stress, kPa.
    pub vertical_spread: f64,
    /// Root mean square of the volumetric strain.
    pub volume_strain: f64,
    /// Root mean square of the free nodes' departure from Eq. 17, m/s.
    pub velocity_deviation: f64,
    /// Speed of Eq. 17 at the edge of the centre, m/s.
    pub edge_speed: f64,
    /// Shear stress beyond the target, over the target; negative below it.
    pub overshoot: f64,
}

impl Departure {
    /// Before the test.
    const NONE: Self = Self {
        gamma_spread: 0.0,
        tau_spread: 0.0,
        vertical_spread: 0.0,
        volume_strain: 0.0,
        velocity_deviation: 0.0,
        edge_speed: 0.0,
        overshoot: -1.0,
    };

    /// The larger value of each field.
    fn or_larger(self, other: Self) -> Self {
        Self {
            gamma_spread: self.gamma_spread.max(other.gamma_spread),
            tau_spread: self.tau_spread.max(other.tau_spread),
            vertical_spread: self.vertical_spread.max(other.vertical_spread),
            volume_strain: self.volume_strain.max(other.volume_strain),
            velocity_deviation: self.velocity_deviation.max(other.velocity_deviation),
            edge_speed: self.edge_speed.max(other.edge_speed),
            overshoot: self.overshoot.max(other.overshoot),
        }
    }
}

/// Control of the shear-strain rate of Eq. 17, `v_x0 / H`, towards a target stress.
#[derive(Debug, Clone)]
struct Servo {
    /// Shear stress of reversal, kPa.
    target: f64,
    /// Sign of the present loading.
    direction: f64,
    /// Turns made.
    turns: usize,
    /// Shear stress at the last turn, kPa.
    from: f64,
    /// Shear-strain rate, 1/s.
    rate: f64,
    /// Tangent stiffness of the last strain steps, kPa.
    tangent: f64,
}

impl Servo {
    /// Rate of the next step, 1/s, at the shear stress `tau` (kPa). The rate may change by `acceleration`
    /// (1/s2) and must not exceed `fastest` (1/s).
    ///
    /// A rate `r` that decreases by `a` covers the strain `r^2 / (2 a)` before it is zero. With the present
    /// tangent, stress grows by `G_t r^2 / (2 a)` in this time: so much must be left to the target. The
    /// allowed overshoot keeps the rate from becoming zero before the target.
    fn next_rate(&self, tau: f64, acceleration: f64, fastest: f64, dt: f64) -> f64 {
        let left = (self.target - self.direction * tau).max(0.0) + OVERSHOOT * self.target;
        let wanted = self.direction * (2.0 * acceleration * left / self.tangent).sqrt().min(fastest);
        let change = acceleration * dt;
        self.rate + (wanted - self.rate).clamp(-change, change)
    }

    /// Tracks the tangent and the target with the strain of a step and the shear stresses `before` and `now`
    /// (kPa); `shear_modulus` (kPa) bounds the tangent. Returns whether the direction reversed.
    fn track(&mut self, strain: f64, before: f64, now: f64, shear_modulus: f64) -> bool {
        let weight = (strain.abs() / TANGENT_WINDOW).min(1.0);
        if weight > 0.0 {
            self.tangent += weight * ((now - before) / strain - self.tangent);
        }
        self.tangent = self.tangent.clamp(LEAST_TANGENT * shear_modulus, shear_modulus);
        let reversed = self.direction * now >= self.target;
        if reversed {
            self.direction = -self.direction;
            self.turns += 1;
            self.from = now;
            self.tangent = shear_modulus;
        }
        reversed
    }

    /// Cycles so far at the shear stress `tau`, kPa.
    fn cycle(&self, tau: f64) -> f64 {
        cycles(self.turns, (self.from, self.direction * self.target), tau)
    }
}

/// A running shear test. Output arrays are in lattice order, row by row from the bottom.
#[derive(Debug)]
pub struct ShearCell {
    test: CellTest,
    /// The block with sorted nodes: free ones first, then by the distance from the free centre.
    model: Model,
    /// Lattice index of each node.
    order: Vec<usize>,
    /// Free nodes.
    free: usize,
    geometry: Geometry,
    position: Vec<Vec2>,
    velocity: Vec<Vec2>,
    /// Stress nodes that are computed, and their shares.
    points: Vec<StressPoint>,
    shares: Vec<NodalShare>,
    soil: SoilField,
    spectrum: PressureSpectrum,
    servo: Servo,
    mass: f64,
    now: Row,
    largest: Departure,
    record: Record,
    time: f64,
    dt: f64,
    counters: Counters,
    threads: usize,
    pool: Pool,
}

impl ShearCell {
    /// Builds the block at its initial stress, at rest.
    ///
    /// # Errors
    /// Bad input, a soil that refuses the initial stress, a thread pool that cannot be made.
    pub fn new(test: CellTest, threads: usize) -> Result<Self, SolverError> {
        test.validate()?;
        let (model, order, free) = test.model()?;
        let nodes = model.nodes();
        let edges = EdgesView::statics(&model.outline);
        let geometry = Geometry::build(&model, &model.position, &model.volume, edges);
        let reached = |j: usize| geometry.gradient.transposed.iter_row(j).map(|(s, _)| s / STRESS_NODES + 1);
        let computed =
            if test.every_stress_node { nodes } else { (0..free).flat_map(reached).max().unwrap_or(free) };
        let vertical = -test.vertical_stress;
        let lateral = test.earth_pressure_coefficient * vertical;
        let stress = Stress { xx: lateral, yy: vertical, xy: 0.0, zz: lateral };
        let point = StressPoint {
            stress,
            density: test.density,
            volume: model.volume[0] / STRESS_NODES as f64,
            ..StressPoint::default()
        };
        let mut points = vec![point; STRESS_NODES * computed];
        let soil = SoilField::plastic(
            &first_nodes(&model, computed),
            &StressLayout::Diagonal,
            &mut points,
            test.void_ratio,
        )?;
        let pool = Pool::new(threads)?;
        let spectrum = PressureSpectrum::new(&model);
        let mut cell = Self {
            servo: Servo {
                target: test.stress_ratio * test.vertical_stress,
                direction: 1.0,
                turns: 0,
                from: 0.0,
                rate: 0.0,
                tangent: points[0].shear_modulus,
            },
            mass: test.density * model.volume[0],
            position: model.position.clone(),
            velocity: vec![Vec2::zeros(); nodes],
            shares: vec![NodalShare::default(); points.len()],
            counters: Counters { geometry_builds: 1, ..Counters::default() },
            now: Row { strain: [0.0; 3], stress, void_ratio: None, cycle: 0.0, turns: 0 },
            largest: Departure::NONE,
            record: Record::new(test.resolution),
            time: 0.0,
            dt: 0.0,
            test,
            model,
            order,
            free,
            geometry,
            points,
            soil,
            spectrum,
            threads,
            pool,
        };
        for s in 0..cell.points.len() {
            let motion = motion(&cell.geometry, s, &cell.velocity);
            cell.shares[s] = motion.share(&cell.points[s], cell.geometry.covariance[s], 0.0);
        }
        cell.dt = cell.limit();
        cell.now = cell.means();
        cell.record.keep(cell.now);
        Ok(cell)
    }

    /// Time step with the safety factor of moving ground, for the present stiffness, s.
    fn limit(&self) -> f64 {
        let stiffest = self.points.iter().map(|point| point.stiffness).fold(0.0, f64::max);
        let limits = Limits {
            coupling: PressureCoupling::None,
            spectrum: &self.spectrum,
            rayleigh: None,
            is_corrected: false,
            viscosity: 0.0,
            surface_is_tied: true,
        };
        MOVING_FACTOR * region_limit(&self.model, 0, stiffest, &limits).dt
    }

    /// Advances by at most `steps` steps; returns whether the test has reached its end.
    ///
    /// # Errors
    /// [`SolverError::Diverged`] or [`SolverError::Soil`]; the state stays readable.
    pub fn advance(&mut self, steps: usize) -> Result<bool, SolverError> {
        let mut pool = std::mem::take(&mut self.pool);
        let outcome = pool.run(|| self.run(steps)).flatten();
        self.pool = pool;
        if outcome.is_err() {
            self.record.keep(self.now);
        }
        outcome
    }

    fn run(&mut self, steps: usize) -> Result<bool, SolverError> {
        for _ in 0..steps {
            if self.is_complete() {
                return Ok(true);
            }
            self.step()?;
        }
        Ok(self.is_complete())
    }

    /// Whether strain or turns have reached their limit.
    pub fn is_complete(&self) -> bool {
        let [.., gamma] = self.now.strain;
        gamma.abs() >= self.test.strain_limit || self.servo.turns >= self.test.turn_limit
    }

    /// Largest change of the shear-strain rate, 1/s2. Inertia changes the shear stress in the middle of the
    /// centre by at most `rho a L^2 / 8`.
    fn acceleration_limit(&self) -> f64 {
        let confinement = -0.5 * (self.now.stress.xx + self.now.stress.yy);
        let confinement = confinement.max(LEAST_CONFINEMENT * self.test.vertical_stress);
        8.0 * self.test.inertia * confinement / (self.test.density * self.test.free_size.powi(2))
    }

    fn step(&mut self) -> Result<(), SolverError> {
        let dt = self.dt;
        let fastest = self.test.strain_step / dt;
        self.servo.rate = self.servo.next_rate(self.now.stress.xy, self.acceleration_limit(), fastest, dt);
        self.accelerate(dt);
        let rate = self.servo.rate;
        for (v, x) in self.velocity[self.free..].iter_mut().zip(&self.model.position[self.free..]) {
            *v = self.test.driven(rate, *x);
        }
        for (x, v) in self.position.iter_mut().zip(&self.velocity) {
            *x += v * dt;
        }
        let filter = self.test.numerics.velocity_filter / self.test.spacing;
        let step = StrainStep {
            layout: &StressLayout::Diagonal,
            shared: None,
            geometry: &self.geometry,
            velocity: &self.velocity,
            filter,
            dt,
            integrator: &self.test.numerics.integrator,
            with_after: false,
        };
        let rows = StressRows { points: &mut self.points, shares: &mut self.shares };
        let report = self.soil.step(self.threads > 1, &step, rows);
        let (report, _) = report.map_err(|error| match error.soil_divergence() {
            Some((quantity, node, value)) => self.diverged(quantity, node, value),
            None => error,
        })?;
        self.counters.soil.merge(&report);
        self.counters.plastic_updates += self.soil.plastic_points() as u64;
        self.counters.steps += 1;
        self.time += dt;
        let before = self.now.stress.xy;
        self.now = self.means();
        let tau = self.now.stress.xy;
        let turned = self.servo.track(rate * dt, before, tau, self.points[0].shear_modulus);
        self.now.cycle = self.servo.cycle(tau);
        self.now.turns = self.servo.turns;
        self.largest = self.largest.or_larger(self.departure());
        if turned || self.is_complete() {
            self.record.keep(self.now);
        } else {
            self.record.offer(self.now);
        }
        if self.counters.steps.is_multiple_of(CHECK_INTERVAL) {
            self.check()?;
        }
        Ok(())
    }

    /// Updates the velocities of the free nodes by the force of the stress around them (Eq. 6).
    fn accelerate(&mut self, dt: f64) {
        let Self { velocity, geometry, shares, points, .. } = self;
        let (mass, damping) = (self.mass, self.test.local_damping);
        // Arrays of units have no size.
        let (mut b, mut c, mut results) =
            (vec![(); self.free], vec![(); self.free], vec![(); chunks(self.free)]);
        let rows = Rows { a: &mut velocity[..self.free], b: &mut b, c: &mut c };
        for_each_chunk(self.threads > 1, rows, &mut results, |first, rows, ()| {
            for (k, v) in rows.a.iter_mut().enumerate() {
                let acting = conservative_force(geometry, first + k, *v, shares, points) / mass;
                *v += (acting + local_damping(acting, *v, damping)) * dt;
            }
        });
    }

    /// Means over the centre's stress nodes, in their order, with unchanged cycles and turns.
    fn means(&self) -> Row {
        let count = STRESS_NODES * self.free;
        let mut strain = [0.0; 3];
        let mut stress = Stress { xx: 0.0, yy: 0.0, xy: 0.0, zz: 0.0 };
        for point in &self.points[..count] {
            for (sum, part) in strain.iter_mut().zip(point.strain) {
                *sum += part;
            }
            stress.xx += point.stress.xx;
            stress.yy += point.stress.yy;
            stress.xy += point.stress.xy;
            stress.zz += point.stress.zz;
        }
        let share = 1.0 / count as f64;
        let Stress { xx, yy, xy, zz } = stress;
        let void_ratio: Option<f64> = (0..count).map(|s| self.soil.void_ratio(s)).sum();
        Row {
            strain: strain.map(|sum| share * sum),
            stress: Stress { xx: share * xx, yy: share * yy, xy: share * xy, zz: share * zz },
            void_ratio: void_ratio.map(|sum| share * sum),
            ..self.now
        }
    }

    /// Present departure of the centre from homogeneous shear.
    pub fn departure(&self) -> Departure {
        let Row { strain, stress, .. } = self.now;
        let centre = &self.points[..STRESS_NODES * self.free];
        let spread = |difference: &dyn Fn(&StressPoint) -> f64| {
            let squares = centre.iter().map(|point| difference(point).powi(2)).sum::<f64>();
            (squares / centre.len() as f64).sqrt()
        };
        let rate = self.servo.rate;
        let deviation = self.velocity[..self.free]
            .iter()
            .zip(&self.model.position)
            .map(|(v, x)| (v - self.test.driven(rate, *x)).norm_squared())
            .sum::<f64>();
        Departure {
            gamma_spread: spread(&|point| point.strain[2] - strain[2]),
            tau_spread: spread(&|point| point.stress.xy - stress.xy),
            vertical_spread: spread(&|point| point.stress.yy - stress.yy),
            volume_strain: spread(&|point| point.strain[0] + point.strain[1]),
            velocity_deviation: (deviation / self.free as f64).sqrt(),
            edge_speed: rate.abs() * 0.5 * self.test.free_size,
            overshoot: stress.xy.abs() / self.servo.target - 1.0,
        }
    }

    /// Checks finiteness and stability limit, every few steps.
    fn check(&mut self) -> Result<(), SolverError> {
        for (j, v) in self.velocity[..self.free].iter().enumerate() {
            let speed = v.norm();
            // NaN must take the error branch.
            if !(speed <= RUNAWAY_SPEED) {
                return Err(self.diverged("velocity", j, speed));
            }
        }
        let target = self.limit();
        if is_outgrown(self.dt, target) {
            self.dt = target;
            self.counters.time_step_changes += 1;
        }
        Ok(())
    }

    fn diverged(&self, quantity: &'static str, j: usize, value: f64) -> SolverError {
        let [x, y] = self.position[j].into();
        let (node, time, step) = (self.order[j], self.time, self.counters.steps);
        SolverError::Diverged { quantity, node, x, y, value, time, step }
    }

    /// Recorded means over the centre; strain tension positive.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// The present means over the centre.
    pub fn now(&self) -> Row {
        self.now
    }

    /// The largest of each departure from homogeneous shear so far.
    pub fn largest_departure(&self) -> Departure {
        self.largest
    }

    /// Time since the start, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Present time step, s.
    pub fn time_step(&self) -> f64 {
        self.dt
    }

    /// Counts of the work done so far.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// Number of stress nodes that are computed.
    pub fn computed_stress_nodes(&self) -> usize {
        self.points.len()
    }

    fn in_lattice_order<T: Copy>(&self, value: impl Fn(usize) -> T) -> Vec<T> {
        let mut values: Vec<(usize, T)> =
            self.order.iter().enumerate().map(|(j, &k)| (k, value(j))).collect();
        values.sort_by_key(|(k, _)| *k);
        values.into_iter().map(|(_, value)| value).collect()
    }

    /// Whether each node is free.
    pub fn is_free(&self) -> Vec<bool> {
        self.in_lattice_order(|j| j < self.free)
    }

    /// Positions in the frame of the block's centre, m.
    pub fn position(&self) -> Vec<[f64; 2]> {
        self.in_lattice_order(|j| self.position[j].into())
    }

    /// Velocities at the middle of the last step, in the frame of the block's centre, m/s.
    pub fn velocity(&self) -> Vec<[f64; 2]> {
        self.in_lattice_order(|j| self.velocity[j].into())
    }

    /// Effective stress `(xx, yy, xy, zz)` of every node's two stress nodes, kPa, tension positive; NaN where it is not
    /// computed.
    pub fn stress(&self) -> Vec<[[f64; 4]; STRESS_NODES]> {
        self.in_lattice_order(|j| {
            [0, 1].map(|k| {
                self.points.get(STRESS_NODES * j + k).map_or([f64::NAN; 4], |point| {
                    let Stress { xx, yy, xy, zz } = point.stress;
                    [xx, yy, xy, zz]
                })
            })
        })
    }

    /// Strain `(xx, yy, engineering xy)` of every node's two stress nodes; NaN where it is not computed.
    pub fn strain(&self) -> Vec<[[f64; 3]; STRESS_NODES]> {
        self.in_lattice_order(|j| {
            [0, 1].map(|k| self.points.get(STRESS_NODES * j + k).map_or([f64::NAN; 3], |point| point.strain))
        })
    }
}
