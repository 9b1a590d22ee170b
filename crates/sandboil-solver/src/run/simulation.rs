//! Stages and stepping: the leapfrog loop, the gravity relaxation, limits and forces.

use crate::{
    edges::{base::Base, compliant_base::CompliantBase, contact::stick_to_edges},
    error::{SolverError, StateError},
    parallel::{Pool, Rows, chunks, for_each_chunk},
    run::{
        checkpoint,
        energy::{EdgeWork, Energy, EnergyHistory, Power},
        histories::{Probes, Recorder},
        time_step::{Criterion, PressureCoupling, PressureSpectrum, region_limit},
    },
    section::{
        description::{Model, STRESS_NODES},
        edge_nodes::EdgeNodes,
        order::sorted,
        outline::Walls,
    },
    skeleton::{
        contacts::Contacts,
        inertia::Dispersion,
        local_damping::local_damping,
        phases::Phases,
        point::{StressPoint, maximum_shear_strain},
        printed::PrintedStress,
        rayleigh::{Rayleigh, RayleighDamping},
        soils::{SoilField, StressWork},
        strain_and_force::{NodalShare, conservative_force},
    },
    stages::{
        column::ColumnRecord,
        free_field::FreeField,
        run_out::{Flowing, RunOut},
    },
    water::{moving_edges::MovingBoundary, pore_pressure::Flow},
    weights::geometry::Geometry,
};
use sandboil_soil::{Stress, UpdateReport};
use sandboil_sph::Vec2;
use std::io::{self, Write};

mod follow;
mod readout;
mod stages;
/// Steps between checks of stability limit, geometry and finiteness.
pub(crate) const CHECK_INTERVAL: u64 = 16;
/// Time-step factor of the gravity stage: kinetic damping needs no margin for stiffening.
pub const RELAXATION_FACTOR: f64 = 0.85;
/// Default factor in shaking: soil stiffens in cycles between checks.
pub const SHAKING_FACTOR: f64 = 0.6;
/// The step shrinks when it exceeds its target by this factor, and grows when it falls below by the second.
pub const SHRINK_AT: f64 = 1.1;
/// See [`SHRINK_AT`].
pub const GROW_AT: f64 = 1.3;
/// Implicit diffusion is chosen where it lengthens the step by more than this.
pub const IMPLICIT_GAIN: f64 = 1.2;
/// Largest conductivity for the acceleration term of Eq. 7 when it is left to us, m/s: above, it limits dt.
pub const ACCELERATION_TERM_CONDUCTIVITY: f64 = 3e-3;
/// Speed no soil particle reaches, m/s: a run that does has diverged.
pub(crate) const RUNAWAY_SPEED: f64 = 1e3;
/// Mean over largest unbalanced acceleration that the gravity stage asks for.
pub const MEAN_RESIDUAL: f64 = 0.1;
/// Static stage: gravity on a fixed base, relaxed by kinetic damping.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Gravity {
    /// Largest unbalanced acceleration over gravity at the end.
    pub tolerance: f64,
    /// Steps after which the stage gives up.
    pub max_steps: u64,
}

/// Dynamic stage on a compliant base.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Shaking {
    /// Duration, s.
    pub duration: f64,
    /// The base and what comes through it.
    pub base: Base,
    /// Whether the left and the right side become free-field sides; else they stay the walls they are in statics.
    pub free_field: [bool; 2],
    /// What the columns of the left and the right side did before under the same motion, to be read instead of solved.
    pub column_records: [Option<ColumnRecord>; 2],
    /// Interval at which what the columns do is recorded, s.
    pub record_columns: Option<f64>,
    /// Local damping `xi_l` of Eq. 16.
    pub local_damping: f64,
    /// Rayleigh damping, if any.
    pub rayleigh: Option<Rayleigh>,
    /// Hydraulic conditions. Without one the ground surface keeps its pressure, and all other edges are impermeable.
    pub conditions: Vec<MovingBoundary>,
    /// Whether the ground is let go to flow: on the base and between the walls of statics, under its own weight.
    pub run_out: Option<RunOut>,
    /// Factor on the stability limit.
    pub time_step_factor: f64,
    /// Points where histories are read, m.
    pub probes: Vec<Vec2>,
    /// Interval of the histories, s.
    pub history_interval: f64,
    /// Whether probes also read stress and strain.
    pub stress_histories: bool,
    /// Whether the largest excess pressure of every node is kept.
    pub pressure_envelope: bool,
    /// Whether the largest shear strain of every stress node is kept.
    pub strain_envelope: bool,
}

