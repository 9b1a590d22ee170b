//! Start of a stage: one function for each choice of its description.

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
        stress_layout::StressLayout,
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
        corner_pressure::CornerFlow,
        pore_pressure::{Flow, FlowScheme, Pores},
        pore_water::PoreWater,
        still_water::StillWater,
    },
};
use sandboil_sph::Vec2;

/// Implicit diffusion is chosen if it lengthens the time step by more than this factor.
const IMPLICIT_GAIN: f64 = 1.2;
/// Largest conductivity with the acceleration term of Eq. 7 if the numerics leave the choice to the solver,
/// m/s; above it the term limits the time step.
pub const ACCELERATION_TERM_CONDUCTIVITY: f64 = 3e-3;

/// The stage before.
struct Before<N> {
    /// Whether it was a stage of moving ground; soil, water and motion then keep their state.
    moved: bool,
    neighbour: Option<N>,
}

impl<N: Neighbour> Driver<N> {
    /// Begins a stage.
    ///
    /// In a static stage soil is elastic, pore pressure is frozen and all edges are held. The first stage of
    /// moving ground starts the soil models from the present stress, and constant forces balance the state,
    /// so that nothing moves before a wave arrives. A later stage of moving ground keeps soil, water and
    /// motion; only strains, envelopes and the impedance of the base start from the present state. With large
    /// displacements weight and still water act at the present positions.
    ///
    /// # Errors
    /// Choices that exclude each other, values outside their range, a soil model that refuses its stress, or
    /// a stage of moving ground after one of large displacements.
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
        // A static stage has no waves, and its held edges have the geometry and masses of the model.
        domain.inertia = None;
        domain.damping = ActiveDamping::default();
        let Ground { placement, water, sharpness, free_surface, .. } = &mut domain.ground;
        (*placement, *water, *sharpness, *free_surface) = (Placement::Drawn, None, None, None);
        domain.set_walls(Walls::statics(&domain.ground.model.outline));
        domain.ground.soil = {
            let Ground { model, layout, points, .. } = &mut domain.ground;
            SoilField::elastic(model, layout, points)?
        };
        domain.set_present_forces();
        let limit = domain.limit(PressureCoupling::None, stage.time_step_factor);
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
                needs: "a stage before without large displacements",
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
        // The columns have copied their records.
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

    /// Sets an excess pore pressure (kPa, user's node order) before the first step of a stage of moving
    /// ground. Constant forces balance it: the start of consolidation under a new load.
    ///
    /// # Errors
    /// A dry section, a stage that has made a step or has large displacements, or an array of the wrong length.
    pub fn set_excess_pore_pressure(&mut self, excess: &[f64]) -> Result<(), SolverError> {
        let (found, expected) = (excess.len(), self.domain.ground.nodes());
        if found != expected {
            return Err(SolverError::Shape { name: "excess_pore_pressure", found, expected });
        }
        let Domain { ground, clock, .. } = &mut self.domain;
        // With large displacements there are no constant forces.
        let (Active::Moving(stage), 0, Some(_), None) =
            (&mut self.active, clock.step, &ground.water, ground.sharpness)
        else {
            return Err(SolverError::Order {
                call: "set_excess_pore_pressure",
                needs: "water and a shaking stage before its first step",
            });
        };
        let own: Vec<f64> = ground.order.iter().map(|&user| excess[user]).collect();
        ground.set_excess(&own);
        if let Some(neighbour) = &mut stage.neighbour {
            neighbour.set_excess(&ground.edges, &own);
        }
        self.domain.balance_under_load();
        Ok(())
    }

