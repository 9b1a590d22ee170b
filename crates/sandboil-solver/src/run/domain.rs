//! The ground and the parts of its steps: forces, accelerations, stress, and the limit of the time step.

use crate::{
    error::SolverError,
    parallel::{Rows, chunks, for_each_chunk},
    run::{
        clock::{Clock, Counters},
        forces::{ConstantForces, NodalForces, Power},
        ground::Ground,
        time_step::{Limits, PressureCoupling, PressureSpectrum, TimeLimit, region_limit},
    },
    section::{
        description::Model,
        outline::{EdgesView, Walls},
        stress_layout::StressLayout,
    },
    skeleton::{
        contacts::Contacts,
        inertia::{Dispersion, lumped_masses},
        local_damping::local_damping,
        printed::PrintedStress,
        rayleigh::{Rayleigh, RayleighDamping},
        shared_volume::{SharedStrain, carry_dry},
        soils::{StrainStep, StressRows, StressWork},
        strain_and_force::{NodalShare, motion},
        viscosity::{MovingNodes, Viscosity},
    },
    water::{
        pore_pressure::{SkeletonMotion, TimeStep},
        pore_water::PoreWater,
        still_water::suction_and_pressure,
    },
    weights::{
        balance,
        geometry::Geometry,
        points::{consistent_gradient, point_weights, stress_node_values},
    },
};
use sandboil_soil::Stress;
use sandboil_sph::Vec2;

/// Speed that no soil particle reaches, m/s: a run that reaches it has diverged.
pub const RUNAWAY_SPEED: f64 = 1e3;

/// Damping of a stage.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct ActiveDamping {
    /// Local damping `xi_l` of Eq. 16.
    pub local: f64,
    /// Rayleigh damping, if any.
    pub rayleigh: Option<RayleighDamping>,
    /// Artificial viscosity, if any.
    pub viscosity: Option<Viscosity>,
}

/// Inertia corrected for dispersion, with the sharp contacts of soils that it needs.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct CorrectedInertia {
    /// The correction.
    pub dispersion: Dispersion,
    /// The contacts between stress nodes, from the stiffness when shaking began; none on the dual lattice.
    pub contacts: Option<Contacts>,
}

/// Arrays that every step fills. They are part of a stored state, because the next step reads them.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Workspace {
    /// Share of every stress node in the nodal forces.
    pub shares: Vec<NodalShare>,
    /// Force of the pore water in the last step, kN/m.
    pub water_force: Vec<Vec2>,
    /// Stresses of the printed operators, if these are chosen.
    pub printed: Option<PrintedStress>,
    /// Volume strains that corners at free surfaces share.
    pub shared: Option<SharedStrain>,
    /// Sums over the chunks of nodes.
    sums: Vec<MotionSum>,
}

/// Sums over the nodes in the velocity update: in statics to decide whether they are at rest, in moving
/// ground the power of forces.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub struct MotionSum {
    /// Kinetic energy, kJ/m.
    pub kinetic_energy: f64,
    /// Sum of the sizes of the accelerations, m/s2.
    pub acceleration: f64,
    /// The largest of them.
    pub largest_acceleration: f64,
    /// Power of the step's forces on the velocity between this step and the one before.
    pub power: Power,
    /// The same of the water's force in the step before, kW/m.
    pub last_water_power: f64,
}

/// Ground, forces, damping, and the time.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct Domain {
    /// The state of the section.
    pub ground: Ground,
    /// Constant nodal forces.
    pub forces: ConstantForces,
    /// Damping of the stage.
    pub damping: ActiveDamping,
    /// Inertia of the stage, if it is corrected.
    pub inertia: Option<CorrectedInertia>,
    /// Arrays of a step.
    pub workspace: Workspace,
    /// Spectrum of the pressure operators on the lattice.
    spectrum: PressureSpectrum,
    /// Time, step and time step of the stage.
    pub clock: Clock,
    /// Work done in the stage.
    pub counters: Counters,
    /// Whether loops run on several threads; the state is the same under any number.
    #[serde(skip)]
    pub threaded: bool,
}

