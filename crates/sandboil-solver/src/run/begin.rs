//! How a stage begins: each choice of its description takes effect in a part of its own.

use crate::{
    edges::{
        base::{Base, Vertical, base_condition},
        compliant_base::CompliantBase,
    },
    error::SolverError,
    run::{
        clock::{Clock, Counters},
        domain::{ActiveDamping, CorrectedInertia, Domain},
        ground::{Ground, Placement, Sharpness},
        moving::{Moving, shared_limit},
        neighbour::Neighbour,
        observers::Observers,
        relaxing::Relaxing,
        renewal::renew,
        simulation::{Active, Driver},
        time_step::PressureCoupling,
    },
    section::{
        description::{AccelerationTerm, Diffusion, Model},
        outline::{Outline, Walls},
    },
    skeleton::{
        contacts::Contacts, inertia::Dispersion, rayleigh::RayleighDamping, soils::SoilField,
        viscosity::Viscosity,
    },
    stages::{
        gravity::Gravity,
        rules::{self, Choices},
        stage::{Displacements, End, Stage, Surface, WaterReference},
    },
    water::{
        pore_pressure::{Flow, FlowScheme, Pores},
        still_water::StillWater,
    },
    weights::balance,
};
use sandboil_sph::Vec2;

/// Implicit diffusion is chosen where it lengthens the step by more than this.
const IMPLICIT_GAIN: f64 = 1.2;
/// Largest conductivity for the acceleration term of Eq. 7 when it is left to us, m/s: above, it limits dt.
pub const ACCELERATION_TERM_CONDUCTIVITY: f64 = 3e-3;

/// What a stage finds of the one before.
struct Before<N> {
    /// Whether the ground moved: then soil, water and motion keep their state.
    moved: bool,
    neighbour: Option<N>,
}

impl<N: Neighbour> Driver<N> {
    /// Begins a stage.
    ///
    /// Static stages make soil elastic, freeze pore pressure and hold all edges. In the first stage of moving ground soils
    /// take their own models from the stress that is there, and constant forces balance the state, so that nothing moves
    /// until a wave arrives; a further one continues with soil, water and motion as they are, and only strains, envelopes and
    /// the base's impedance begin again. With large displacements weight and still water act where the ground is.
    ///
    /// # Errors
    /// Choices that exclude each other, values outside their range, a soil model that refuses the stress it is given, or a
    /// stage after one of large displacements.
    pub fn begin(&mut self, stage: impl Into<Stage>) -> Result<(), SolverError> {
        let stage = stage.into();
        stage.validate()?;
        rules::check(&Choices::of_stage(&self.domain.ground.model, &stage))?;
        let begun = match stage.end {
            End::AtRest { tolerance, max_steps } => {
                self.gravity = Some(Gravity { tolerance, max_steps });
                self.begin_statics(&stage, Relaxing::new(tolerance, max_steps))
            }
            End::After(_) => self.begin_motion(stage),
        };
        begun.map_err(|error| error.in_user_order(&self.domain.ground.order))
    }

    fn begin_statics(&mut self, stage: &Stage, relaxing: Relaxing) -> Result<(), SolverError> {
        let domain = &mut self.domain;
        domain.counters = Counters::default();
        // Statics know no waves, and held edges bring back the geometry and masses of the drawn section.
        domain.inertia = None;
        domain.damping = ActiveDamping::default();
        let Ground { placement, water, sharpness, free_surface, .. } = &mut domain.ground;
        (*placement, *water, *sharpness, *free_surface) = (Placement::Drawn, None, None, None);
        domain.set_walls(Walls::statics(&domain.ground.model.outline));
        domain.ground.soil = SoilField::elastic(&domain.ground.model, &mut domain.ground.points)?;
        domain.set_present_forces();
        let response = if domain.ground.geometry.is_balanced { balance::RESPONSE } else { 1.0 };
        let limit = domain.limit(PressureCoupling::None, response * stage.time_step_factor);
        domain.clock = Clock::start(limit);
        domain.ground.resize_copies(0);
        domain.ground.velocity.fill(Vec2::zeros());
        domain.refresh_shares_at_rest();
        self.active = Active::Relaxing(relaxing);
        Ok(())
    }

