//! What follows the ground to where it comes: edges, geometry, volumes, masses and the shares of the force loop.

use super::Simulation;
use crate::{
    run::section_view::Section,
    section::{description::STRESS_NODES, outline::Outline},
    skeleton::{deformation::Deformation, inertia::lumped_masses, strain_and_force::motion},
    stages::{free_field::FreeField, run_out::Flowing},
    water::pore_pressure::Ground,
    weights::{free_surface::free_surface, geometry::Geometry, points::stress_node_values},
};
use sandboil_sph::Vec2;

impl Simulation {
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
    pub(super) fn set_guests(&mut self, guests: usize) {
        for motion in [&mut self.velocity, &mut self.acceleration] {
            motion.resize(self.model.nodes() + guests, Vec2::zeros());
        }
    }

    /// The edges where they now stand: in shaking they go with the nodes along them, as far as they are free to.
    pub(super) fn present_outline(&self) -> Outline {
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

    pub(super) fn section<'a>(&'a self, outline: &'a Outline) -> Section<'a> {
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

    pub(super) fn ground<'a>(&'a self, outline: &'a Outline) -> Ground<'a> {
        Ground {
            model: &self.model,
            phases: &self.phases,
            geometry: &self.geometry,
            position: &self.position,
            edges: (outline, self.walls),
            free_surface: self.flowing.as_ref().map(|flowing| flowing.free_surface.as_slice()),
        }
    }

    pub(super) fn rebuild_geometry(&mut self) {
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
    pub(super) fn sharpen_contacts(&mut self) {
        let Some(contacts) = &self.contacts else { return };
        let outline = self.present_outline();
        let value = stress_node_values(&self.model, &self.position, (&outline, self.walls));
        self.mass = lumped_masses(&value, &self.points, self.model.nodes());
        let changed = (&mut self.geometry, self.mass.as_mut_slice());
        contacts.sharpen(&self.model, &self.position, &self.points, &value, changed);
    }

    /// Volumes, densities and masses of the present strain, from which deformation starts anew.
    pub(super) fn follow_volumes(&mut self) {
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
    pub(super) fn refresh_shares(&mut self, velocity: &[Vec2]) {
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
    pub(super) fn refresh_present_shares(&mut self) {
        let velocity = std::mem::take(&mut self.velocity);
        self.refresh_shares(&velocity);
        self.velocity = velocity;
    }

    /// Lets what flowing ground knows of its geometry follow, its free surface if water may cross it.
    pub(super) fn follow_flow(&mut self) {
        let Some(mut flowing) = self.flowing.take() else { return };
        flowing.follow(self.geometry.sharpness(self.phases.volume()));
        if self.model.water.is_some() {
            let edges = (&flowing.outline, self.walls);
            let volume = self.phases.volume();
            flowing.free_surface = free_surface(self.threads > 1, &self.model, &self.position, volume, edges);
        }
        self.flowing = Some(flowing);
    }

    /// Whether some stress node is strained beyond what its weights bear.
    pub(super) fn is_strained(&self) -> bool {
        let limit = self.model.numerics.geometry_strain_limit();
        if self.flowing.is_some() && self.geometry.lists().are_left(&self.model, &self.position) {
            return true;
        }
        self.points.iter().any(|point| point.deformation.magnitude() > limit)
    }
}
