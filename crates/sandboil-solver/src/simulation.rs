//! Stages and stepping: the leapfrog loop, the gravity relaxation and the switch between them.

use crate::{
    balance,
    base::{Base, CompliantBase, Impedance, Vertical},
    boundary::{EdgeNodes, Outline, Walls, base_condition},
    column::ColumnRecord,
    contacts::Contacts,
    deformation::Deformation,
    dispersion::{Dispersion, lumped_masses},
    energy::{EdgeWork, Energy, EnergyHistory, Power},
    error::SolverError,
    flow::{Flow, FlowScheme, Ground},
    free_field::{FreeField, Section},
    free_surface::free_surface,
    geometry::{Geometry, consistent_gradient, point_weights, stress_node_positions, stress_node_values},
    model::{AccelerationTerm, Diffusion, Model, Operators, STRESS_NODES},
    parallel::{Pool, Rows, chunks, for_each_chunk},
    phases::Phases,
    rayleigh::{Rayleigh, RayleighDamping},
    record::{Probes, Recorder},
    run_out::{Flowing, RunOut, Viscosity, stick_to_edges},
    skeleton::{
        NodalShare, PrintedStress, StressPoint, conservative_force, local_damping, maximum_shear_strain,
        motion,
    },
    soil_field::{SoilField, StressWork},
    state::{self, StateError},
    still_water::StillWater,
    timestep::{Criterion, PressureCoupling, PressureSpectrum, region_limit},
    water_edges::MovingBoundary,
};
use sandboil_soil::{Stress, UpdateReport};
use sandboil_sph::Vec2;
use std::io::{self, Write};

/// Steps between checks of stability limit, geometry and finiteness.
pub(crate) const CHECK_INTERVAL: u64 = 16;
/// Time-step factor of the gravity stage: kinetic damping needs no margin for stiffening.
const RELAXATION_FACTOR: f64 = 0.85;
/// Default factor in shaking: soil stiffens in cycles between checks.
pub const SHAKING_FACTOR: f64 = 0.6;
/// The step shrinks when it exceeds its target by this factor, and grows when it falls below by the second.
const SHRINK_AT: f64 = 1.1;
/// See [`SHRINK_AT`].
const GROW_AT: f64 = 1.3;
/// Implicit diffusion is chosen where it lengthens the step by more than this.
const IMPLICIT_GAIN: f64 = 1.2;
/// Largest conductivity for the acceleration term of Eq. 7 when it is left to us, m/s: above, it limits dt.
pub const ACCELERATION_TERM_CONDUCTIVITY: f64 = 3e-3;
/// Speed no soil particle reaches, m/s: a run that does has diverged.
pub(crate) const RUNAWAY_SPEED: f64 = 1e3;
/// Mean over largest unbalanced acceleration that the gravity stage asks for.
const MEAN_RESIDUAL: f64 = 0.1;

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
enum Active {
    None,
    Gravity { stage: Gravity, kinetic_energy: f64, residual: f64, at_rest: bool },
    Shaking(Box<ActiveShaking>),
}

#[derive(Debug, serde::Serialize, serde::Deserialize)]
struct ActiveShaking {
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
struct MotionSum {
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
    /// be read by [`state::note`].
    ///
    /// # Errors
    /// Those of `to`.
    pub fn store(&self, note: &[u8], to: impl Write) -> io::Result<()> {
        state::write(self, note, to)
    }

    /// The simulation that was stored, in the same stage at the same step: it goes on bit for bit as it would have,
    /// with any number of threads.
    ///
    /// # Errors
    /// [`SolverError::State`] for bytes that are damaged or of another model than the one given, or a thread pool
    /// that cannot be made.
    pub fn restore(model: &Model, threads: usize, bytes: &[u8]) -> Result<Self, SolverError> {
        let mut simulation: Self = state::read(bytes)?;
        if simulation.model != sorted(model).0 {
            return Err(StateError::OtherModel.into());
        }
        (simulation.threads, simulation.pool) = (threads, Pool::new(threads)?);
        Ok(simulation)
    }

    /// Begins the static stage: soil elastic, pore pressure frozen, base fixed.
    ///
    /// # Errors
    /// Elastic constants outside their range.
    pub fn begin_gravity(&mut self, stage: Gravity) -> Result<(), SolverError> {
        self.counters = Counters::default();
        self.gravity = Some(stage);
        self.released = None;
        // Statics know no waves, and the edges that they hold bring back the geometry and masses that they know.
        (self.dispersion, self.contacts) = (None, None);
        self.set_walls(Walls::statics(&self.model.outline));
        self.soil = SoilField::elastic(&self.model, &mut self.points)?;
        self.flow = None;
        (self.rayleigh, self.flowing) = (None, None);
        self.weigh();
        let factor = if self.geometry.is_balanced { balance::RESPONSE } else { 1.0 };
        (self.dt, self.criterion) = self.limit(PressureCoupling::None, factor * RELAXATION_FACTOR);
        self.begin(Active::Gravity { stage, kinetic_energy: 0.0, residual: f64::INFINITY, at_rest: false });
        self.set_guests(0);
        self.velocity.fill(Vec2::zeros());
        self.refresh_shares(&vec![Vec2::zeros(); self.model.nodes()]);
        Ok(())
    }