impl Domain {
    /// A section at its geostatic stress, at rest.
    ///
    /// # Errors
    /// Those of [`Ground::new`].
    pub fn new(model: &Model, threaded: bool) -> Result<Self, SolverError> {
        let ground = Ground::new(model)?;
        let nodes = ground.nodes();
        let mut domain = Self {
            forces: ConstantForces::new(nodes),
            damping: ActiveDamping::default(),
            inertia: None,
            workspace: Workspace {
                shares: vec![NodalShare::default(); ground.points.len()],
                water_force: vec![Vec2::zeros(); nodes],
                printed: ground.geometry.printed.as_ref().map(|_| PrintedStress::default()),
                shared: ground.layout.dual().map(SharedStrain::new),
                sums: vec![MotionSum::default(); chunks(nodes)],
            },
            spectrum: PressureSpectrum::new(&ground.model),
            clock: Clock::default(),
            counters: Counters::default(),
            threaded,
            ground,
        };
        domain.counters.porosity_clips += domain.ground.update_volumes();
        Ok(domain)
    }

    /// Time step at `factor` times the limit for the present stiffness, s.
    pub fn limit(&self, coupling: PressureCoupling, factor: f64) -> TimeLimit {
        self.limit_under(self.damping.rayleigh.as_ref().map(RayleighDamping::law), coupling, factor)
    }

    /// The same with another Rayleigh damping than that of the stage.
    pub fn limit_under(
        &self,
        rayleigh: Option<&Rayleigh>,
        coupling: PressureCoupling,
        factor: f64,
    ) -> TimeLimit {
        let Ground { model, layout, points, soil, geometry, sharpness, free_surface, .. } = &self.ground;
        let limits = Limits {
            coupling,
            spectrum: &self.spectrum,
            rayleigh,
            is_corrected: self.inertia.is_some(),
            viscosity: self.damping.viscosity.as_ref().map_or(0.0, Viscosity::coefficient),
            surface_is_tied: free_surface.is_none(),
        };
        let TimeLimit { dt, criterion } = soil
            .rows()
            .map(|(region, rows)| {
                let stiffest = points[rows].iter().fold(0.0_f64, |most, point| most.max(point.stiffness));
                (region, stiffest)
            })
            .filter(|(_, stiffness)| *stiffness > 0.0)
            .map(|(region, stiffness)| region_limit(model, region, stiffness, &limits))
            .min_by(|a, b| a.dt.total_cmp(&b.dt))
            .unwrap_or_default();
        let response = match sharpness {
            Some(sharpness) => sharpness.step_factor,
            None if geometry.is_balanced => balance::RESPONSE,
            None if layout.dual().is_some_and(|dual| dual.is_stretched) => balance::STRETCHED_RESPONSE,
            None => 1.0,
        };
        TimeLimit { dt: factor * response * dt, criterion }
    }