/// Work done in a stage, by kind: what a scene does not ask for stays zero.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Counters {
    /// Steps.
    pub steps: u64,
    /// Calls of the flow model.
    pub flow_calls: u64,
    /// Calls of the base dashpots.
    pub base_calls: u64,
    /// Steps with free-field sides.
    pub free_field_calls: u64,
    /// Steps with dispersion-corrected inertia.
    pub inertia_corrections: u64,
    /// Updates of plastic soil models.
    pub plastic_updates: u64,
    /// Geometries built.
    pub geometry_builds: u64,
    /// Porosities kept in the range of a grain packing.
    pub porosity_clips: u64,
    /// Stress nodes that began with a stress their soil cannot carry, and took the nearest that it can.
    pub inadmissible_starts: u64,
    /// Changes of the time step.
    pub time_step_changes: u64,
    /// Times that a node of flowing ground was stopped at an edge.
    pub edge_contacts: u64,
    /// What the soil models counted.
    pub soil: UpdateReport,
}

#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub enum Active {
    None,
    Gravity { stage: Gravity, kinetic_energy: f64, residual: f64, at_rest: bool },
    Shaking(Box<ActiveShaking>),
}

#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct ActiveShaking {
    stage: Shaking,
    base: CompliantBase,
    free_field: Option<FreeField>,
    coupling: PressureCoupling,
    probes: Probes,
    recorder: Recorder,
    energy: Energy,
    energy_history: EnergyHistory,
    channel_values: Vec<f64>,
    pressure_envelope: Option<Vec<f64>>,
    strain_envelope: Option<Vec<f64>>,
}

/// Result of one chunk of the velocity update: how far from rest statics are, or what forces do to moving ground.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub struct MotionSum {
    kinetic_energy: f64,
    acceleration: f64,
    largest_acceleration: f64,
    /// Power of the constant forces, and of the water's in this step and in the one before, on the velocity between both,
    /// kW/m.
    constant_power: f64,
    water_power: f64,
    last_water_power: f64,
}

/// A section and its state. Every array that leaves is in the user's node order.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct Simulation {
    model: Model,
    /// User's index of each internal node.
    order: Vec<usize>,
    // The state is the same under any number of threads.
    #[serde(skip)]
    threads: usize,
    #[serde(skip)]
    pool: Pool,
    geometry: Geometry,
    walls: Walls,
    edges: EdgeNodes,
    /// Positions when the edges were let go, m; none while they are fixed.
    released: Option<Vec<Vec2>>,
    gravity: Option<Gravity>,
    /// Whether this is a free-field column: the section beside it renews its geometry.
    is_column: bool,
    initial_position: Vec<Vec2>,
    position: Vec<Vec2>,
    velocity: Vec<Vec2>,
    acceleration: Vec<Vec2>,
    phases: Phases,
    mass: Vec<f64>,
    points: Vec<StressPoint>,
    shares: Vec<NodalShare>,
    soil: SoilField,
    constant_force: Vec<Vec2>,
    /// Force of the pore water in the last step, kN/m.
    water_force: Vec<Vec2>,
    spectrum: PressureSpectrum,
    flow: Option<Flow>,
    printed_stress: Option<PrintedStress>,
    rayleigh: Option<RayleighDamping>,
    flowing: Option<Flowing>,
    dispersion: Option<Dispersion>,
    contacts: Option<Contacts>,
    active: Active,
    time: f64,
    step: u64,
    dt: f64,
    criterion: Criterion,
    counters: Counters,
    sums: Vec<MotionSum>,
}