    /// Constant forces of weight and of the pressure at rest.
    fn weigh(&mut self) {
        let gravity = Vec2::new(0.0, -self.model.gravity);
        self.constant_force = self.mass.iter().map(|mass| gravity * *mass).collect();
        if let Some(buoyancy) =
            self.flow.as_ref().and_then(|flow| flow.buoyancy(&self.position, self.phases.volume()))
        {
            self.constant_force.iter_mut().zip(buoyancy).for_each(|(force, buoyancy)| *force += buoyancy);
        } else if self.model.water.is_some() {
            let (suction, pressure): (Vec<f64>, Vec<f64>) =
                self.model.neutral_stress().into_iter().map(|p| (p.min(0.0), p.max(0.0))).unzip();
            if suction.iter().any(|p| *p < 0.0) {
                let pull = self.suction_force(&suction);
                self.constant_force.iter_mut().zip(pull).for_each(|(force, pull)| *force += pull);
            }
            let volume = self.phases.volume();
            let gradient = consistent_gradient(&self.model, &self.position, volume, &pressure);
            for ((force, gradient), volume) in self.constant_force.iter_mut().zip(gradient).zip(volume) {
                *force -= gradient * *volume;
            }
        }
    }

    /// Begins shaking: sand becomes plastic, the base compliant, and whatever force the new base and the state
    /// at rest leave unbalanced is stored as a constant nodal reaction, so that nothing moves until a wave comes.
    /// After another shaking stage the ground goes on as it is: sand, water and motion keep their state, and only
    /// strains, envelopes and the base's impedance begin anew.
    ///
    /// # Errors
    /// A soil model that refuses the stress it is given.
    pub fn begin_shaking(&mut self, mut stage: Shaking) -> Result<(), SolverError> {
        for (name, value, allowed) in [
            ("duration", stage.duration, stage.duration > 0.0 && stage.duration.is_finite()),
            ("time_step_factor", stage.time_step_factor, stage.time_step_factor > 0.0),
            ("history_interval", stage.history_interval, stage.history_interval > 0.0),
        ] {
            if !allowed {
                return Err(SolverError::InvalidInput { name, value, expected: "positive" });
            }
        }
        if let Some(rayleigh) = &stage.rayleigh {
            rayleigh.validate()?;
            if self.model.numerics.operators == Operators::Printed {
                return Err(SolverError::InvalidInput {
                    name: "rayleigh.ratio",
                    value: rayleigh.ratio,
                    expected: "left out with the printed operators, whose force is not the transpose of their strain",
                });
            }
        }
        if self.flowing.is_some() {
            return Err(SolverError::Order { call: "begin_shaking", needs: "ground that has not flowed" });
        }
        if let Some(run_out) = &stage.run_out {
            run_out.validate(&self.model, &stage)?;
        }
        if self.model.numerics.dispersion_correction && stage.free_field.contains(&true) {
            return Err(SolverError::InvalidInput {
                name: "dispersion_correction",
                value: 1.0,
                expected: "left out beside free-field sides, whose push does not know of it",
            });
        }
        self.counters = Counters::default();
        self.rayleigh = stage.rayleigh.map(|law| RayleighDamping::new(law, self.points.len()));
        // Ground that flows is slow beside its waves.
        let corrected = self.model.numerics.dispersion_correction && stage.run_out.is_none();
        self.dispersion = corrected.then(|| Dispersion::new(&self.model, self.points.len()));
        let absorbs = stage.base.vertical == Vertical::Absorbing;
        // Another stage of shaking keeps the columns of the one before.
        let (goes_on, mut free_field) = match std::mem::replace(&mut self.active, Active::None) {
            Active::Shaking(before) => (true, before.free_field),
            _ => (false, None),
        };
        if let Some(run_out) = &stage.run_out {
            free_field = None;
            self.hold_edges(run_out);
        } else if goes_on {
            self.renew_geometry(free_field.as_mut());
        } else {
            self.released = Some(self.position.clone());
            self.set_walls(Walls::shaken(
                &self.model.outline,
                base_condition(self.model.numerics.operators, absorbs),
                stage.free_field,
            ));
        }
        if !goes_on {
            self.velocity.fill(Vec2::zeros());
            self.acceleration.fill(Vec2::zeros());
            self.soil = SoilField::plastic(&self.model, &mut self.points, None)?;
            self.counters.inadmissible_starts = self.soil.inadmissible_starts();
            self.contacts = corrected.then(|| Contacts::new(&self.model, &self.points));
            self.sharpen_contacts();
        }
        self.phases.restart_strain();
        for point in &mut self.points {
            point.strain = [0.0; 3];
        }
        // Ground that flows leaves the points of its base.
        let impedance = if self.flowing.is_some() { Vec::new() } else { self.base_impedance(&stage.base)? };
        let edges = (&self.edges, self.position.as_slice());
        let mut base = CompliantBase::new(&self.model, edges, &self.mass, impedance, &stage.base);
        if let Some(dispersion) = &self.dispersion {
            let spread = dispersion.spread(&self.geometry, &self.points, &self.mass, base.dashpots());
            base.spread_by(spread, self.model.nodes());
        }
        let outline = self.present_outline();
        let section = self.section(&outline);
        let mut free_field = match free_field {
            Some(mut free_field) => {
                free_field.begin_shaking(&section, &stage)?;
                Some(free_field)
            }
            None => FreeField::new(&section, stage.free_field, self.gravity, &stage)?,
        };
        // The columns hold theirs.
        stage.column_records = [None, None];
        let scheme = self.flow_scheme(stage.time_step_factor);
        let before = self.flow.take();
        self.flow = Flow::new(self.ground(&outline), scheme, &stage.conditions)?;
        if let Some(run_out) = &stage.run_out {
            self.stand_in_water(run_out, before.as_ref())?;
        } else if let (Some(flow), Some(before)) = (&mut self.flow, before) {
            flow.set_excess(|excess| excess.copy_from_slice(before.own_excess()));
        }
        if let Some(free_field) = &mut free_field {
            self.set_guests(free_field.guests());
            free_field.tie(&mut self.geometry, self.model.nodes());
        }
        let coupling = match (&self.flow, scheme) {
            (None, _) => PressureCoupling::None,
            (_, FlowScheme::Implicit) => PressureCoupling::Implicit,
            _ => PressureCoupling::Explicit,
        };
        (self.dt, self.criterion) = self.shared_limit(coupling, stage.time_step_factor, free_field.as_ref());
        let stress_position = stress_node_positions(&self.position, self.model.spacing);
        let probes = Probes {
            velocity: point_weights(&self.model, &self.position, &stage.probes),
            stress: if stage.stress_histories {
                point_weights(&self.model, &stress_position, &stage.probes)
            } else {
                sandboil_sph::Csr::default()
            },
        };
        let channels = stage.probes.len() * channel_names(self.flow.is_some(), stage.stress_histories).len();
        self.begin(Active::Shaking(Box::new(ActiveShaking {
            recorder: Recorder::new(channels, stage.history_interval, self.dt),
            energy: Energy::new(self.kinetic_energy()),
            energy_history: EnergyHistory::new(stage.history_interval),
            channel_values: vec![0.0; channels],
            pressure_envelope: (stage.pressure_envelope && self.flow.is_some())
                .then(|| vec![0.0; self.model.nodes()]),
            strain_envelope: stage.strain_envelope.then(|| vec![0.0; self.points.len()]),
            base,
            free_field,
            coupling,
            probes,
            stage,
        })));
        if self.flowing.is_some() {
            self.soil.let_flow();
            self.weigh();
        } else if !goes_on {
            self.store_reaction();
        }
        Ok(())
    }