    fn begin_motion(&mut self, mut stage: Stage) -> Result<(), SolverError> {
        if self.domain.ground.sharpness.is_some() {
            return Err(SolverError::Order {
                call: "begin",
                needs: "ground without large displacements in the stage before",
            });
        }
        let mut before = match std::mem::replace(&mut self.active, Active::None) {
            Active::Moving(before) => Before { moved: true, neighbour: before.neighbour },
            _ => Before { moved: false, neighbour: None },
        };
        let domain = &mut self.domain;
        domain.counters = Counters::default();
        domain.begin_damping(&stage);
        domain.begin_inertia();
        domain.place_edges(&stage, &mut before);
        if !before.moved {
            domain.begin_soils()?;
        }
        domain.ground.restart_strain();
        let base = stage.compliant_base().map(|base| domain.new_base(base)).transpose()?;
        let neighbour = domain.new_neighbour(&stage, before.neighbour, self.gravity)?;
        // The columns hold their own records.
        stage.forget_column_records();
        let coupling = domain.begin_pore_pressure(&stage)?;
        let limit = shared_limit(domain, neighbour.as_ref(), coupling, stage.time_step_factor);
        let observers = Observers::new(&domain.ground, &stage.output, limit.dt);
        domain.clock = Clock::start(limit);
        match stage.displacements {
            Displacements::Large => {
                domain.ground.soil.allow_large_steps();
                domain.set_present_forces();
            }
            Displacements::Small if before.moved => {}
            Displacements::Small => domain.balance(),
        }
        self.active = Active::Moving(Box::new(Moving { stage, base, neighbour, coupling, observers }));
        Ok(())
    }

    /// Gives the section an excess pore pressure (kPa, user's node order) before the first step of a moving stage, held
    /// in balance by a load that stays: the start of consolidation under a load just put on.
    ///
    /// # Errors
    /// A dry section, a stage that has begun to move or has large displacements, or an array of the wrong length.
    pub fn set_excess_pore_pressure(&mut self, excess: &[f64]) -> Result<(), SolverError> {
        let (found, expected) = (excess.len(), self.domain.ground.nodes());
        if found != expected {
            return Err(SolverError::Shape { name: "excess_pore_pressure", found, expected });
        }
        let Domain { ground, clock, .. } = &mut self.domain;
        // Ground with large displacements has no load that stays.
        let (Active::Moving(stage), 0, Some(flow), None) =
            (&mut self.active, clock.step, &mut ground.water, ground.sharpness)
        else {
            return Err(SolverError::Order {
                call: "set_excess_pore_pressure",
                needs: "water and a shaking stage that has just begun",
            });
        };
        flow.set_excess(|own| {
            for (slot, &user) in own.iter_mut().zip(&ground.order) {
                *slot = excess[user];
            }
        });
        if let Some(neighbour) = &mut stage.neighbour {
            neighbour.set_excess(&ground.edges, flow.own_excess());
        }
        self.domain.balance_under_load();
        Ok(())
    }

    /// Gives the section a velocity field (m/s, user's node order) before the first step of a moving stage: waves under way.
    ///
    /// # Errors
    /// A stage that has begun to move, or an array of the wrong length.
    pub fn set_velocity(&mut self, velocity: &[[f64; 2]]) -> Result<(), SolverError> {
        let Domain { ground, clock, .. } = &mut self.domain;
        let (found, expected) = (velocity.len(), ground.nodes());
        if found != expected {
            return Err(SolverError::Shape { name: "velocity", found, expected });
        }
        let (Active::Moving(_), 0) = (&self.active, clock.step) else {
            return Err(SolverError::Order {
                call: "set_velocity",
                needs: "a shaking stage that has just begun",
            });
        };
        for (slot, &user) in ground.velocity.iter_mut().zip(&ground.order) {
            *slot = velocity[user].into();
        }
        self.domain.refresh_present_shares();
        Ok(())
    }
}

