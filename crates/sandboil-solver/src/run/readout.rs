//! Output of a simulation: arrays in the user's node order, and quantities of a column for the section beside
//! it.

use crate::{
    edges::{
        base::{Base, Impedance, Vertical},
        compliant_base::CompliantBase,
    },
    error::SolverError,
    run::{
        clock::Counters,
        domain::Domain,
        ground::Ground,
        neighbour::Neighbour,
        simulation::{Active, Driver},
        time_step::{Criterion, PressureCoupling, TimeLimit},
    },
    section::{
        description::{Operators, STRESS_NODES},
        outline::Hand,
    },
    skeleton::{
        contacts::Contacts, point::StressPoint, printed::PrintedStress, rayleigh::RayleighDamping,
        shared_volume::SharedStrain,
    },
    water::{pore_pressure::FlowScheme, pore_water::PoreWater},
};
use sandboil_soil::Stress;
use sandboil_sph::Vec2;

impl<N: Neighbour> Driver<N> {
    /// Time in the stage, s.
    pub fn time(&self) -> f64 {
        self.domain.clock.time
    }

    /// Steps made in the stage.
    pub fn step(&self) -> u64 {
        self.domain.clock.step
    }

    /// Present time step, s, and what limits it.
    pub fn time_step(&self) -> (f64, Criterion) {
        (self.domain.clock.dt, self.domain.clock.criterion)
    }

    /// Time step that the present stiffness would allow without the stage's Rayleigh damping, s; `None` if it has none.
    pub fn undamped_time_step(&self) -> Option<f64> {
        let (stage, _) = self.moving().zip(self.domain.damping.rayleigh.as_ref())?;
        Some(self.domain.limit_under(None, stage.coupling, stage.stage.time_step_factor).dt)
    }

    /// Largest unbalanced acceleration over gravity in a static stage; infinite before its first step.
    pub fn residual(&self) -> f64 {
        match &self.active {
            Active::Relaxing(stage) => stage.residual,
            _ => f64::INFINITY,
        }
    }

    /// Counts of the work done in the stage; the section's first geometry is not counted.
    pub fn counters(&self) -> Counters {
        self.domain.counters
    }

