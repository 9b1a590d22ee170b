//! What others may know of a simulation: columns of the section beside them, and arrays in the user's node order.

use super::{Active, Counters, Simulation, channel_names};
use crate::{
    edges::base::Impedance,
    error::SolverError,
    run::time_step::Criterion,
    section::description::STRESS_NODES,
    skeleton::{contacts::Contacts, point::StressPoint},
    water::pore_pressure::Flow,
};
use sandboil_soil::Stress;
use sandboil_sph::Vec2;

impl Simulation {
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

    pub(super) fn in_user_order<T: Copy + Default>(&self, value: impl Fn(usize) -> T) -> Vec<T> {
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