impl Domain {
    fn begin_damping(&mut self, stage: &Stage) {
        let (nodes, points) = (self.ground.nodes(), self.ground.points.len());
        self.damping = ActiveDamping {
            local: stage.damping.local,
            rayleigh: stage.damping.rayleigh.map(|law| RayleighDamping::new(law, points)),
            viscosity: stage.damping.viscosity.map(|coefficient| Viscosity::new(coefficient, nodes)),
        };
    }

    /// Contacts stay those of the first stage of moving ground.
    fn begin_inertia(&mut self) {
        let Ground { model, points, .. } = &self.ground;
        let contacts = self.inertia.take().and_then(|before| before.contacts);
        self.inertia = model
            .numerics
            .dispersion_correction
            .then(|| CorrectedInertia { dispersion: Dispersion::new(model, points.len()), contacts });
    }

    /// Base and sides: held where they are, free to move, or as free as they are already.
    fn place_edges(&mut self, stage: &Stage, before: &mut Before<impl Neighbour>) {
        match stage.displacements {
            Displacements::Large => {
                before.neighbour = None;
                self.hold_edges(stage);
            }
            Displacements::Small if before.moved => renew(self, before.neighbour.as_mut()),
            Displacements::Small => {
                self.ground.placement = Placement::WithNodes(self.ground.position.clone());
                let Model { outline, numerics, .. } = &self.ground.model;
                let walls = match stage.compliant_base() {
                    None => Walls::shaken(outline, outline.base_support.condition(), stage.free_field()),
                    Some(base) => {
                        let absorbs = base.vertical == Vertical::Absorbing;
                        Walls::shaken(
                            outline,
                            base_condition(numerics.operators, absorbs),
                            stage.free_field(),
                        )
                    }
                };
                self.set_walls(walls);
            }
        }
    }

    /// Holds base and sides as in statics where they are now, and takes open sides away.
    fn hold_edges(&mut self, stage: &Stage) {
        let present = self.ground.outline();
        let [left, right] = stage.open();
        let sides = [present.sides[0].filter(|_| !left), present.sides[1].filter(|_| !right)];
        let outline = Outline { sides, ..present };
        let ground = &mut self.ground;
        ground.resize_copies(0);
        ground.walls = Walls::statics(&outline);
        ground.placement = Placement::Held(outline);
        ground.sharpness = Some(Sharpness::new(&ground.model));
        ground.free_surface = (stage.surface == Surface::Found).then(Vec::new);
        // Pore pressure begins again, from what it was.
        let water = ground.water.take();
        self.rebuild_geometry();
        self.ground.water = water;
        self.refresh_present_shares();
    }

    /// Soils take their own models from the stress that is there, and the ground is at rest.
    fn begin_soils(&mut self) -> Result<(), SolverError> {
        let Ground { model, velocity, acceleration, points, soil, .. } = &mut self.ground;
        velocity.fill(Vec2::zeros());
        acceleration.fill(Vec2::zeros());
        *soil = SoilField::plastic(model, points, None)?;
        self.counters.inadmissible_starts = soil.inadmissible_starts();
        if let Some(inertia) = &mut self.inertia {
            inertia.contacts = Some(Contacts::new(model, points));
        }
        self.sharpen_contacts();
        Ok(())
    }

    fn new_base(&self, description: &Base) -> Result<CompliantBase, SolverError> {
        let Ground { model, edges, position, mass, geometry, points, .. } = &self.ground;
        let impedance = self.ground.base_impedance(description)?;
        let mut base = CompliantBase::new(model, edges, position, mass, impedance, description);
        if let Some(CorrectedInertia { dispersion, .. }) = &self.inertia {
            let spread = dispersion.spread(geometry, points, mass, base.dashpots());
            base.spread_by(spread, model.nodes());
        }
        Ok(base)
    }