    /// How pore pressure is advanced in the stage.
    pub fn flow_scheme_name(&self) -> &'static str {
        self.domain.ground.water.as_ref().map_or("none", |water| water.scheme().name())
    }

    /// Number of velocity nodes.
    pub fn nodes(&self) -> usize {
        self.domain.ground.nodes()
    }

    /// Pairs of a stress node and a velocity node; images count as their nodes.
    pub fn pairs(&self) -> usize {
        self.domain.ground.geometry.pairs()
    }

    /// Dashpot coefficients of the base points, kPa s/m; empty without a compliant base.
    pub fn base_impedances(&self) -> Vec<f64> {
        let base = self.moving().and_then(|stage| stage.base.as_ref());
        base.map_or_else(Vec::new, |base| {
            base.impedance().iter().map(|below| below.density * below.shear_speed).collect()
        })
    }

    /// Names of the physical processes that a stage may compute, and whether the present stage computes them.
    pub fn physics(&self) -> Vec<(&'static str, bool)> {
        let Domain { ground, damping, inertia, .. } = &self.domain;
        let Ground { model, layout, water, soil, sharpness, .. } = ground;
        let stage = self.moving();
        let base = stage.and_then(|stage| stage.stage.compliant_base());
        let is = |test: fn(FlowScheme) -> bool| water.as_ref().is_some_and(|water| test(water.scheme()));
        let is_partly_saturated = model.saturation.iter().any(|share| *share < 1.0);
        vec![
            ("pore water", model.water.is_some()),
            ("water diffusion", is(FlowScheme::is_drained)),
            ("water acceleration", is(FlowScheme::has_acceleration_term)),
            (
                "partial saturation",
                is_partly_saturated || water.as_ref().is_some_and(|water| water.saturation(layout).is_some()),
            ),
            ("soil state", soil.plastic_points() > 0),
            ("base dashpots", base.is_some()),
            ("vertical waves", base.is_some_and(|base| base.vertical == Vertical::Absorbing)),
            ("wave passage", base.is_some_and(Base::has_passage)),
            ("free-field columns", stage.is_some_and(|stage| stage.neighbour.is_some())),
            ("local damping", damping.local > 0.0),
            ("Rayleigh damping", damping.rayleigh.is_some()),
            ("dispersion correction", inertia.is_some()),
            ("run-out", sharpness.is_some()),
            (
                "velocity filter",
                model.numerics.operators != Operators::Printed && model.numerics.velocity_filter > 0.0,
            ),
        ]
    }

    /// Names and bytes of the arrays that exist; arrays that a scene does not need are not in the list.
    pub fn arrays(&self) -> Vec<(&'static str, usize)> {
        let Domain { ground, forces, damping, inertia, workspace, .. } = &self.domain;
        let Ground { position, velocity, acceleration, points, geometry, phases, water, soil, .. } = ground;
        let motion = [position, velocity, acceleration, &workspace.water_force];
        let motion: usize = motion.map(|array| size_of_val(array.as_slice())).iter().sum();
        let shared = workspace.shared.as_ref().map_or(0, SharedStrain::bytes);
        let of_points = size_of_val(points.as_slice()) + size_of_val(workspace.shares.as_slice());
        let stress = of_points + ground.layout.bytes() + shared;
        let stage = self.moving();
        let envelopes = stage.map(|stage| &stage.observers.envelopes);
        let envelope = |values: &Option<Vec<f64>>| values.as_deref().map(size_of_val);
        let free_surface = ground.free_surface.as_deref().map_or(0, size_of_val);
        let all = [
            ("motion", Some(motion)),
            ("constant_forces", Some(forces.bytes())),
            ("stress", Some(stress)),
            ("geometry", Some(geometry.bytes())),
            ("phases", Some(phases.bytes())),
            ("pore_pressure", water.as_ref().map(PoreWater::bytes)),
            ("soil_state", (soil.plastic_points() > 0).then(|| soil.state_bytes())),
            ("printed_stress", workspace.printed.as_ref().map(PrintedStress::bytes)),
            ("viscous_stress", damping.rayleigh.as_ref().map(RayleighDamping::bytes)),
            ("run_out", damping.viscosity.as_ref().map(|viscosity| viscosity.bytes() + free_surface)),
            (
                "inertia_correction",
                inertia.as_ref().map(|inertia| {
                    inertia.dispersion.bytes() + inertia.contacts.as_ref().map_or(0, Contacts::bytes)
                }),
            ),
            ("base", stage.and_then(|stage| stage.base.as_ref()).map(CompliantBase::bytes)),
            ("free_field", stage.and_then(|stage| stage.neighbour.as_ref()).map(N::bytes)),
            ("pressure_envelope", envelopes.and_then(|envelopes| envelope(&envelopes.pressure))),
            ("strain_envelope", envelopes.and_then(|envelopes| envelope(&envelopes.strain))),
        ];
        all.into_iter().filter_map(|(name, bytes)| bytes.map(|bytes| (name, bytes))).collect()
    }

    /// Positions without periodic wrapping (virtual coordinates), m: a lateral displacement larger than the
    /// period stays visible.
    pub fn position(&self) -> Vec<[f64; 2]> {
        let ground = &self.domain.ground;
        ground.in_user_order(|j| ground.position[j].into())
    }

    /// Displacements since the section was built, m.
    pub fn displacement(&self) -> Vec<[f64; 2]> {
        let ground = &self.domain.ground;
        ground.in_user_order(|j| (ground.position[j] - ground.model.position[j]).into())
    }

    /// Velocities at the middle of the last step, m/s.
    pub fn velocity(&self) -> Vec<[f64; 2]> {
        let ground = &self.domain.ground;
        ground.in_user_order(|j| ground.velocity[j].into())
    }

    /// Accelerations of the last step, m/s2.
    pub fn acceleration(&self) -> Vec<[f64; 2]> {
        let ground = &self.domain.ground;
        ground.in_user_order(|j| ground.acceleration[j].into())
    }

    /// Excess pore pressure since shaking began, kPa; `None` without water.
    pub fn excess_pore_pressure(&self) -> Option<Vec<f64>> {
        let Ground { model, water, .. } = &self.domain.ground;
        model.water?;
        let excess = |j| water.as_ref().map_or(0.0, |water| water.excess(j));
        Some(self.domain.ground.in_user_order(excess))
    }

    /// Degree of saturation; `None` where it cannot change: without retention curves, and before shaking.
    pub fn saturation(&self) -> Option<Vec<f64>> {
        let ground = &self.domain.ground;
        let saturation = ground.water.as_ref()?.saturation(&ground.layout)?;
        Some(ground.in_user_order(saturation))
    }

    /// Number of stress points.
    pub fn stress_points(&self) -> usize {
        self.domain.ground.points.len()
    }

    /// Effective stress `(xx, yy, xy, zz)` at the stress points of every node, kPa, tension positive: as many rows for each
    /// node as it has stress points.
    pub fn stress(&self) -> Vec<Vec<[f64; 4]>> {
        self.at_stress_points(|point| {
            let Stress { xx, yy, xy, zz } = point.stress;
            [xx, yy, xy, zz]
        })
    }

    /// Strain `(xx, yy, engineering xy)` since the stage began at the stress points of every node.
    pub fn strain(&self) -> Vec<Vec<[f64; 3]>> {
        self.at_stress_points(|point| point.strain)
    }

    fn at_stress_points<T>(&self, value: impl Fn(&StressPoint) -> T) -> Vec<Vec<T>> {
        let Ground { layout, points, order, .. } = &self.domain.ground;
        let mut rows: Vec<Vec<T>> = order.iter().map(|_| Vec::new()).collect();
        for (j, &user) in order.iter().enumerate() {
            rows[user] = layout.of_node(j).map(|(point, _)| value(&points[point])).collect();
        }
        rows
    }

    /// Largest excess pore pressure of every node since shaking began, kPa, if it is recorded.
    pub fn largest_excess_pore_pressure(&self) -> Option<Vec<f64>> {
        let envelope = self.moving()?.observers.envelopes.pressure.as_ref()?;
        Some(self.domain.ground.in_user_order(|j| envelope[j]))
    }

    /// Largest engineering shear strain of every node since shaking began, if it is recorded.
    pub fn largest_shear_strain(&self) -> Option<Vec<f64>> {
        let envelope = self.moving()?.observers.envelopes.strain.as_ref()?;
        let layout = &self.domain.ground.layout;
        let largest =
            |j: usize| layout.of_node(j).fold(0.0_f64, |most, (point, _)| most.max(envelope[point]));
        Some(self.domain.ground.in_user_order(largest))
    }

    /// Names of the history channels of each probe, in the order of [`Driver::take_histories`].
    pub fn channel_names(&self) -> Vec<&'static str> {
        self.moving()
            .map_or_else(Vec::new, |stage| stage.observers.histories.channel_names(&self.domain.ground))
    }
}