impl Simulation {
    /// Builds the section at its geostatic stress, at rest on a fixed base.
    ///
    /// # Errors
    /// Bad input, or a thread pool that cannot be made.
    pub fn new(model: &Model, threads: usize) -> Result<Self, SolverError> {
        model.validate()?;
        let (model, order) = sorted(model);
        let nodes = model.nodes();
        let pool = Pool::new(threads)?;
        let phases = Phases::new(&model);
        let walls = Walls::statics(&model.outline);
        let outline = (&model.outline, walls);
        let geometry = Geometry::build(&model, &model.position, phases.volume(), outline, None);
        let mut points: Vec<StressPoint> = (0..STRESS_NODES * nodes)
            .map(|s| {
                let region = &model.regions[model.region[s / STRESS_NODES] as usize];
                let vertical = -model.vertical_effective_stress[s];
                let lateral = region.earth_pressure_coefficient * vertical;
                let stress = Stress { xx: lateral, yy: vertical, xy: 0.0, zz: lateral };
                StressPoint { stress, ..StressPoint::default() }
            })
            .collect();
        let soil = SoilField::elastic(&model, &mut points)?;
        let mut simulation = Self {
            order,
            threads,
            pool,
            walls,
            edges: EdgeNodes::new(&model),
            released: None,
            gravity: None,
            is_column: false,
            initial_position: model.position.clone(),
            position: model.position.clone(),
            velocity: vec![Vec2::zeros(); nodes],
            acceleration: vec![Vec2::zeros(); nodes],
            mass: vec![0.0; nodes],
            shares: vec![NodalShare::default(); points.len()],
            points,
            soil,
            constant_force: vec![Vec2::zeros(); nodes],
            water_force: vec![Vec2::zeros(); nodes],
            spectrum: PressureSpectrum::new(&model),
            flow: None,
            printed_stress: geometry.printed.as_ref().map(|_| PrintedStress::default()),
            geometry,
            rayleigh: None,
            flowing: None,
            dispersion: None,
            contacts: None,
            active: Active::None,
            time: 0.0,
            step: 0,
            dt: 0.0,
            criterion: Criterion::default(),
            counters: Counters::default(),
            sums: vec![MotionSum::default(); chunks(nodes)],
            phases,
            model,
        };
        simulation.follow_volumes();
        Ok(simulation)
    }

    /// Writes all that the simulation is, to be gone on with by [`Simulation::restore`], and a note of the caller's, to
    /// be read by [`checkpoint::note`].
    ///
    /// # Errors
    /// Those of `to`.
    pub fn store(&self, note: &[u8], to: impl Write) -> io::Result<()> {
        checkpoint::write(self, note, to)
    }

    /// The simulation that was stored, in the same stage at the same step: it goes on bit for bit as it would have,
    /// with any number of threads.
    ///
    /// # Errors
    /// [`SolverError::State`] for bytes that are damaged or of another model than the one given, or a thread pool
    /// that cannot be made.
    pub fn restore(model: &Model, threads: usize, bytes: &[u8]) -> Result<Self, SolverError> {
        let mut simulation: Self = checkpoint::read(bytes)?;
        if simulation.model != sorted(model).0 {
            return Err(StateError::OtherModel.into());
        }
        (simulation.threads, simulation.pool) = (threads, Pool::new(threads)?);
        Ok(simulation)
    }

    /// Strength `xi / dx` of the velocity filter, 1/m.
    fn filter(&self) -> f64 {
        self.model.numerics.velocity_filter / self.model.mean_spacing()
    }

    /// Time step at `factor` of the limit of the present stiffness.
    fn limit(&self, coupling: PressureCoupling, factor: f64) -> (f64, Criterion) {
        let rayleigh = self.rayleigh.as_ref().map(RayleighDamping::law);
        self.limit_under(rayleigh, coupling, factor)
    }