    /// Sets the velocities (m/s, user's node order) before the first step of a stage of moving ground, to
    /// start with waves in the ground.
    ///
    /// # Errors
    /// A stage that has made a step, or an array of the wrong length.
    pub fn set_velocity(&mut self, velocity: &[[f64; 2]]) -> Result<(), SolverError> {
        let Domain { ground, clock, .. } = &mut self.domain;
        let (found, expected) = (velocity.len(), ground.nodes());
        if found != expected {
            return Err(SolverError::Shape { name: "velocity", found, expected });
        }
        let (Active::Moving(_), 0) = (&self.active, clock.step) else {
            return Err(SolverError::Order {
                call: "set_velocity",
                needs: "a stage of moving ground before its first step",
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

    /// Keeps the contacts of the first stage of moving ground.
    fn begin_inertia(&mut self) {
        let Ground { model, points, .. } = &self.ground;
        let contacts = self.inertia.take().and_then(|before| before.contacts);
        self.inertia = model
            .numerics
            .dispersion_correction
            .then(|| CorrectedInertia { dispersion: Dispersion::new(model, points.len()), contacts });
    }

    /// Places base and sides: held at their present position, free to move, or unchanged since the stage before.
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

    /// Holds base and sides at their present position as in a static stage, and removes open sides.
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
        // The pore pressure of the stage starts from the present one.
        let water = ground.water.take();
        self.rebuild_geometry();
        self.ground.water = water;
        self.refresh_present_shares();
    }

    /// Starts the soil models from the present stress, with the ground at rest.
    fn begin_soils(&mut self) -> Result<(), SolverError> {
        let Ground { model, layout, velocity, acceleration, points, soil, .. } = &mut self.ground;
        velocity.fill(Vec2::zeros());
        acceleration.fill(Vec2::zeros());
        *soil = SoilField::plastic(model, layout, points, None)?;
        self.counters.inadmissible_starts = soil.inadmissible_starts();
        if let (Some(inertia), StressLayout::Diagonal) = (&mut self.inertia, &*layout) {
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

    /// Starts the ground beside the section and couples it with the section.
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

    /// Starts the pore pressure of the stage from the present excess.
    fn begin_pore_pressure(&mut self, stage: &Stage) -> Result<PressureCoupling, SolverError> {
        let scheme = self.flow_scheme(stage.time_step_factor);
        let before = self.ground.water.take();
        let outline = self.ground.outline();
        if self.ground.layout.dual().is_some() {
            self.ground.water = self.begin_corner_pressure(stage, scheme, before.as_ref(), &outline)?;
            return Ok(PressureCoupling::of(self.ground.water.as_ref()));
        }
        let before = before.as_ref().and_then(PoreWater::nodes);
        let mut flow = Flow::new(self.ground.view(&outline), scheme, &stage.conditions)?;
        if let Some(flow) = &mut flow {
            match &stage.water_reference {
                WaterReference::StillWater { line } => {
                    self.stand_in_water(flow, line.as_deref(), before, &outline)?;
                }
                WaterReference::AtRest => {
                    if let Some(before) = before {
                        flow.set_excess(|excess| excess.copy_from_slice(before.own_excess()));
                    }
                }
            }
        }
        self.ground.water = flow.map(|flow| PoreWater::Nodes(Box::new(flow)));
        Ok(PressureCoupling::of(self.ground.water.as_ref()))
    }

    /// The same at the corners of cells.
    fn begin_corner_pressure(
        &self,
        stage: &Stage,
        scheme: FlowScheme,
        before: Option<&PoreWater>,
        outline: &Outline,
    ) -> Result<Option<PoreWater>, SolverError> {
        let section = self.ground.view(outline);
        let (model, Some(dual)) = (section.model, section.layout.dual()) else { return Ok(None) };
        let of_before = before.and_then(|before| before.saturation(section.layout));
        let saturation =
            |node| of_before.as_ref().map_or_else(|| model.saturation(node), |of_node| of_node(node));
        let flow = CornerFlow::new(section, scheme, &stage.conditions, saturation)?;
        let (Some(mut flow), Some(water)) = (flow, model.water) else { return Ok(None) };
        if let Some(before) = before.and_then(PoreWater::corners) {
            flow.continue_from(before, dual);
        }
        if let WaterReference::StillWater { line } = &stage.water_reference {
            let still = match line {
                Some(line) => StillWater::new(water, line)?,
                None => StillWater::at_rest(model, water),
            };
            flow.stand_in(still, &section, &model.neutral_stress());
        }
        Ok(Some(PoreWater::Corners(Box::new(flow))))
    }

    /// Starts `flow` in still water with its surface at `line`, or with the water surface of the static
    /// stage, from the pore water of the stage `before`.
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

    /// Scheme of the pore pressure: as the numerics prescribe, or the one with the longer time step.
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