/// Quantities of a column that the section beside it reads, by internal index.
impl<N: Neighbour> Driver<N> {
    /// Internal index of every node, in the user's order.
    pub(crate) fn internal_order(&self) -> Vec<usize> {
        let order = &self.domain.ground.order;
        let mut internal = vec![0; order.len()];
        for (j, &user) in order.iter().enumerate() {
            internal[user] = j;
        }
        internal
    }

    /// Velocity of a node, m/s.
    pub(crate) fn velocity_of(&self, node: usize) -> Vec2 {
        self.domain.ground.velocity[node]
    }

    /// Acceleration of a node, m/s2.
    pub(crate) fn acceleration_of(&self, node: usize) -> Vec2 {
        self.domain.ground.acceleration[node]
    }

    /// Nominal stress `[xx, xy, yx, yy]` of both stress points of the node of a column one node wide, kPa: effective, with
    /// the excess pore pressure where that is computed at the stress points.
    pub(crate) fn nominal_stress(&self, node: usize) -> [[f64; 4]; STRESS_NODES] {
        let Ground { layout, points, .. } = &self.domain.ground;
        layout
            .beside(node, Hand::Left)
            .map(|s| points[s].deformation.cofactor().nominal(&points[s].total_stress()))
    }

    /// Nominal excess pore pressure `q J F^-T` of a node, kPa; zero without water.
    pub(crate) fn nominal_water(&self, node: usize) -> [f64; 4] {
        let flow = self.domain.ground.water.as_ref().and_then(PoreWater::nodes);
        flow.map_or([0.0; 4], |flow| flow.nominal(node))
    }

    /// Traction of the compliant base in the last step, mean over its points, kPa.
    pub(crate) fn base_traction(&self) -> Vec2 {
        let Some(base) = self.moving().and_then(|stage| stage.base.as_ref()) else { return Vec2::zeros() };
        let dashpots = base.dashpots();
        let total: Vec2 =
            dashpots.all().iter().zip(dashpots.traction()).map(|(d, traction)| d.direction * *traction).sum();
        total / self.domain.ground.edges.base.len().max(1) as f64
    }

    /// Density and small-strain wave speeds at a node's own stress.
    pub(crate) fn small_strain_impedance(&self, node: usize) -> Result<Impedance, SolverError> {
        let ground = &self.domain.ground;
        let mean = |component: fn(&Stress) -> f64| -> f64 {
            let of_node = ground.layout.of_node(node);
            of_node.map(|(point, share)| share * component(&ground.points[point].stress)).sum()
        };
        let stress =
            Stress { xx: mean(|s| s.xx), yy: mean(|s| s.yy), xy: mean(|s| s.xy), zz: mean(|s| s.zz) };
        ground.impedance_at(node, stress).map_err(|error| error.in_user_order(&ground.order))
    }

    /// Longest stable time step, s.
    pub(crate) fn limit(&self, coupling: PressureCoupling, factor: f64) -> TimeLimit {
        self.domain.limit(coupling, factor)
    }

    /// Whether the ground is strained beyond the range of its weights.
    pub(crate) fn is_strained(&self) -> bool {
        self.domain.ground.is_strained()
    }

    /// Sets the excess pore pressure of the nodes, kPa, and holds it in balance by a load.
    pub(crate) fn hold_excess(&mut self, excess: &[f64]) {
        self.domain.ground.set_excess(excess);
        self.domain.balance_under_load();
    }
}