    /// The forces of the present state.
    pub fn nodal_forces(&self) -> NodalForces<'_> {
        let Ground { layout, geometry, points, phases, mass, water, .. } = &self.ground;
        NodalForces {
            geometry,
            points,
            shares: &self.workspace.shares,
            phases,
            mass,
            water: water.as_ref(),
            layout,
            printed: self.workspace.printed.as_ref(),
            rayleigh: self.damping.rayleigh.as_ref(),
            viscosity: self.damping.viscosity.as_ref(),
        }
    }

    fn prepare_printed_stress(&mut self) {
        if let (Some(stress), Some(tables)) = (&mut self.workspace.printed, &self.ground.geometry.printed) {
            stress.update(tables, &self.ground.points);
        }
    }

    /// Force of stress and pressure alone on every node, kN/m: without the velocity filter.
    pub fn static_force(&mut self) -> Vec<Vec2> {
        self.refresh_shares(&vec![Vec2::zeros(); self.ground.velocity.len()]);
        self.prepare_printed_stress();
        let forces = self.nodal_forces();
        (0..self.ground.nodes()).map(|j| forces.internal(j, Vec2::zeros(), forces.of_water(j))).collect()
    }

    /// Fills the shares of the stress nodes from the present stress and a velocity field.
    fn refresh_shares(&mut self, velocity: &[Vec2]) {
        self.carry_neutral_stress();
        let filter = self.ground.filter();
        let Ground { geometry, points, .. } = &self.ground;
        let shares = &mut self.workspace.shares;
        for (s, share) in shares.iter_mut().enumerate() {
            *share = motion(geometry, s, velocity).share(&points[s], geometry.covariance[s], filter);
        }
        if let Some(rayleigh) = &mut self.damping.rayleigh {
            rayleigh.add_stress(false, geometry, velocity, points, shares);
        }
    }

    /// Fills the shares of the stress nodes from the present stress and motion.
    pub fn refresh_present_shares(&mut self) {
        let velocity = std::mem::take(&mut self.ground.velocity);
        self.refresh_shares(&velocity);
        self.ground.velocity = velocity;
    }

    /// Fills the shares of the stress nodes from the present stress alone.
    pub fn refresh_shares_at_rest(&mut self) {
        self.refresh_shares(&vec![Vec2::zeros(); self.ground.nodes()]);
    }

    /// Sets the constant forces to weight and still water at the present positions.
    pub fn set_present_forces(&mut self) {
        let Ground { model, water, position, phases, .. } = &self.ground;
        let volume = phases.volume();
        let mut parts = Vec::new();
        let buoyancy = water.as_ref().and_then(|water| water.buoyancy(position, volume));
        if let Some(buoyancy) = buoyancy {
            parts.push(buoyancy);
        } else if model.water.is_some() {
            let (suction, pressure) = suction_and_pressure(model);
            let gradient = consistent_gradient(model, position, volume, &pressure);
            let of_pressure = gradient.iter().zip(volume).map(|(gradient, volume)| -(gradient * *volume));
            let of_pressure: Vec<Vec2> = of_pressure.collect();
            if suction.iter().any(|p| *p < 0.0) {
                parts.push(self.suction_force(&suction));
            }
            parts.push(of_pressure);
        }
        self.forces.set_present(&self.ground.mass, self.ground.model.gravity, &parts);
    }

    /// Force of suction (kPa, negative) on every node, kN/m. Water under pressure continues in a pond above
    /// the ground surface, so its force is that of its gradient. Suction ends at the surface and pulls it
    /// towards the ground: it acts like a part of the stress, without a traction at the surface.
    fn suction_force(&mut self, suction: &[f64]) -> Vec<Vec2> {
        let Ground { model, layout, position, points, .. } = &mut self.ground;
        let places = layout.positions(position, model.spacing);
        let weights = point_weights(model, position, &places);
        let kept: Vec<Stress> = points.iter().map(|point| point.stress).collect();
        for (s, point) in points.iter_mut().enumerate() {
            let pull = -weights.iter_row(s).map(|(node, w)| w * suction[node]).sum::<f64>();
            point.stress = Stress { xx: pull, yy: pull, zz: pull, xy: 0.0 };
        }
        let force = self.static_force();
        for (point, stress) in self.ground.points.iter_mut().zip(kept) {
            point.stress = stress;
        }
        force
    }

    /// Sets the constant forces that balance stress and pressure: the present state is then at rest.
    pub fn balance(&mut self) {
        let force = self.static_force();
        self.forces.balance(&force);
    }

    /// Sets the constant load that balances the present excess pressure. The load also acts on the nodes tied
    /// to the surface, whose pressure drains at once.
    pub fn balance_under_load(&mut self) {
        let force = self.static_force();
        let Ground { water, geometry, .. } = &self.ground;
        let held_back = |j: usize| match (water, &geometry.flow, &geometry.printed) {
            (Some(PoreWater::Nodes(flow)), Some(tables), None) => flow.held_back(tables, j),
            _ => Vec2::zeros(),
        };
        self.forces.balance_under_load(&force, held_back);
    }

    /// Computes forces and accelerations, and changes the velocities over `dt`; positions do not change.
    /// Returns the sums that statics or moving ground need.
    pub fn accelerate<const STATICS: bool>(&mut self, dt: f64) -> MotionSum {
        self.prepare_printed_stress();
        let threaded = self.threaded;
        let Self { ground, forces: constant, damping, inertia, workspace, .. } = self;
        let Ground { model, layout, velocity, acceleration, geometry, points, phases, mass, water, .. } =
            ground;
        let Workspace { shares, water_force, printed, sums, .. } = workspace;
        let (nodes, is_wet) = (model.nodes(), water.as_ref().is_some_and(PoreWater::has_nodal_force));
        let forces = NodalForces {
            geometry,
            points,
            shares,
            phases,
            mass,
            water: water.as_ref(),
            layout,
            printed: printed.as_ref(),
            rayleigh: damping.rayleigh.as_ref(),
            viscosity: damping.viscosity.as_ref(),
        };
        // The constant force is added last, so that the sum at rest is zero to the last bit.
        let bare = |j: usize, velocity: Vec2, water: &mut Vec2, sum: &mut MotionSum| {
            let last_water = *water;
            *water = forces.of_water(j);
            if !STATICS {
                constant.add_power(j, mass[j], velocity, model.gravity, &mut sum.power);
                if is_wet {
                    sum.power.water += water.dot(&velocity);
                    sum.last_water_power += last_water.dot(&velocity);
                }
            }
            (forces.internal(j, velocity, *water) + constant.total(j)) / mass[j]
        };
        sums.fill(MotionSum::default());
        let mut dispersion = inertia.as_mut().map(|inertia| &mut inertia.dispersion);
        if let Some(dispersion) = &mut dispersion {
            let rows = Rows { a: &mut velocity[..nodes], b: &mut acceleration[..nodes], c: water_force };
            for_each_chunk(threaded, rows, sums, |first, rows, sum| {
                for (k, (v, a)) in rows.a.iter().zip(rows.b.iter_mut()).enumerate() {
                    *a = bare(first + k, *v, &mut rows.c[k], sum);
                }
            });
            dispersion.gather(threaded, geometry, points, acceleration);
        }
        let dispersion = dispersion.as_deref();
        let rows = Rows { a: &mut velocity[..nodes], b: &mut acceleration[..nodes], c: water_force };
        for_each_chunk(threaded, rows, sums, |first, rows, chunk| {
            // A local copy stays in registers; `chunk` would be read from memory in every iteration.
            let mut sum = *chunk;
            for (k, (v, a)) in rows.a.iter_mut().zip(rows.b.iter_mut()).enumerate() {
                let j = first + k;
                let acting = match dispersion {
                    None => bare(j, *v, &mut rows.c[k], &mut sum),
                    Some(dispersion) => *a + dispersion.acceleration(geometry, j, mass[j]),
                };
                *a = acting;
                *v += acting * dt;
                if STATICS {
                    let size = acting.norm();
                    sum.kinetic_energy += 0.5 * mass[j] * v.norm_squared();
                    sum.acceleration += size;
                    sum.largest_acceleration = sum.largest_acceleration.max(size);
                }
            }
            *chunk = sum;
        });
        // In a fixed order, so that the sum is the same with any number of threads.
        let total = sums.iter().fold(MotionSum::default(), |total, chunk| MotionSum {
            kinetic_energy: total.kinetic_energy + chunk.kinetic_energy,
            acceleration: total.acceleration + chunk.acceleration,
            largest_acceleration: total.largest_acceleration.max(chunk.largest_acceleration),
            power: total.power.plus(&chunk.power),
            last_water_power: total.last_water_power + chunk.last_water_power,
        });
        self.counters.inertia_corrections += u64::from(self.inertia.is_some());
        total
    }

    /// Power of the last step's forces on the present velocities.
    pub fn present_power(&self) -> Power {
        let Ground { model, velocity, mass, .. } = &self.ground;
        let mut power = Power::default();
        for (j, (v, mass)) in velocity.iter().zip(mass).enumerate() {
            self.forces.add_power(j, *mass, *v, model.gravity, &mut power);
            power.water += self.workspace.water_force[j].dot(v);
        }
        power
    }

    /// Adds local damping (Eq. 16) to the total acceleration, the base's tractions included, against the
    /// velocity of each node before the step. Returns the energy taken, kJ/m.
    pub fn damp_locally(&mut self, dt: f64) -> f64 {
        let coefficient = self.damping.local;
        if coefficient == 0.0 {
            return 0.0;
        }
        let Ground { velocity, acceleration, mass, .. } = &mut self.ground;
        let mut taken = 0.0;
        // The copies after the nodes have no mass here.
        let masses = mass.iter().chain(std::iter::repeat(&0.0));
        for ((v, a), mass) in velocity.iter_mut().zip(acceleration).zip(masses) {
            let before = *v - *a * dt;
            let drag = local_damping(*a, before, coefficient);
            *v += drag * dt;
            *a += drag;
            taken -= mass * drag.dot(&(before + *v)) * (0.5 * dt);
        }
        taken
    }

    /// Gathers the artificial viscosity of the present motion, if the stage has one.
    pub fn update_viscosity(&mut self) {
        let Some(viscosity) = &mut self.damping.viscosity else { return };
        let Ground { model, layout, geometry, points, position, velocity, phases, .. } = &self.ground;
        let nodes = MovingNodes { position, velocity, volume: phases.volume() };
        viscosity.update(self.threaded, (model, layout), geometry, points, nodes);
    }

    /// Updates strain, stress and the shares for the next force loop, from the velocity at mid-step.
    ///
    /// # Errors
    /// [`SolverError::Diverged`] or [`SolverError::Soil`].
    pub fn update_stress(&mut self, dt: f64, with_after: bool) -> Result<StressWork, SolverError> {
        let filter = self.ground.filter();
        let Ground { model, layout, soil, geometry, velocity, points, .. } = &mut self.ground;
        let integrator = &model.numerics.integrator;
        if let (Some(shared), Some(dual)) = (&mut self.workspace.shared, layout.dual()) {
            shared.gather(dual, geometry, points, velocity, dt);
        }
        let shared = self.workspace.shared.as_ref();
        let step = StrainStep { layout, geometry, shared, velocity, filter, dt, integrator, with_after };
        let report =
            soil.step(self.threaded, &step, StressRows { points, shares: &mut self.workspace.shares });
        let (report, work) = report.map_err(|error| match error.soil_divergence() {
            Some((quantity, node, value)) => self.diverged(quantity, node, value),
            None => error,
        })?;
        let Ground { geometry, velocity, points, .. } = &self.ground;
        if let Some(rayleigh) = &mut self.damping.rayleigh {
            rayleigh.add_stress(self.threaded, geometry, velocity, points, &mut self.workspace.shares);
        }
        let Ground { layout, points, water, .. } = &mut self.ground;
        // With water, its pressure at the end of the step is not known yet.
        if let (None, Some(dual)) = (water, layout.dual()) {
            carry_dry(dual, points, &mut self.workspace.shares);
        }
        self.counters.soil.merge(&report);
        self.counters.plastic_updates += self.ground.soil.plastic_points() as u64;
        self.counters.steps += 1;
        Ok(work)
    }

    /// Advances pore pressure by a step, from the motion at mid-step.
    ///
    /// # Errors
    /// [`SolverError::Diverged`] if the matrix of implicit diffusion is not finite.
    pub fn update_water(&mut self, dt: f64) -> Result<StressWork, SolverError> {
        let Ground { water, geometry, layout, points, velocity, acceleration, .. } = &mut self.ground;
        let time = TimeStep { end: self.clock.time + dt, dt };
        let work = match (water, &geometry.flow, layout.dual()) {
            (Some(PoreWater::Nodes(flow)), Some(tables), _) => {
                let motion = SkeletonMotion { velocity, acceleration };
                flow.step(self.threaded, tables, points, motion, time).then(StressWork::default)
            }
            (Some(PoreWater::Corners(flow)), _, Some(dual)) => {
                flow.step(self.threaded, dual, points, acceleration, time)
            }
            _ => return Ok(StressWork::default()),
        };
        self.counters.flow_calls += 1;
        let work = work.ok_or_else(|| self.diverged("pore pressure matrix", 0, f64::NAN))?;
        self.carry_neutral_stress();
        Ok(work)
    }

    /// Takes the present pore pressure at corners, and what their groups carry, into their stress and shares.
    fn carry_neutral_stress(&mut self) {
        let Ground { layout: StressLayout::Dual(dual), points, water, .. } = &mut self.ground else { return };
        let flow = water.as_ref().and_then(PoreWater::corners);
        let shared = self.workspace.shared.as_mut();
        let Some(shared) = shared else { return };
        shared.carry(self.threaded, dual, points, &mut self.workspace.shares, |s| {
            flow.map_or(0.0, |flow| flow.neutral(dual, s))
        });
    }

    /// Moves the nodes by a step, and updates the pressure from which the excess counts.
    pub fn move_nodes(&mut self, dt: f64) {
        let Ground { position, velocity, water, .. } = &mut self.ground;
        for (x, v) in position.iter_mut().zip(velocity) {
            *x += *v * dt;
        }
        if let Some(flow) = water.as_mut().and_then(PoreWater::nodes_mut) {
            flow.carry(position);
        }
    }

    /// Builds the weights at the present positions, and updates volumes, masses and water.
    pub fn rebuild_geometry(&mut self) {
        // All tables are replaced; the lists of the old ones are reused if they are still valid.
        let previous = self.ground.geometry.clone();
        self.ground.move_corners();
        self.counters.porosity_clips += self.ground.update_volumes();
        let outline = self.ground.outline();
        let Ground { model, layout, position, phases, walls, .. } = &self.ground;
        self.ground.geometry = Geometry::renew(
            model,
            layout,
            position,
            phases.volume(),
            EdgesView { outline: &outline, walls: *walls },
            Some(previous),
        );
        self.ground.update_surroundings(self.threaded);
        let time = self.clock.time;
        self.ground.with_water(&outline, |water, section| water.follow(section, time));
        self.counters.geometry_builds += 1;
        self.sharpen_contacts();
    }

    /// Sets the conditions of the edges, and rebuilds the geometry if they change.
    pub fn set_walls(&mut self, walls: Walls) {
        if walls != self.ground.walls {
            self.ground.walls = walls;
            self.rebuild_geometry();
        }
    }

    /// With corrected inertia: sets the masses that are consistent with the operators beside edges and contacts, and adds
    /// the kinks at contacts to the gradients.
    pub fn sharpen_contacts(&mut self) {
        let Some(CorrectedInertia { contacts, .. }) = &self.inertia else { return };
        let outline = self.ground.outline();
        let Ground { model, layout, position, points, geometry, mass, walls, .. } = &mut self.ground;
        let edges = EdgesView { outline: &outline, walls: *walls };
        let value = stress_node_values(model, layout, position, edges);
        *mass = lumped_masses(&value, points, model.nodes());
        if let Some(contacts) = contacts {
            contacts.sharpen(model, position, points, &value, geometry, mass);
        }
    }

    /// Refuses motion and pore pressure that are no longer finite, and impossible velocities. The soil models
    /// refuse strain and stress that are not finite, or the motion of the next step is not finite.
    ///
    /// # Errors
    /// [`SolverError::Diverged`] with the first node found.
    pub fn guard(&self) -> Result<(), SolverError> {
        self.check_finite("velocity", |ground, j| ground.velocity[j].norm(), RUNAWAY_SPEED)?;
        match &self.ground.water {
            Some(water) => self.check_finite("pore pressure", |_, j| water.excess(j).abs(), f64::INFINITY),
            None => Ok(()),
        }
    }

    /// Refuses a quantity that exceeds its bound or is not finite at some node.
    ///
    /// # Errors
    /// [`SolverError::Diverged`] with the first node found.
    pub fn check_finite(
        &self,
        quantity: &'static str,
        value: impl Fn(&Ground, usize) -> f64,
        bound: f64,
    ) -> Result<(), SolverError> {
        for j in 0..self.ground.nodes() {
            let found = value(&self.ground, j);
            // NaN must take the error branch.
            if !(found <= bound) || found == f64::INFINITY {
                return Err(self.diverged(quantity, j, found));
            }
        }
        Ok(())
    }

    fn diverged(&self, quantity: &'static str, j: usize, value: f64) -> SolverError {
        let Ground { order, position, .. } = &self.ground;
        SolverError::Diverged {
            quantity,
            node: order[j],
            x: position[j].x,
            y: position[j].y,
            value,
            time: self.clock.time,
            step: self.clock.step,
        }
    }
}