    /// The ground beside the section, coupled with it.
    fn new_neighbour<N: Neighbour>(
        &mut self,
        stage: &Stage,
        before: Option<N>,
        gravity: Option<Gravity>,
    ) -> Result<Option<N>, SolverError> {
        let outline = self.ground.outline();
        let section = self.ground.view(&outline);
        if let Some(mut neighbour) = before {
            neighbour.begin(&section, stage)?;
            return Ok(Some(neighbour));
        }
        let Some(mut neighbour) = N::new(&section, stage, gravity)? else { return Ok(None) };
        self.ground.resize_copies(neighbour.copied_velocities());
        neighbour.couple(&mut self.ground.geometry, self.ground.model.nodes());
        Ok(Some(neighbour))
    }

    /// Pore pressure of the stage, from the excess that is there.
    fn begin_pore_pressure(&mut self, stage: &Stage) -> Result<PressureCoupling, SolverError> {
        let scheme = self.flow_scheme(stage.time_step_factor);
        let before = self.ground.water.take();
        let outline = self.ground.outline();
        let mut flow = Flow::new(self.ground.view(&outline), scheme, &stage.conditions)?;
        if let Some(flow) = &mut flow {
            match &stage.water_reference {
                WaterReference::StillWater { line } => {
                    self.stand_in_water(flow, line.as_deref(), before.as_ref(), &outline)?;
                }
                WaterReference::AtRest => {
                    if let Some(before) = before {
                        flow.set_excess(|excess| excess.copy_from_slice(before.own_excess()));
                    }
                }
            }
        }
        self.ground.water = flow;
        Ok(match (&self.ground.water, scheme) {
            (None, _) => PressureCoupling::None,
            (_, FlowScheme::Implicit) => PressureCoupling::Implicit,
            _ => PressureCoupling::Explicit,
        })
    }

    /// Puts the ground, with the pore water that it had `before`, into still water with its surface at `line`, or as it was
    /// at rest.
    fn stand_in_water(
        &self,
        flow: &mut Flow,
        line: Option<&[Vec2]>,
        before: Option<&Flow>,
        outline: &Outline,
    ) -> Result<(), SolverError> {
        let model = &self.ground.model;
        let Some(water) = model.water else { return Ok(()) };
        let still = match line {
            Some(line) => StillWater::new(water, line)?,
            None => StillWater::at_rest(model, water),
        };
        let nodes = 0..model.nodes();
        let at_rest = model.neutral_stress();
        let gained = |node| before.map_or(0.0, |flow| flow.neutral(node));
        let neutral = at_rest.iter().enumerate().map(|(node, rest)| rest + gained(node)).collect();
        let saturation = before.and_then(Flow::saturation);
        let holds_air =
            |node| saturation.as_ref().map_or_else(|| model.saturation(node), |of_node| of_node(node)) < 1.0;
        let holds_air = nodes.clone().map(holds_air).collect();
        let excess: Vec<f64> = nodes.map(|node| before.map_or(0.0, |flow| flow.excess(node))).collect();
        let pores = Pores { neutral, excess: &excess, holds_air };
        flow.stand_in(still, self.ground.view(outline), pores);
        Ok(())
    }

    /// How pore pressure is advanced: as the numerics say, or with the longer step.
    fn flow_scheme(&self, factor: f64) -> FlowScheme {
        let Model { numerics, regions, .. } = &self.ground.model;
        let conductivity = regions.iter().map(|r| r.hydraulic_conductivity.major).fold(0.0, f64::max);
        if conductivity == 0.0 {
            return FlowScheme::Undrained;
        }
        let implicit = match numerics.diffusion {
            Diffusion::Implicit => true,
            Diffusion::Explicit => false,
            Diffusion::Auto => {
                let limit = |coupling| self.limit(coupling, factor).dt;
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
}