    /// Holds base and sides as in statics where they now stand, and lets go of the ground.
    fn hold_edges(&mut self, run_out: &RunOut) {
        let mut outline = self.present_outline();
        for (side, is_open) in outline.sides.iter_mut().zip(run_out.open) {
            *side = side.filter(|_| !is_open);
        }
        let lattice = {
            let Model { position, volume, .. } = &self.model;
            let edges = (&self.model.outline, Walls::statics(&self.model.outline));
            Geometry::build(&self.model, position, volume, edges, None).sharpness(volume)
        };
        self.set_guests(0);
        (self.released, self.contacts) = (None, None);
        self.walls = Walls::statics(&outline);
        self.flowing = Some(Flowing {
            viscosity: Viscosity::new(run_out.viscosity, self.model.nodes()),
            outline,
            lattice,
            pace: 1.0,
            free_surface: Vec::new(),
        });
        // The flow is made anew.
        let flow = self.flow.take();
        self.rebuild_geometry();
        self.flow = flow;
        self.refresh_present_shares();
    }

    /// Puts ground that flows, with the pore water that it had `before`, into the still water around it.
    fn stand_in_water(&mut self, run_out: &RunOut, before: Option<&Flow>) -> Result<(), SolverError> {
        let (Some(mut flow), Some(water)) = (self.flow.take(), self.model.water) else { return Ok(()) };
        let still = match &run_out.still_water {
            Some(line) => StillWater::new(water, line)?,
            None => StillWater::at_rest(&self.model, water),
        };
        let at_rest = self.model.neutral_stress();
        let gained = |node| before.map_or(0.0, |flow| flow.neutral(node));
        let neutral = at_rest.iter().enumerate().map(|(node, rest)| rest + gained(node)).collect();
        let saturation = before.and_then(Flow::saturation);
        let holds_air = |node| {
            saturation.as_ref().map_or_else(|| self.model.saturation(node), |of_node| of_node(node)) < 1.0
        };
        let holds_air = (0..self.model.nodes()).map(holds_air).collect();
        let excess: Vec<f64> =
            (0..self.model.nodes()).map(|node| before.map_or(0.0, |flow| flow.excess(node))).collect();
        flow.stand_in(still, self.ground(&self.present_outline()), (neutral, &excess), holds_air);
        self.flow = Some(flow);
        Ok(())
    }

    /// Force of suction (kPa, negative) on every node, kN/m. Water under pressure goes on as a pond beyond the ground
    /// surface, so that its gradient is all its force; suction ends there, and draws the surface to the ground: it acts
    /// as the stress that it is a part of, which no traction meets at the surface.
    fn suction_force(&mut self, suction: &[f64]) -> Vec<Vec2> {
        let places = stress_node_positions(&self.position, self.model.spacing);
        let weights = point_weights(&self.model, &self.position, &places);
        let kept: Vec<Stress> = self.points.iter().map(|point| point.stress).collect();
        for (s, point) in self.points.iter_mut().enumerate() {
            let pull = -weights.iter_row(s).map(|(node, w)| w * suction[node]).sum::<f64>();
            point.stress = Stress { xx: pull, yy: pull, zz: pull, xy: 0.0 };
        }
        let force = self.static_force();
        for (point, stress) in self.points.iter_mut().zip(kept) {
            point.stress = stress;
        }
        force
    }