    /// The same under another damping than the stage's.
    fn limit_under(
        &self,
        rayleigh: Option<&Rayleigh>,
        coupling: PressureCoupling,
        factor: f64,
    ) -> (f64, Criterion) {
        let corrected = self.dispersion.is_some();
        let viscosity = self.flowing.as_ref().map(|flowing| flowing.viscosity.coefficient());
        // Nodes are sorted by region: each is one stretch.
        let mut first = 0;
        let (dt, criterion) = self
            .model
            .region
            .chunk_by(|a, b| a == b)
            .map(|stretch| {
                let points = STRESS_NODES * first..STRESS_NODES * (first + stretch.len());
                first += stretch.len();
                let stiffest =
                    self.points[points].iter().fold(0.0_f64, |most, point| most.max(point.stiffness));
                (stretch[0] as usize, stiffest)
            })
            .filter(|(_, stiffness)| *stiffness > 0.0)
            .map(|(region, stiffness)| {
                let place = (&self.model, region);
                region_limit(place, stiffness, coupling, &self.spectrum, rayleigh, (corrected, viscosity))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or_default();
        let pace = self.flowing.as_ref().map_or(1.0, |flowing| flowing.pace);
        (factor * pace * dt, criterion)
    }

    /// The same, and no longer than free-field columns allow.
    fn shared_limit(
        &self,
        coupling: PressureCoupling,
        factor: f64,
        free_field: Option<&FreeField>,
    ) -> (f64, Criterion) {
        let columns = free_field.into_iter().flat_map(FreeField::columns);
        columns
            .map(|column| column.limit(coupling, factor))
            .fold(self.limit(coupling, factor), |least, limit| if limit.0 < least.0 { limit } else { least })
    }

    fn prepare_printed_stress(&mut self) {
        if let (Some(stress), Some(tables)) = (&mut self.printed_stress, &self.geometry.printed) {
            stress.update(tables, &self.points);
        }
    }

    /// Force of the excess pore pressure on node `j` (Eq. 6), kN/m.
    #[inline]
    fn water_force(&self, j: usize) -> Vec2 {
        let (Some(flow), Some(tables)) = (&self.flow, &self.geometry.flow) else { return Vec2::zeros() };
        match &self.geometry.printed {
            None => flow.force(tables, j),
            Some(printed) => {
                let row = printed.pressure_gradient.iter_row(j);
                let gradient: Vec2 = row.map(|(i, gradient)| gradient * flow.neutral(i)).sum();
                gradient * -self.phases.volume()[j]
            }
        }
    }

    /// Force on node `j`, moving at `velocity`, from stress and from excess pore pressure, `water` (Eq. 6), kN/m.
    #[inline]
    fn internal_force(&self, j: usize, velocity: Vec2, water: Vec2) -> Vec2 {
        let mut force = match (&self.printed_stress, &self.geometry.printed) {
            (Some(stress), Some(tables)) => stress.force(tables, j, &self.points, &self.phases),
            _ => conservative_force(&self.geometry, j, velocity, &self.shares, &self.points),
        };
        force += water;
        if let Some(Flowing { viscosity, .. }) = &self.flowing {
            force += viscosity.force(j);
        }
        if let Some(rayleigh) = &self.rayleigh {
            force += rayleigh.force(&self.geometry, j, self.mass[j], velocity);
        }
        force
    }

    /// Advances by at most `steps` steps, or until the stage time reaches `until`. Returns whether the stage is
    /// complete.
    ///
    /// # Errors
    /// [`SolverError::Diverged`], [`SolverError::Soil`], [`SolverError::NotAtRest`]; the state stays readable.
    pub fn advance(&mut self, steps: u64, until: f64) -> Result<bool, SolverError> {
        if matches!(self.active, Active::None) {
            return Err(SolverError::Order { call: "advance", needs: "a stage" });
        }
        let mut pool = std::mem::take(&mut self.pool);
        let outcome = pool.run(|| self.run(steps, until));
        self.pool = pool;
        // Nobody sees, keeps or goes on from a state that is no longer one.
        let done = outcome??;
        self.guard()?;
        Ok(done)
    }

    fn run(&mut self, steps: u64, until: f64) -> Result<bool, SolverError> {
        for _ in 0..steps {
            if self.is_complete() {
                return Ok(true);
            }
            // Half a step of tolerance: output never changes the time step.
            if self.time + 0.5 * self.dt >= until {
                return Ok(false);
            }
            match self.active {
                Active::Gravity { .. } => self.gravity_step()?,
                _ => self.shaking_step()?,
            }
        }
        Ok(self.is_complete())
    }

    /// What the free-field columns of the left and the right side did in the stage, if it is recorded; once.
    pub fn take_column_records(&mut self) -> [Option<ColumnRecord>; 2] {
        match &mut self.active {
            Active::Shaking(shaking) => {
                shaking.free_field.as_mut().map_or([None, None], FreeField::take_records)
            }
            _ => [None, None],
        }
    }

    /// Whether the stage has reached its end.
    pub fn is_complete(&self) -> bool {
        match &self.active {
            Active::None => true,
            Active::Gravity { at_rest, .. } => *at_rest,
            Active::Shaking(shaking) => self.is_over(shaking),
        }
    }

    fn is_over(&self, shaking: &ActiveShaking) -> bool {
        Self::ends(shaking, self.time, self.dt)
    }

    /// Whether the stage ends at a time (s) that is reached by steps of `dt`, s.
    fn ends(shaking: &ActiveShaking, time: f64, dt: f64) -> bool {
        time + 0.5 * dt >= shaking.stage.duration
    }

    /// Forces and accelerations, and velocities moved by them over `dt`; positions stay. Returns what is wanted of the
    /// motion in statics or else.
    fn accelerate<const STATICS: bool>(&mut self, dt: f64) -> MotionSum {
        self.prepare_printed_stress();
        let mut velocity = std::mem::take(&mut self.velocity);
        let mut acceleration = std::mem::take(&mut self.acceleration);
        let mut water_force = std::mem::take(&mut self.water_force);
        let mut sums = std::mem::take(&mut self.sums);
        let threaded = self.threads > 1;
        let nodes = self.model.nodes();
        let mut dispersion = self.dispersion.take();
        let is_wet = self.flow.is_some();
        // The constant force comes last, so that a state at rest cancels to the last bit.
        let bare = |this: &Self, j: usize, velocity: Vec2, water: &mut Vec2, sum: &mut MotionSum| {
            let (last_water, constant) = (*water, this.constant_force[j]);
            *water = this.water_force(j);
            if !STATICS {
                sum.constant_power += constant.dot(&velocity);
                if is_wet {
                    sum.water_power += water.dot(&velocity);
                    sum.last_water_power += last_water.dot(&velocity);
                }
            }
            (this.internal_force(j, velocity, *water) + constant) / this.mass[j]
        };
        sums.fill(MotionSum::default());
        let this = &*self;
        if let Some(dispersion) = &mut dispersion {
            let rows = Rows { a: &mut velocity[..nodes], b: &mut acceleration[..nodes], c: &mut water_force };
            for_each_chunk(threaded, rows, &mut sums, |first, rows, sum| {
                for (k, (v, a)) in rows.a.iter().zip(rows.b.iter_mut()).enumerate() {
                    *a = bare(this, first + k, *v, &mut rows.c[k], sum);
                }
            });
            dispersion.gather(threaded, &this.geometry, &this.points, &acceleration);
        }
        let rows = Rows { a: &mut velocity[..nodes], b: &mut acceleration[..nodes], c: &mut water_force };
        for_each_chunk(threaded, rows, &mut sums, |first, rows, chunk| {
            // In registers: memory that the loop may write elsewhere would be read back every time.
            let mut sum = *chunk;
            for (k, (v, a)) in rows.a.iter_mut().zip(rows.b.iter_mut()).enumerate() {
                let j = first + k;
                let acting = match &dispersion {
                    None => bare(this, j, *v, &mut rows.c[k], &mut sum),
                    Some(dispersion) => *a + dispersion.acceleration(&this.geometry, j, this.mass[j]),
                };
                *a = acting;
                *v += acting * dt;
                if STATICS {
                    let size = acting.norm();
                    sum.kinetic_energy += 0.5 * this.mass[j] * v.norm_squared();
                    sum.acceleration += size;
                    sum.largest_acceleration = sum.largest_acceleration.max(size);
                }
            }
            *chunk = sum;
        });
        self.counters.inertia_corrections += u64::from(dispersion.is_some());
        self.dispersion = dispersion;
        // In order, whatever thread made them.
        let total = sums.iter().fold(MotionSum::default(), |total, chunk| MotionSum {
            kinetic_energy: total.kinetic_energy + chunk.kinetic_energy,
            acceleration: total.acceleration + chunk.acceleration,
            largest_acceleration: total.largest_acceleration.max(chunk.largest_acceleration),
            constant_power: total.constant_power + chunk.constant_power,
            water_power: total.water_power + chunk.water_power,
            last_water_power: total.last_water_power + chunk.last_water_power,
        });
        (self.velocity, self.acceleration, self.sums) = (velocity, acceleration, sums);
        self.water_force = water_force;
        total
    }

    /// Power of the last step's forces on the present velocities.
    fn present_power(&self) -> Power {
        let work = |forces: &[Vec2]| forces.iter().zip(&self.velocity).map(|(force, v)| force.dot(v)).sum();
        Power { constant: work(&self.constant_force), water: work(&self.water_force) }
    }

    /// Kinetic energy, kJ/m.
    fn kinetic_energy(&self) -> f64 {
        self.mass.iter().zip(&self.velocity).map(|(mass, v)| 0.5 * mass * v.norm_squared()).sum()
    }

    /// Local damping of Eq. 16 on the whole acceleration, the base's tractions included, against the velocity that
    /// each node had before it. Returns the energy taken, kJ/m.
    fn damp_locally(&mut self, coefficient: f64, dt: f64) -> f64 {
        let mut taken = 0.0;
        // The velocities lent behind the nodes have no mass here.
        let masses = self.mass.iter().chain(std::iter::repeat(&0.0));
        for ((v, a), mass) in self.velocity.iter_mut().zip(&mut self.acceleration).zip(masses) {
            let before = *v - *a * dt;
            let drag = local_damping(*a, before, coefficient);
            *v += drag * dt;
            *a += drag;
            taken -= mass * drag.dot(&(before + *v)) * (0.5 * dt);
        }
        taken
    }

    /// Strain, soil model and the shares of the next force loop, from the velocity at mid-step.
    fn update_stress(&mut self, dt: f64, with_after: bool) -> Result<StressWork, SolverError> {
        let filter = self.filter();
        let report = self.soil.step(
            self.threads > 1,
            &self.geometry,
            &self.velocity,
            (&mut self.points, &mut self.shares),
            (filter, dt),
            (&self.model.numerics.integrator, with_after),
        );
        let (report, work) = report.map_err(|error| match error.soil_divergence() {
            Some((quantity, node, value)) => self.diverged(quantity, node, value),
            None => error,
        })?;
        if let Some(rayleigh) = &mut self.rayleigh {
            let (geometry, velocity) = (&self.geometry, &self.velocity);
            rayleigh.add_stress(self.threads > 1, geometry, velocity, &self.points, &mut self.shares);
        }
        self.counters.soil.merge(&report);
        self.counters.plastic_updates += self.soil.plastic_points() as u64;
        self.counters.steps += 1;
        Ok(work)
    }

    fn gravity_step(&mut self) -> Result<(), SolverError> {
        let dt = self.dt;
        let Active::Gravity { kinetic_energy, .. } = self.active else { return Ok(()) };
        // From rest the first kick of a leapfrog spans half a step; a whole one would let modes near the
        // stability limit flip for ever between two stops.
        let sum = self.accelerate::<true>(if kinetic_energy == 0.0 { 0.5 * dt } else { dt });
        let largest = sum.largest_acceleration / self.model.gravity;
        let mean = sum.acceleration / (self.model.gravity * self.model.nodes() as f64);
        self.check_finite("acceleration", |simulation, j| simulation.acceleration[j].norm(), f64::INFINITY)?;
        let Active::Gravity { stage, kinetic_energy, residual, at_rest } = &mut self.active else {
            return Ok(());
        };
        *residual = largest;
        if largest <= stage.tolerance && mean <= MEAN_RESIDUAL * stage.tolerance {
            *at_rest = true;
            self.velocity.fill(Vec2::zeros());
            return Ok(());
        }
        if self.step >= stage.max_steps {
            let Gravity { tolerance, .. } = *stage;
            return Err(SolverError::NotAtRest { steps: self.step, residual: largest, tolerance });
        }
        // Kinetic damping: at each peak of the kinetic energy all motion stops.
        if sum.kinetic_energy < *kinetic_energy {
            self.velocity.fill(Vec2::zeros());
            *kinetic_energy = 0.0;
        } else {
            *kinetic_energy = sum.kinetic_energy;
        }
        self.update_stress(dt, false)?;
        self.step += 1;
        self.time += dt;
        Ok(())
    }

    fn shaking_step(&mut self) -> Result<(), SolverError> {
        // Moved out so that stage and section can be borrowed apart; moved back below, also on errors.
        let Active::Shaking(mut shaking) = std::mem::replace(&mut self.active, Active::None) else {
            return Ok(());
        };
        let outcome = self.shaking_step_with(&mut shaking);
        self.active = Active::Shaking(shaking);
        outcome
    }

    fn shaking_step_with(&mut self, shaking: &mut ActiveShaking) -> Result<(), SolverError> {
        let dt = self.dt;
        shaking.base.begin_step(&self.velocity);
        if let Some(free_field) = &mut shaking.free_field {
            free_field.begin_step(dt, &self.velocity)?;
        }
        if let Some(Flowing { viscosity, .. }) = &mut self.flowing {
            let motion = (self.position.as_slice(), self.velocity.as_slice(), self.phases.volume());
            viscosity.update(self.threads > 1, (&self.model, &self.geometry), &self.points, motion);
        }
        let MotionSum { constant_power, water_power, last_water_power, .. } = self.accelerate::<false>(dt);
        shaking.energy.end_step(Power { constant: constant_power, water: last_water_power });
        shaking.energy.begin_step(dt, Power { constant: constant_power, water: water_power });
        let motion = (self.velocity.as_mut_slice(), self.acceleration.as_mut_slice());
        if let Some(free_field) = &shaking.free_field {
            free_field.push(dt, &self.mass, motion.0, motion.1);
        }
        shaking.base.end_step(self.time, dt, &self.mass, (&mut *motion.0, &mut *motion.1));
        if let Some(free_field) = &mut shaking.free_field {
            free_field.end_step(dt, &self.mass, motion.0, motion.1);
            free_field.lend(&mut motion.0[self.mass.len()..], &mut motion.1[self.mass.len()..]);
            self.counters.free_field_calls += 1;
        }
        let mut local_damping = 0.0;
        if shaking.stage.local_damping > 0.0 {
            local_damping = self.damp_locally(shaking.stage.local_damping, dt);
        }
        if let Some(Flowing { outline, .. }) = &self.flowing {
            let motion = (self.velocity.as_mut_slice(), self.acceleration.as_mut_slice());
            let section = (&self.model, outline);
            self.counters.edge_contacts += stick_to_edges(section, &self.position, motion.0, motion.1, dt);
        }
        let base = shaking.base.dashpots().work(dt, &self.velocity);
        let motion = (self.velocity.as_slice(), self.acceleration.as_slice());
        let stressed = (&self.geometry, self.points.as_slice());
        let sides =
            shaking.free_field.as_ref().map_or(0.0, |free_field| free_field.work(dt, motion, stressed));
        shaking.energy.step(&EdgeWork { base, sides, local_damping });
        self.counters.base_calls += 1;
        self.record(shaking);
        for (x, v) in self.position.iter_mut().zip(&self.velocity) {
            *x += v * dt;
        }
        if let Some(flow) = &mut self.flow {
            flow.carry(&self.position);
        }
        let end = self.time + dt;
        // Nobody reads the accounts of a column.
        let is_sampled =
            !self.is_column && (shaking.energy_history.is_due(end) || Self::ends(shaking, end, dt));
        let work = self.update_stress(dt, is_sampled)?;
        shaking.energy.strain(work);
        if let (Some(flow), Some(tables)) = (&mut self.flow, &self.geometry.flow) {
            self.counters.flow_calls += 1;
            let (points, threaded) = (&self.points, self.threads > 1);
            let motion = (self.velocity.as_slice(), self.acceleration.as_slice());
            if !flow.step(threaded, tables, points, motion, (self.time + dt, dt)) {
                return Err(self.diverged("pore pressure matrix", 0, f64::NAN));
            }
        }
        self.step += 1;
        self.time += dt;
        let is_over = self.is_over(shaking);
        if is_sampled {
            let mut energy = shaking.energy;
            energy.end_step(self.present_power());
            shaking.energy_history.push(self.time, &energy, self.kinetic_energy(), work.after, &self.phases);
        }
        if is_over {
            shaking.recorder.finish(self.time);
        }
        // Ground that flows outgrows its weights in a few steps.
        if self.flowing.is_some() || self.step.is_multiple_of(CHECK_INTERVAL) {
            self.check(shaking)?;
        }
        Ok(())
    }

    /// Finiteness, stability limit and geometry, every few steps.
    fn check(&mut self, shaking: &mut ActiveShaking) -> Result<(), SolverError> {
        self.guard()?;
        if let Some(flow) = &mut self.flow {
            flow.refresh(&self.model, self.time);
        }
        let factor = shaking.stage.time_step_factor;
        let (target, criterion) = self.shared_limit(shaking.coupling, factor, shaking.free_field.as_ref());
        if step_is_outgrown(self.dt, target) {
            (self.dt, self.criterion) = (target, criterion);
            self.counters.time_step_changes += 1;
        }
        let column_strained = shaking.free_field.iter().flat_map(FreeField::columns).any(Self::is_strained);
        if !self.is_column && (self.is_strained() || column_strained) {
            shaking.energy.end_step(self.present_power());
            let before = self.kinetic_energy();
            self.renew_geometry(shaking.free_field.as_mut());
            shaking.energy.renew(self.kinetic_energy() - before);
        }
        Ok(())
    }

    /// Envelopes and histories at the beginning of the step, when the accelerations are known and nothing has
    /// moved yet: every quantity of a sample belongs to the same instant.
    fn record(&self, shaking: &mut ActiveShaking) {
        if let (Some(envelope), Some(flow)) = (&mut shaking.pressure_envelope, &self.flow) {
            for (node, largest) in envelope.iter_mut().enumerate() {
                *largest = largest.max(flow.excess(node));
            }
        }
        if let Some(envelope) = &mut shaking.strain_envelope {
            for (largest, point) in envelope.iter_mut().zip(&self.points) {
                *largest = largest.max(maximum_shear_strain(point.strain));
            }
        }
        let values = &mut shaking.channel_values;
        let mut slot = 0;
        let mut put = |value: f64| {
            values[slot] = value;
            slot += 1;
        };
        for probe in 0..shaking.stage.probes.len() {
            let mut acceleration = Vec2::zeros();
            let (mut velocity, mut displacement) = (Vec2::zeros(), Vec2::zeros());
            let mut excess = 0.0;
            for (j, &weight) in shaking.probes.velocity.iter_row(probe) {
                acceleration += self.acceleration[j] * weight;
                velocity += (self.velocity[j] - self.acceleration[j] * (0.5 * self.dt)) * weight;
                displacement += (self.position[j] - self.initial_position[j]) * weight;
                excess += self.flow.as_ref().map_or(0.0, |flow| flow.excess(j)) * weight;
            }
            for vector in [acceleration, velocity, displacement] {
                put(vector.x);
                put(vector.y);
            }
            if self.flow.is_some() {
                put(excess);
            }
            if shaking.stage.stress_histories {
                let mut sum = [0.0; 6];
                for (s, weight) in shaking.probes.stress.iter_row(probe) {
                    let StressPoint { stress, strain, .. } = &self.points[s];
                    let read = [stress.xx, stress.yy, stress.xy, strain[0], strain[1], strain[2]];
                    for (total, value) in sum.iter_mut().zip(read) {
                        *total += weight * value;
                    }
                }
                sum.into_iter().for_each(&mut put);
            }
        }
        shaking.recorder.push(self.time, self.dt, values);
    }

    /// Refuses motion and pore pressure that are no longer finite, and motion that runs away. Strain and stress are
    /// refused by the soil models, or show in the next step's motion. Free-field columns come first: they drive the section.
    pub(crate) fn guard(&self) -> Result<(), SolverError> {
        if let Active::Shaking(shaking) = &self.active {
            shaking.free_field.as_ref().map_or(Ok(()), FreeField::guard)?;
        }
        self.check_finite("velocity", |simulation, j| simulation.velocity[j].norm(), RUNAWAY_SPEED)?;
        match &self.flow {
            Some(flow) => self.check_finite("pore pressure", |_, j| flow.excess(j).abs(), f64::INFINITY),
            None => Ok(()),
        }
    }

    fn check_finite(
        &self,
        quantity: &'static str,
        value: impl Fn(&Self, usize) -> f64,
        bound: f64,
    ) -> Result<(), SolverError> {
        for j in 0..self.model.nodes() {
            let found = value(self, j);
            // NaN must take the error branch.
            if !(found <= bound) || found == f64::INFINITY {
                return Err(self.diverged(quantity, j, found));
            }
        }
        Ok(())
    }

    fn diverged(&self, quantity: &'static str, j: usize, value: f64) -> SolverError {
        SolverError::Diverged {
            quantity,
            node: self.order[j],
            x: self.position[j].x,
            y: self.position[j].y,
            value,
            time: self.time,
            step: self.step,
        }
    }

    // What a section reads of a free-field column, by internal index.

    /// Makes this simulation a column that follows a section's steps.
    pub(crate) fn column_step(&mut self, dt: f64) -> Result<(), SolverError> {
        self.is_column = true;
        self.dt = dt;
        self.shaking_step()
    }
}

/// Whether a time step is too far from its target to be kept.
pub(crate) fn step_is_outgrown(dt: f64, target: f64) -> bool {
    dt > SHRINK_AT * target || dt * GROW_AT < target
}

/// History channels of one probe. Stress is effective, tension positive.
pub fn channel_names(water: bool, stress: bool) -> Vec<&'static str> {
    let mut names = vec![
        "acceleration_x",
        "acceleration_y",
        "velocity_x",
        "velocity_y",
        "displacement_x",
        "displacement_y",
    ];
    if water {
        names.push("excess_pore_pressure");
    }
    if stress {
        names.extend(["stress_xx", "stress_yy", "stress_xy", "strain_xx", "strain_yy", "gamma_xy"]);
    }
    names
}
