//! The state of a section: positions, motion, soil and pore water.

use crate::{
    edges::base::{Base, Impedance},
    error::SolverError,
    section::{
        description::{Model, Region},
        dual_lattice::DualLattice,
        edge_nodes::EdgeNodes,
        order::sorted,
        outline::{EdgesView, Outline, Walls},
        stress_layout::{StressLayout, check_stress},
    },
    skeleton::{
        deformation::Deformation, phases::Phases, point::StressPoint, section_view::SectionView,
        soils::SoilField,
    },
    water::pore_water::PoreWater,
    weights::{corners::move_corners, free_surface::free_surface, geometry::Geometry, points::point_weights},
};
use sandboil_soil::Stress;
use sandboil_sph::Vec2;

/// Place of base and sides.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub enum Placement {
    /// As in the model.
    Drawn,
    /// Moved with the nodes along them, in the components in which the edges are free, from these positions
    /// (m).
    WithNodes(Vec<Vec2>),
    /// Held at their place at the start of a stage.
    Held(Outline),
}

/// Sharpness of the weights with large displacements.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub struct Sharpness {
    /// Sharpness of the weights of the lattice, 1/m2, for which the limits of the time step hold.
    lattice: [f64; 2],
    /// Factor on these limits where nodes are closer than in the lattice.
    pub step_factor: f64,
}

impl Sharpness {
    /// The sharpness of the lattice of a model.
    pub fn new(model: &Model) -> Self {
        let Model { position, volume, outline, .. } = model;
        let edges = EdgesView::statics(outline);
        let lattice = Geometry::build(model, position, volume, edges);
        let lattice = lattice.sharpness(&StressLayout::new(model), volume);
        Self { lattice, step_factor: 1.0 }
    }

    /// Updates the factor for weights of another sharpness, 1/m2.
    pub fn update(&mut self, sharpness: [f64; 2]) {
        let squared = |(now, lattice): (f64, f64)| if lattice > 0.0 { now / lattice } else { 1.0 };
        let sharper = sharpness.into_iter().zip(self.lattice).map(squared).fold(1.0, f64::max);
        self.step_factor = sharper.sqrt().recip();
    }
}

/// A section and its state. Nodes are sorted by region, row and column.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct Ground {
    /// The section; its positions are the initial ones.
    pub model: Model,
    /// User's index of each node.
    pub order: Vec<usize>,
    /// Nodes along the edges.
    pub edges: EdgeNodes,
    /// Conditions of the edges.
    pub walls: Walls,
    /// Place of the edges.
    pub placement: Placement,
    /// Present positions of the nodes, m.
    pub position: Vec<Vec2>,
    /// Velocities of the nodes, m/s, followed by the copies of a neighbour's.
    pub velocity: Vec<Vec2>,
    /// Accelerations in the same order, m/s2.
    pub acceleration: Vec<Vec2>,
    /// Volumes, porosities and densities.
    pub phases: Phases,
    /// Mass of each node, Mg/m.
    pub mass: Vec<f64>,
    /// Where the stress points are.
    pub layout: StressLayout,
    /// Stress points.
    pub points: Vec<StressPoint>,
    /// Soil models of the stress points.
    pub soil: SoilField,
    /// Pore pressure in a stage of moving ground.
    pub water: Option<PoreWater>,
    /// Weights at the present positions.
    pub geometry: Geometry,
    /// Sharpness of the weights, with large displacements.
    pub sharpness: Option<Sharpness>,
    /// Outward normals of the nodes at the free surface, if it is found from the nodes; empty in a dry
    /// section.
    pub free_surface: Option<Vec<Option<Vec2>>>,
}

