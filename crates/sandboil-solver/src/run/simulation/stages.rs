//! How stages begin: edges, soils, water and the constant forces that they start from.

use super::{
    ACCELERATION_TERM_CONDUCTIVITY, Active, ActiveShaking, Counters, Gravity, IMPLICIT_GAIN,
    RELAXATION_FACTOR, Shaking, Simulation, channel_names,
};

use crate::{
    edges::{
        base::{Base, Impedance, Vertical, base_condition},
        compliant_base::CompliantBase,
    },
    error::SolverError,
    run::{
        energy::{Energy, EnergyHistory},
        histories::{Probes, Recorder},
        time_step::PressureCoupling,
    },
    section::{
        description::{AccelerationTerm, Diffusion, Model, Operators},
        outline::Walls,
    },
    skeleton::{
        contacts::Contacts, inertia::Dispersion, rayleigh::RayleighDamping, soils::SoilField,
        viscosity::Viscosity,
    },
    stages::{
        free_field::FreeField,
        run_out::{Flowing, RunOut},
    },
    water::{
        pore_pressure::{Flow, FlowScheme},
        still_water::StillWater,
    },
    weights::{
        balance,
        geometry::Geometry,
        points::{consistent_gradient, point_weights, stress_node_positions},
    },
};
use sandboil_soil::Stress;
use sandboil_sph::Vec2;

impl Simulation {
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
    pub(super) fn weigh(&mut self) {
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
    pub(super) fn hold_edges(&mut self, run_out: &RunOut) {
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
    pub(super) fn stand_in_water(
        &mut self,
        run_out: &RunOut,
        before: Option<&Flow>,
    ) -> Result<(), SolverError> {
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
    pub(super) fn suction_force(&mut self, suction: &[f64]) -> Vec<Vec2> {
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
    pub(super) fn static_force(&mut self) -> Vec<Vec2> {
        self.refresh_shares(&vec![Vec2::zeros(); self.velocity.len()]);
        self.prepare_printed_stress();
        let force = |j| self.internal_force(j, Vec2::zeros(), self.water_force(j));
        (0..self.model.nodes()).map(force).collect()
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
        // Ground that flows has no load that stays.
        let is_held = self.flowing.is_none();
        let (Active::Shaking(shaking), 0, Some(flow), true) =
            (&mut self.active, self.step, &mut self.flow, is_held)
        else {
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

    pub(super) fn begin(&mut self, active: Active) {
        self.active = active;
        self.time = 0.0;
        self.step = 0;
    }

    pub(super) fn set_walls(&mut self, walls: Walls) {
        if walls != self.walls {
            self.walls = walls;
            self.rebuild_geometry();
        }
    }

    pub(super) fn flow_scheme(&self, factor: f64) -> FlowScheme {
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

    /// The half-space below each base point: as given, or of the layer above it, with the model's small-strain moduli at
    /// the base's stress.
    pub(super) fn base_impedance(&self, base: &Base) -> Result<Vec<Impedance>, SolverError> {
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
    pub(super) fn impedance_at(&self, node: usize, stress: Stress) -> Result<Impedance, SolverError> {
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
}