    /// Makes the present state one of rest: the constant forces balance whatever stress and pressure leave over.
    pub(crate) fn store_reaction(&mut self) {
        self.constant_force = self.static_force().iter().map(|force| -force).collect();
    }

    /// Makes the excess pressure at the start of a stage one that a load holds, which stays. It bears on the nodes tied to
    /// the surface, too: their pressure drains at once, what it carried does not go away.
    pub(crate) fn store_load(&mut self) {
        self.store_reaction();
        let (Some(flow), Some(tables), None) = (&self.flow, &self.geometry.flow, &self.geometry.printed)
        else {
            return;
        };
        for (j, constant) in self.constant_force.iter_mut().enumerate() {
            *constant -= flow.held_back(tables, j);
        }
    }

    /// Force of stress and pressure alone on every node, kN/m: without the velocity filter.
    fn static_force(&mut self) -> Vec<Vec2> {
        self.refresh_shares(&vec![Vec2::zeros(); self.velocity.len()]);
        self.prepare_printed_stress();
        let force = |j| self.internal_force(j, Vec2::zeros(), self.water_force(j));
        (0..self.model.nodes()).map(force).collect()
    }

    /// Builds the geometry anew under way, and with it that of free-field columns. A strained lattice meets other
    /// weights than the one it came from; the difference they make to the force of the present stresses stays as a
    /// constant force, so that the soil is not struck by the change: blows of a few hundredths of gravity would liquefy
    /// it further.
    pub(crate) fn renew_geometry(&mut self, free_field: Option<&mut FreeField>) {
        if self.flowing.is_some() {
            let before = self.mass.clone();
            self.rebuild_geometry();
            // Water that pores have taken in was at rest; what they have lost leaves with them.
            for ((v, before), mass) in self.velocity.iter_mut().zip(before).zip(&self.mass) {
                *v *= (before / mass).min(1.0);
            }
            self.weigh();
            self.refresh_present_shares();
            return;
        }
        let mut before = self.static_force();
        self.rebuild_geometry();
        let after = self.static_force();
        if let Some(free_field) = free_field {
            free_field.add_push(&mut before);
            free_field.renew_columns();
            let outline = self.present_outline();
            free_field.renew(&self.section(&outline));
            free_field.tie(&mut self.geometry, self.model.nodes());
        }
        for ((constant, before), after) in self.constant_force.iter_mut().zip(before).zip(after) {
            *constant += before - after;
        }
        self.refresh_present_shares();
    }

    /// Makes room for the velocities of free-field columns behind those of the nodes.
    fn set_guests(&mut self, guests: usize) {
        for motion in [&mut self.velocity, &mut self.acceleration] {
            motion.resize(self.model.nodes() + guests, Vec2::zeros());
        }
    }

    /// The edges where they now stand: in shaking they go with the nodes along them, as far as they are free to.
    fn present_outline(&self) -> Outline {
        if let Some(Flowing { outline, .. }) = &self.flowing {
            return outline.clone();
        }
        let Some(released) = &self.released else { return self.model.outline.clone() };
        let moved = |nodes: &[usize], free: [bool; 2]| {
            let total: Vec2 = nodes.iter().map(|&node| self.position[node] - released[node]).sum();
            let mean = total / nodes.len().max(1) as f64;
            Vec2::new(if free[0] { mean.x } else { 0.0 }, if free[1] { mean.y } else { 0.0 })
        };
        let sides = [0, 1].map(|k| moved(&self.edges.sides[k], self.walls.sides[k].lets_go()));
        self.model.outline.moved(moved(&self.edges.base, self.walls.base.lets_go()), sides)
    }

    fn section<'a>(&'a self, outline: &'a Outline) -> Section<'a> {
        Section {
            model: &self.model,
            outline,
            walls: self.walls,
            edges: &self.edges,
            position: &self.position,
            phases: &self.phases,
            mass: &self.mass,
        }
    }

    fn ground<'a>(&'a self, outline: &'a Outline) -> Ground<'a> {
        Ground {
            model: &self.model,
            phases: &self.phases,
            geometry: &self.geometry,
            position: &self.position,
            edges: (outline, self.walls),
            free_surface: self.flowing.as_ref().map(|flowing| flowing.free_surface.as_slice()),
        }
    }