impl Ground {
    /// The section at its geostatic stress, at rest on held edges.
    ///
    /// # Errors
    /// Bad input, or elastic constants outside their range.
    pub fn new(model: &Model) -> Result<Self, SolverError> {
        model.validate()?;
        check_stress(model)?;
        let (model, order) = sorted(model);
        let nodes = model.nodes();
        let phases = Phases::new(&model);
        let walls = Walls::statics(&model.outline);
        let geometry = Geometry::build(
            &model,
            &model.position,
            phases.volume(),
            EdgesView { outline: &model.outline, walls },
        );
        let layout = StressLayout::new(&model);
        let mut points: Vec<StressPoint> = (0..layout.count(nodes))
            .map(|s| {
                let Region { earth_pressure_coefficient, .. } = model.regions[layout.region(&model, s)];
                let vertical = -model.vertical_effective_stress[s];
                let lateral = earth_pressure_coefficient * vertical;
                let stress = Stress { xx: lateral, yy: vertical, xy: 0.0, zz: lateral };
                let volume = layout.volume(s, phases.volume());
                StressPoint { stress, volume, ..StressPoint::default() }
            })
            .collect();
        let soil =
            SoilField::elastic(&model, &layout, &mut points).map_err(|error| error.in_user_order(&order))?;
        Ok(Self {
            order,
            edges: EdgeNodes::new(&model),
            walls,
            placement: Placement::Drawn,
            position: model.position.clone(),
            velocity: vec![Vec2::zeros(); nodes],
            acceleration: vec![Vec2::zeros(); nodes],
            mass: vec![0.0; nodes],
            layout,
            points,
            soil,
            water: None,
            geometry,
            sharpness: None,
            free_surface: None,
            phases,
            model,
        })
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.model.nodes()
    }

    /// Strength `xi / dx` of the velocity filter, 1/m.
    pub fn filter(&self) -> f64 {
        self.model.numerics.velocity_filter / self.model.mean_spacing()
    }

    /// Kinetic energy, kJ/m.
    pub fn kinetic_energy(&self) -> f64 {
        self.mass.iter().zip(&self.velocity).map(|(mass, v)| 0.5 * mass * v.norm_squared()).sum()
    }

    /// The edges at their present place: free edges move with the mean of the nodes along them.
    pub fn outline(&self) -> Outline {
        let from = match &self.placement {
            Placement::Drawn => return self.model.outline.clone(),
            Placement::Held(outline) => return outline.clone(),
            Placement::WithNodes(from) => from,
        };
        let moved = |nodes: &[usize], free: [bool; 2]| {
            let total: Vec2 = nodes.iter().map(|&node| self.position[node] - from[node]).sum();
            let mean = total / nodes.len().max(1) as f64;
            Vec2::new(if free[0] { mean.x } else { 0.0 }, if free[1] { mean.y } else { 0.0 })
        };
        let sides = [0, 1].map(|k| moved(&self.edges.sides[k], self.walls.sides[k].free_components()));
        self.model.outline.moved(moved(&self.edges.base, self.walls.base.free_components()), sides)
    }

    /// A view of the present section, with its edges.
    pub fn view<'a>(&'a self, outline: &'a Outline) -> SectionView<'a> {
        SectionView {
            model: &self.model,
            outline,
            walls: self.walls,
            edges: &self.edges,
            position: &self.position,
            phases: &self.phases,
            layout: &self.layout,
            points: &self.points,
            mass: &self.mass,
            geometry: &self.geometry,
            free_surface: self.free_surface.as_deref(),
        }
    }

    /// Updates the pore water with a view of the present section.
    pub fn with_water(&mut self, outline: &Outline, update: impl FnOnce(&mut PoreWater, SectionView)) {
        let Some(mut water) = self.water.take() else { return };
        update(&mut water, self.view(outline));
        self.water = Some(water);
    }

    /// Sets the excess pore pressure from that of the nodes, kPa.
    pub fn set_excess(&mut self, excess: &[f64]) {
        match (&mut self.water, &self.layout) {
            (Some(PoreWater::Nodes(flow)), _) => flow.set_excess(|own| own.copy_from_slice(excess)),
            (Some(PoreWater::Corners(flow)), StressLayout::Dual(dual)) => {
                flow.set_from_nodes(&self.model, &self.position, dual, excess);
            }
            _ => {}
        }
    }

    /// Sets the number of copies of a neighbour's motion after the nodes.
    pub fn resize_copies(&mut self, copies: usize) {
        for motion in [&mut self.velocity, &mut self.acceleration] {
            motion.resize(self.model.nodes() + copies, Vec2::zeros());
        }
    }

    /// Moves the corners of cells with the nodes since the last geometry. On base and sides they stay there, in the
    /// components in which these are held.
    pub fn move_corners(&mut self) {
        let outline = self.outline();
        let Self { layout: StressLayout::Dual(dual), geometry, position, walls, .. } = self else { return };
        move_corners(dual, geometry, position, EdgesView { outline: &outline, walls: *walls });
    }