    /// Gives the section an excess pore pressure (kPa, user's node order) before the first step of shaking, held
    /// in balance by a load that stays: the start of consolidation under a load just put on.
    ///
    /// # Errors
    /// A dry section, a stage that has begun to move, or an array of the wrong length.
    pub fn set_excess_pore_pressure(&mut self, excess: &[f64]) -> Result<(), SolverError> {
        let (found, expected) = (excess.len(), self.model.nodes());
        if found != expected {
            return Err(SolverError::Shape { name: "excess_pore_pressure", found, expected });
        }
        let (Active::Shaking(shaking), 0, Some(flow)) = (&mut self.active, self.step, &mut self.flow) else {
            return Err(SolverError::Order {
                call: "set_excess_pore_pressure",
                needs: "water and a shaking stage that has just begun",
            });
        };
        flow.set_excess(|own| {
            for (slot, &user) in own.iter_mut().zip(&self.order) {
                *slot = excess[user];
            }
        });
        if let Some(free_field) = &mut shaking.free_field {
            free_field.set_excess(&self.edges, flow.own_excess());
        }
        self.store_load();
        Ok(())
    }

    /// Gives the section a velocity field (m/s, user's node order) before the first step of shaking: waves under way.
    ///
    /// # Errors
    /// A stage that has begun to move, or an array of the wrong length.
    pub fn set_velocity(&mut self, velocity: &[[f64; 2]]) -> Result<(), SolverError> {
        let (found, expected) = (velocity.len(), self.model.nodes());
        if found != expected {
            return Err(SolverError::Shape { name: "velocity", found, expected });
        }
        let (Active::Shaking(_), 0) = (&self.active, self.step) else {
            return Err(SolverError::Order {
                call: "set_velocity",
                needs: "a shaking stage that has just begun",
            });
        };
        for (slot, &user) in self.velocity.iter_mut().zip(&self.order) {
            *slot = velocity[user].into();
        }
        self.refresh_present_shares();
        Ok(())
    }

    fn begin(&mut self, active: Active) {
        self.active = active;
        self.time = 0.0;
        self.step = 0;
    }

    fn set_walls(&mut self, walls: Walls) {
        if walls != self.walls {
            self.walls = walls;
            self.rebuild_geometry();
        }
    }

    fn rebuild_geometry(&mut self) {
        // The tables are replaced as a whole; the lists of the old ones serve while no node left their skin.
        let previous = self.geometry.clone();
        self.follow_volumes();
        let outline = self.present_outline();
        let (volume, walls) = (self.phases.volume(), (&outline, self.walls));
        self.geometry = Geometry::build(&self.model, &self.position, volume, walls, Some(previous));
        self.follow_flow();
        if let Some(mut flow) = self.flow.take() {
            flow.follow(self.ground(&outline), self.time);
            self.flow = Some(flow);
        }
        self.counters.geometry_builds += 1;
        self.sharpen_contacts();
    }

    /// Lets waves see contacts and edges as they are, if inertia is corrected for them: strain with its kinks, and the
    /// masses that the operators give.
    fn sharpen_contacts(&mut self) {
        let Some(contacts) = &self.contacts else { return };
        let outline = self.present_outline();
        let value = stress_node_values(&self.model, &self.position, (&outline, self.walls));
        self.mass = lumped_masses(&value, &self.points, self.model.nodes());
        let changed = (&mut self.geometry, self.mass.as_mut_slice());
        contacts.sharpen(&self.model, &self.position, &self.points, &value, changed);
    }

    /// Volumes, densities and masses of the present strain, from which deformation starts anew.
    fn follow_volumes(&mut self) {
        self.counters.porosity_clips += self.phases.follow(&self.points);
        for (node, mass) in self.mass.iter_mut().enumerate() {
            *mass = self.phases.mass(node);
            let volume = self.phases.volume()[node];
            for point in &mut self.points[STRESS_NODES * node..STRESS_NODES * (node + 1)] {
                point.density = *mass / volume;
                point.volume = volume / STRESS_NODES as f64;
                point.deformation = Deformation::default();
            }
        }
    }

    /// Fills the force loop's shares from the present stress and a velocity field.
    fn refresh_shares(&mut self, velocity: &[Vec2]) {
        let filter = self.filter();
        for s in 0..self.points.len() {
            let motion = motion(&self.geometry, s, velocity);
            self.shares[s] = motion.share(&self.points[s], self.geometry.covariance[s], filter);
        }
        if let Some(rayleigh) = &mut self.rayleigh {
            rayleigh.add_stress(false, &self.geometry, velocity, &self.points, &mut self.shares);
        }
    }

    /// The same from the present motion.
    fn refresh_present_shares(&mut self) {
        let velocity = std::mem::take(&mut self.velocity);
        self.refresh_shares(&velocity);
        self.velocity = velocity;
    }

    /// Lets what flowing ground knows of its geometry follow, its free surface if water may cross it.
    fn follow_flow(&mut self) {
        let Some(mut flowing) = self.flowing.take() else { return };
        flowing.follow(self.geometry.sharpness(self.phases.volume()));
        if self.model.water.is_some() {
            let edges = (&flowing.outline, self.walls);
            let volume = self.phases.volume();
            flowing.free_surface = free_surface(self.threads > 1, &self.model, &self.position, volume, edges);
        }
        self.flowing = Some(flowing);
    }

    /// Strength `xi / dx` of the velocity filter, 1/m.
    fn filter(&self) -> f64 {
        self.model.numerics.velocity_filter / self.model.mean_spacing()
    }

    fn flow_scheme(&self, factor: f64) -> FlowScheme {
        let numerics = self.model.numerics;
        let conductivity =
            self.model.regions.iter().map(|r| r.hydraulic_conductivity.major).fold(0.0, f64::max);
        if conductivity == 0.0 {
            return FlowScheme::Undrained;
        }
        let implicit = match numerics.diffusion {
            Diffusion::Implicit => true,
            Diffusion::Explicit => false,
            Diffusion::Auto => {
                let limit = |coupling| self.limit(coupling, factor).0;
                limit(PressureCoupling::Implicit) > IMPLICIT_GAIN * limit(PressureCoupling::Explicit)
            }
        };
        let acceleration = match numerics.acceleration_term {
            AccelerationTerm::On => true,
            AccelerationTerm::Off => false,
            AccelerationTerm::Auto => conductivity <= ACCELERATION_TERM_CONDUCTIVITY,
        };
        match (implicit, acceleration) {
            (true, _) => FlowScheme::Implicit,
            (false, true) => FlowScheme::ExplicitWithAcceleration,
            (false, false) => FlowScheme::Explicit,
        }
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

    /// The half-space below each base point: as given, or of the layer above it, with the model's small-strain moduli at
    /// the base's stress.
    fn base_impedance(&self, base: &Base) -> Result<Vec<Impedance>, SolverError> {
        let points = self.edges.base_points(&self.model, &self.position);
        let stress_position = stress_node_positions(&self.position, self.model.spacing);
        let weights = point_weights(&self.model, &stress_position, &points);
        self.edges
            .base
            .iter()
            .enumerate()
            .map(|(point, &node)| {
                let at_base = |component: &dyn Fn(&Stress) -> f64| -> f64 {
                    weights.iter_row(point).map(|(s, w)| w * component(&self.points[s].stress)).sum()
                };
                let stress = Stress {
                    xx: at_base(&|s| s.xx),
                    yy: at_base(&|s| s.yy),
                    xy: at_base(&|s| s.xy),
                    zz: at_base(&|s| s.zz),
                };
                let Some(given) = base.half_space else { return self.impedance_at(node, stress) };
                // Without a compression-wave speed nothing needs one: a level roller base.
                let compression_speed = given.compression_speed.unwrap_or(given.shear_speed);
                Ok(Impedance { density: given.density, shear_speed: given.shear_speed, compression_speed })
            })
            .collect()
    }

    /// Density and small-strain wave speeds of the soil of a node at a stress; the compression wave's undrained.
    fn impedance_at(&self, node: usize, stress: Stress) -> Result<Impedance, SolverError> {
        let region = self.model.region[node] as usize;
        let density = self.model.mixture_density(region);
        let moduli = self.model.regions[region].soil.small_strain_moduli(stress);
        let moduli = moduli.map_err(|source| SolverError::Soil { region, node, source })?;
        let water = self.model.water_stiffness(self.model.regions[region].porosity);
        Ok(Impedance {
            density,
            shear_speed: (moduli.shear / density).sqrt(),
            compression_speed: ((moduli.bulk + 4.0 / 3.0 * moduli.shear + water) / density).sqrt(),
        })
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

    /// Whether some stress node is strained beyond what its weights bear.
    fn is_strained(&self) -> bool {
        let limit = self.model.numerics.geometry_strain_limit();
        if self.flowing.is_some() && self.geometry.is_left(&self.model, &self.position) {
            return true;
        }
        self.points.iter().any(|point| point.deformation.magnitude() > limit)
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

    /// Internal index of every node, in the user's order.
    pub(crate) fn internal_order(&self) -> Vec<usize> {
        let mut internal = vec![0; self.order.len()];
        for (j, &user) in self.order.iter().enumerate() {
            internal[user] = j;
        }
        internal
    }

    /// Velocity of a node, m/s.
    pub(crate) fn velocity_of(&self, node: usize) -> Vec2 {
        self.velocity[node]
    }

    /// Acceleration of a node, m/s2.
    pub(crate) fn acceleration_of(&self, node: usize) -> Vec2 {
        self.acceleration[node]
    }

    /// Nominal effective stress `[xx, xy, yx, yy]` of a stress node, kPa.
    pub(crate) fn nominal_stress(&self, s: usize) -> [f64; 4] {
        let StressPoint { deformation, stress, .. } = &self.points[s];
        deformation.cofactor().nominal(stress)
    }

    /// Nominal excess pore pressure `q J F^-T` of a node, kPa; zero without water.
    pub(crate) fn nominal_water(&self, node: usize) -> [f64; 4] {
        self.flow.as_ref().map_or([0.0; 4], |flow| flow.nominal(node))
    }

    /// Sets the excess pore pressure of a node, kPa.
    pub(crate) fn set_excess_at(&mut self, node: usize, excess: f64) {
        if let Some(flow) = &mut self.flow {
            flow.set_excess(|own| own[node] = excess);
        }
    }

    /// Traction of the compliant base in the last step, mean over its points, kPa.
    pub(crate) fn base_traction(&self) -> Vec2 {
        let Active::Shaking(shaking) = &self.active else { return Vec2::zeros() };
        let dashpots = shaking.base.dashpots();
        let total: Vec2 =
            dashpots.all().iter().zip(dashpots.traction()).map(|(d, traction)| d.direction * *traction).sum();
        total / self.edges.base.len().max(1) as f64
    }

    /// Density and small-strain wave speeds at a node's own stress.
    pub(crate) fn small_strain_impedance(&self, node: usize) -> Result<Impedance, SolverError> {
        let [one, other] = [0, 1].map(|k| self.points[STRESS_NODES * node + k].stress);
        let mean = |a: f64, b: f64| 0.5 * (a + b);
        let stress = Stress {
            xx: mean(one.xx, other.xx),
            yy: mean(one.yy, other.yy),
            xy: mean(one.xy, other.xy),
            zz: mean(one.zz, other.zz),
        };
        self.impedance_at(node, stress)
    }

    /// Time in the stage, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Steps made in the stage.
    pub fn step(&self) -> u64 {
        self.step
    }

    /// Present time step, s, and what limits it.
    pub fn time_step(&self) -> (f64, Criterion) {
        (self.dt, self.criterion)
    }

    /// Time step that the present stiffness would allow without the stage's Rayleigh damping, s; `None` if it has none.
    pub fn undamped_time_step(&self) -> Option<f64> {
        match (&self.active, &self.rayleigh) {
            (Active::Shaking(shaking), Some(_)) => {
                Some(self.limit_under(None, shaking.coupling, shaking.stage.time_step_factor).0)
            }
            _ => None,
        }
    }

    /// Largest unbalanced acceleration over gravity in the gravity stage; infinite before its first step.
    pub fn residual(&self) -> f64 {
        match self.active {
            Active::Gravity { residual, .. } => residual,
            _ => f64::INFINITY,
        }
    }

    /// Work done in the stage; the section's first geometry belongs to none.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// How pore pressure is advanced in the stage, in the user's words.
    pub fn flow_scheme_name(&self) -> &'static str {
        self.flow.as_ref().map_or("none", Flow::scheme_name)
    }

    /// Number of velocity nodes.
    pub fn nodes(&self) -> usize {
        self.model.nodes()
    }

    /// Pairs between stress and velocity nodes, images folded.
    pub fn pairs(&self) -> usize {
        self.geometry.pairs()
    }

    /// Dashpot coefficients of the base points, kPa s/m; empty without a compliant base.
    pub fn base_impedances(&self) -> Vec<f64> {
        match &self.active {
            Active::Shaking(shaking) => {
                shaking.base.impedance().iter().map(|below| below.density * below.shear_speed).collect()
            }
            _ => Vec::new(),
        }
    }

    /// Names and bytes of the arrays that exist: what a scene did not ask for is not in the list.
    pub fn arrays(&self) -> Vec<(&'static str, usize)> {
        let nodes = self.model.nodes();
        let mut arrays = vec![
            ("motion", 5 * nodes * size_of::<Vec2>()),
            ("stress", size_of_val(self.points.as_slice()) + size_of_val(self.shares.as_slice())),
            ("geometry", self.geometry.bytes()),
            ("phases", self.phases.bytes()),
        ];
        if let Some(flow) = &self.flow {
            arrays.push(("pore_pressure", flow.bytes()));
        }
        if self.soil.plastic_points() > 0 {
            arrays.push(("soil_state", self.soil.state_bytes()));
        }
        if let Some(printed) = &self.printed_stress {
            arrays.push(("printed_stress", printed.bytes()));
        }
        if let Some(rayleigh) = &self.rayleigh {
            arrays.push(("viscous_stress", rayleigh.bytes()));
        }
        if let Some(flowing) = &self.flowing {
            arrays.push(("run_out", flowing.bytes()));
        }
        if let Some(dispersion) = &self.dispersion {
            let contacts = self.contacts.as_ref().map_or(0, Contacts::bytes);
            arrays.push(("inertia_correction", dispersion.bytes() + contacts));
        }
        if let Active::Shaking(shaking) = &self.active {
            arrays.push(("base", shaking.base.bytes()));
            if let Some(free_field) = &shaking.free_field {
                arrays.push(("free_field", free_field.bytes()));
            }
            if let Some(envelope) = &shaking.pressure_envelope {
                arrays.push(("pressure_envelope", size_of_val(envelope.as_slice())));
            }
            if let Some(envelope) = &shaking.strain_envelope {
                arrays.push(("strain_envelope", size_of_val(envelope.as_slice())));
            }
        }
        arrays
    }

    fn in_user_order<T: Copy + Default>(&self, value: impl Fn(usize) -> T) -> Vec<T> {
        let mut out = vec![T::default(); self.model.nodes()];
        for (j, &user) in self.order.iter().enumerate() {
            out[user] = value(j);
        }
        out
    }

    /// Positions without periodic wrapping (virtual coordinates), m: lateral sway is seen.
    pub fn position(&self) -> Vec<[f64; 2]> {
        self.in_user_order(|j| self.position[j].into())
    }

    /// Displacements since the section was built, m.
    pub fn displacement(&self) -> Vec<[f64; 2]> {
        self.in_user_order(|j| (self.position[j] - self.initial_position[j]).into())
    }

    /// Velocities at the middle of the last step, m/s.
    pub fn velocity(&self) -> Vec<[f64; 2]> {
        self.in_user_order(|j| self.velocity[j].into())
    }

    /// Accelerations of the last step, m/s2.
    pub fn acceleration(&self) -> Vec<[f64; 2]> {
        self.in_user_order(|j| self.acceleration[j].into())
    }

    /// Excess pore pressure since shaking began, kPa; `None` without water.
    pub fn excess_pore_pressure(&self) -> Option<Vec<f64>> {
        self.model.water?;
        Some(self.in_user_order(|j| self.flow.as_ref().map_or(0.0, |flow| flow.excess(j))))
    }

    /// Degree of saturation; `None` where it cannot change: without retention curves, and before shaking.
    pub fn saturation(&self) -> Option<Vec<f64>> {
        let saturation = self.flow.as_ref()?.saturation()?;
        Some(self.in_user_order(saturation))
    }

    /// Effective stress `(xx, yy, xy, zz)` of every velocity node's two stress nodes, kPa, tension positive.
    pub fn stress(&self) -> Vec<[[f64; 4]; STRESS_NODES]> {
        self.in_user_order(|j| {
            [0, 1].map(|k| {
                let Stress { xx, yy, xy, zz } = self.points[STRESS_NODES * j + k].stress;
                [xx, yy, xy, zz]
            })
        })
    }

    /// Strain `(xx, yy, engineering xy)` since the stage began of every velocity node's two stress nodes.
    pub fn strain(&self) -> Vec<[[f64; 3]; STRESS_NODES]> {
        self.in_user_order(|j| [0, 1].map(|k| self.points[STRESS_NODES * j + k].strain))
    }

    /// Largest excess pore pressure of every node since shaking began, kPa, if it is kept.
    pub fn largest_excess_pore_pressure(&self) -> Option<Vec<f64>> {
        let Active::Shaking(shaking) = &self.active else { return None };
        let envelope = shaking.pressure_envelope.as_ref()?;
        Some(self.in_user_order(|j| envelope[j]))
    }

    /// Largest engineering shear strain of every node since shaking began, if it is kept.
    pub fn largest_shear_strain(&self) -> Option<Vec<f64>> {
        let Active::Shaking(shaking) = &self.active else { return None };
        let envelope = shaking.strain_envelope.as_ref()?;
        Some(self.in_user_order(|j| envelope[STRESS_NODES * j].max(envelope[STRESS_NODES * j + 1])))
    }

    /// Names of the history channels of each probe, in the order of [`Simulation::take_histories`].
    pub fn channel_names(&self) -> Vec<&'static str> {
        match &self.active {
            Active::Shaking(shaking) => channel_names(self.flow.is_some(), shaking.stage.stress_histories),
            _ => Vec::new(),
        }
    }

    /// Closes the samples still collecting, for a run that ends before its stage does: their windows are one-sided.
    pub fn finish_histories(&mut self) {
        let time = self.time;
        if let Active::Shaking(shaking) = &mut self.active {
            shaking.recorder.finish(time);
        }
    }

    /// Samples of energy and masses since the last call: times (s) and one row of [`crate::ENERGY_NAMES`] for each.
    pub fn take_energy(&mut self) -> (Vec<f64>, Vec<f64>) {
        match &mut self.active {
            Active::Shaking(shaking) => shaking.energy_history.take(),
            _ => (Vec::new(), Vec::new()),
        }
    }

    /// History samples finished since the last call: times (s) and one row for each time, probe after probe.
    pub fn take_histories(&mut self) -> (Vec<f64>, Vec<f64>) {
        match &mut self.active {
            Active::Shaking(shaking) => shaking.recorder.take(),
            _ => (Vec::new(), Vec::new()),
        }
    }
}

/// Whether a time step is too far from its target to be kept.
pub(crate) fn step_is_outgrown(dt: f64, target: f64) -> bool {
    dt > SHRINK_AT * target || dt * GROW_AT < target
}

/// History channels of one probe. Stress is effective, tension positive.
fn channel_names(water: bool, stress: bool) -> Vec<&'static str> {
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

/// The model with nodes sorted by region, then by row and column of the lattice, and the user's index of each:
/// soil loops run over contiguous rows of one law, and neighbours lie near in memory.
pub(crate) fn sorted(model: &Model) -> (Model, Vec<usize>) {
    let lowest = model.position.iter().map(|x| x.y).fold(f64::INFINITY, f64::min);
    let row = |i: usize| ((model.position[i].y - lowest) / model.spacing.y).round();
    let mut order: Vec<usize> = (0..model.nodes()).collect();
    order.sort_by(|&a, &b| {
        let key = |i: usize| (model.region[i], row(i), model.position[i].x);
        let ((ra, ya, xa), (rb, yb, xb)) = (key(a), key(b));
        ra.cmp(&rb).then(ya.total_cmp(&yb)).then(xa.total_cmp(&xb)).then(a.cmp(&b))
    });
    let sorted = Model {
        position: order.iter().map(|&i| model.position[i]).collect(),
        volume: order.iter().map(|&i| model.volume[i]).collect(),
        region: order.iter().map(|&i| model.region[i]).collect(),
        surface_elevation: order.iter().map(|&i| model.surface_elevation[i]).collect(),
        vertical_effective_stress: order
            .iter()
            .flat_map(|&i| [0, 1].map(|k| model.vertical_effective_stress[STRESS_NODES * i + k]))
            .collect(),
        pore_pressure: order.iter().filter_map(|&i| model.pore_pressure.get(i).copied()).collect(),
        saturation: order.iter().filter_map(|&i| model.saturation.get(i).copied()).collect(),
        ..model.clone()
    };
    (sorted, order)
}