    /// Updates volumes, densities and masses from the present strain, and restarts the deformation. Returns
    /// how many porosities were clipped to their range.
    pub fn update_volumes(&mut self) -> u64 {
        let Self { phases, mass, layout, points, .. } = self;
        let clips = phases.update_volumes(layout, points);
        for (node, mass) in mass.iter_mut().enumerate() {
            *mass = phases.mass(node);
        }
        if let Some(dual) = layout.dual() {
            update_corners(dual, points, mass, phases.volume());
        } else {
            for (s, point) in points.iter_mut().enumerate() {
                let node = layout.node(s);
                point.density = mass[node] / phases.volume()[node];
                point.volume = layout.volume(s, phases.volume());
            }
        }
        for point in points {
            point.deformation = Deformation::default();
        }
        clips
    }

    /// With large displacements, updates the sharpness of renewed weights, and the free surface if there is
    /// water.
    pub fn update_surroundings(&mut self, threaded: bool) {
        let volume = self.phases.volume();
        if let Some(sharpness) = &mut self.sharpness {
            sharpness.update(self.geometry.sharpness(&self.layout, volume));
        }
        if self.free_surface.is_some() && self.model.water.is_some() {
            let outline = self.outline();
            let edges = EdgesView { outline: &outline, walls: self.walls };
            self.free_surface = Some(free_surface(threaded, &self.model, &self.position, volume, edges));
        }
    }

    /// Whether some stress node is strained beyond the range of its weights, or with large displacements a
    /// node has left the skin of the lists.
    pub fn is_strained(&self) -> bool {
        let limit = self.model.numerics.geometry_strain_limit();
        if self.sharpness.is_some() && self.geometry.lists().is_skin_left(&self.model, &self.position) {
            return true;
        }
        self.points.iter().any(|point| point.deformation.magnitude() > limit)
    }

    /// Sets strains to zero at the start of a stage.
    pub fn restart_strain(&mut self) {
        self.phases.restart_strain();
        for point in &mut self.points {
            point.strain = [0.0; 3];
        }
    }

    /// The half-space below each base point: as given, or as the layer above it, with the soil's small-strain
    /// moduli at the stress of the base.
    ///
    /// # Errors
    /// Soil that refuses its stress.
    pub fn base_impedance(&self, base: &Base) -> Result<Vec<Impedance>, SolverError> {
        let points = self.edges.base_points(&self.model, &self.position);
        let stress_position = self.layout.positions(&self.position, self.model.spacing);
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
                // A level roller base, for which no compression-wave speed is given, does not use this value.
                let compression_speed = given.compression_speed.unwrap_or(given.shear_speed);
                Ok(Impedance { density: given.density, shear_speed: given.shear_speed, compression_speed })
            })
            .collect()
    }

    /// Density and small-strain wave speeds of the soil of a node at a stress; the compression wave's undrained.
    ///
    /// # Errors
    /// Soil that refuses the stress.
    pub fn impedance_at(&self, node: usize, stress: Stress) -> Result<Impedance, SolverError> {
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

    /// Values of the nodes in the user's order.
    pub fn in_user_order<T: Copy + Default>(&self, value: impl Fn(usize) -> T) -> Vec<T> {
        let mut out = vec![T::default(); self.model.nodes()];
        for (j, &user) in self.order.iter().enumerate() {
            out[user] = value(j);
        }
        out
    }
}

/// Updates the volumes of corners from their deformation since the last geometry, those of a group by the same ratio, and
/// their densities from the masses (Mg/m) and volumes (m2) of the nodes around them.
fn update_corners(dual: &DualLattice, points: &mut [StressPoint], mass: &[f64], volume: &[f64]) {
    let ratio = |group: &Vec<u32>| {
        let before: f64 = group.iter().map(|&s| points[s as usize].volume).sum();
        let now = |&s: &u32| points[s as usize].volume * points[s as usize].deformation.volume_ratio();
        group.iter().map(now).sum::<f64>() / before
    };
    let of_group: Vec<f64> = dual.groups.iter().map(ratio).collect();
    for (point, group) in points.iter_mut().zip(&dual.group) {
        let own = point.deformation.volume_ratio();
        point.volume *= group.map_or(own, |group| of_group[group as usize]);
    }
    let mut around = vec![[0.0; 2]; points.len()];
    for (node, corners) in dual.of_node.iter().enumerate() {
        for corner in corners {
            let [masses, volumes] = &mut around[*corner as usize];
            *masses += mass[node];
            *volumes += volume[node];
        }
    }
    for (point, [masses, volumes]) in points.iter_mut().zip(around) {
        point.density = masses / volumes;
    }
}
