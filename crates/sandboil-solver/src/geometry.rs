//! Weight tables of the current geometry. They stay frozen while strains are small.

use crate::model::{Model, Operators, STRESS_NODES, stress_node_offset};
use sandboil_sph::{
    Csr, GradientWeight, LeastSquaresFit, NeighbourList, Period, Source, Vec2, WendlandQuintic,
    operators::{Member, consistent_fit, corrected_gradient, interpolation, laplacian_factor, stencil},
};
use std::ops::AddAssign;

/// Skin of the neighbour lists over the particle spacing: the lists survive displacements of half of it.
const SKIN: f64 = 0.3;

/// How a wall continues one velocity component across itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parity {
    /// No image: the component is free of the wall.
    Free,
    /// The image moves along (free slip).
    Even,
    /// The image moves against (held at zero on the wall).
    Odd,
}

impl Parity {
    /// Factor on the owner's component, zero where there is no image.
    fn sign(self) -> f64 {
        match self {
            Self::Free => 0.0,
            Self::Even => 1.0,
            Self::Odd => -1.0,
        }
    }
}

/// What the base does to the velocity field: fixed in statics, a roller under the compliant base.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wall {
    /// Tangential (x) component.
    pub tangential: Parity,
    /// Normal (y) component.
    pub normal: Parity,
}

impl Wall {
    /// Fixed base of static stages.
    pub const NO_SLIP: Self = Self { tangential: Parity::Odd, normal: Parity::Odd };
    /// Vertical roller whose horizontal motion is left to tractions: the compliant base of `conservative`.
    pub const TRACTION: Self = Self { tangential: Parity::Free, normal: Parity::Odd };
    /// Free slip: the compliant base of `printed`, whose shear images are odd.
    pub const FREE_SLIP: Self = Self { tangential: Parity::Even, normal: Parity::Odd };
}

/// What a wall adds to the gradient of each velocity component at a stress node.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WallWeight {
    /// Added to the weights of `grad v_x`, 1/m.
    pub x: Vec2,
    /// Added to the weights of `grad v_y`, 1/m.
    pub y: Vec2,
}

impl AddAssign for WallWeight {
    fn add_assign(&mut self, other: Self) {
        self.x += other.x;
        self.y += other.y;
    }
}

/// A table and its transpose: one gathers, the other gives the force back.
#[derive(Debug, Clone, Default)]
pub struct Paired<T> {
    /// Rows gather.
    pub forward: Csr<T>,
    /// Rows collect what their column took part in.
    pub transposed: Csr<T>,
}

impl<T: Copy + AddAssign> Paired<T> {
    fn new(forward: Csr<T>, columns: usize) -> Self {
        let transposed = forward.transposed(columns);
        Self { forward, transposed }
    }

    fn bytes(&self) -> usize {
        self.forward.bytes() + self.transposed.bytes()
    }
}

/// Tables that only a section with water has.
#[derive(Debug, Clone)]
pub struct FlowTables {
    /// `div v` at velocity nodes, component-wise weights with walls folded in (last term of Eq. 7). The
    /// transposed table is weighted with the row's volume: it is the pressure force.
    pub divergence: Paired<Vec2>,
    /// `div (k grad H)` at velocity nodes, m/s per m of head (first two terms of Eq. 7); empty if undrained.
    pub diffusion: Option<Csr<f64>>,
}

/// Tables of the printed operators (Eqs 6, 10, 11).
#[derive(Debug, Clone)]
pub struct PrintedTables {
    /// Stress at velocity nodes from stress nodes, Eq. 10.
    pub interpolation: Csr<f64>,
    /// `V_j grad_i W_ij` from velocity node to real stress nodes.
    pub kernel_gradient: Csr<Vec2>,
    /// The same to the mirrored stress nodes below the base; columns index `ghost_stress` rows.
    pub ghost_gradient: Csr<Vec2>,
    /// Linear extrapolation of Eq. 11 from velocity nodes to mirrored stress nodes.
    pub ghost_stress: Csr<f64>,
    /// Value at the mirror point, from velocity nodes: the odd shear of the compliant base.
    pub mirror_stress: Csr<f64>,
    /// Gradient of Eq. 9 at velocity nodes, for the pore pressure.
    pub pressure_gradient: Csr<Vec2>,
}

/// All weights of one geometry.
#[derive(Debug, Clone)]
pub struct Geometry {
    /// Gradient at stress nodes from velocity nodes, without walls.
    pub gradient: Paired<GradientWeight>,
    /// Position covariance `(xx, xy, yy)` of each stress node's stencil, m2: the filter's linear part.
    pub covariance: Vec<[f64; 3]>,
    /// What the base adds.
    pub wall: Paired<WallWeight>,
    /// Flow tables, if there is water.
    pub flow: Option<FlowTables>,
    /// Tables of the printed operators, if chosen.
    pub printed: Option<PrintedTables>,
    list: Lists,
}

#[derive(Debug, Clone)]
struct Lists {
    reference: Vec<Vec2>,
    from_stress: NeighbourList,
    from_velocity: NeighbourList,
}

/// Positions of all stress nodes of the given velocity nodes (offsets do not rotate), m.
pub fn stress_node_positions(position: &[Vec2], spacing: Vec2) -> Vec<Vec2> {
    let offset = stress_node_offset(spacing);
    position.iter().flat_map(|&x| [x + offset, x - offset]).collect()
}

/// Real nodes followed by their images in the base, within the kernel's reach of it.
fn sources(position: &[Vec2], base: f64, reach: f64) -> Vec<Source> {
    let real =
        position.iter().enumerate().map(|(i, &position)| Source { owner: id(i), position, mirrored: false });
    let mirrored = position.iter().enumerate().filter(|(_, x)| x.y - base < reach).map(|(i, x)| Source {
        owner: id(i),
        position: Vec2::new(x.x, 2.0 * base - x.y),
        mirrored: true,
    });
    real.chain(mirrored).collect()
}

#[allow(clippy::cast_possible_truncation)] // node counts stay far below 2^32
fn id(index: usize) -> u32 {
    index as u32
}

/// Stencils of one query kind, cut to the kernel's support.
struct Stencils<'a> {
    sources: &'a [Source],
    volume: &'a [f64],
    kernel: WendlandQuintic,
    period: Option<Period>,
}

impl Stencils<'_> {
    fn all(&self, list: &NeighbourList, query: usize, at: Vec2) -> Vec<Member> {
        stencil(list, query, at, self.sources, self.volume, self.kernel, self.period)
    }
}

fn real_only(members: &[Member]) -> Vec<Member> {
    members.iter().copied().filter(|m| !m.mirrored).collect()
}

impl Geometry {
    /// Builds all tables at `position` for nodes of `volume` (m2). Lists of `previous` are kept while no node has left their skin.
    pub fn build(
        model: &Model,
        position: &[Vec2],
        volume: &[f64],
        wall: Wall,
        previous: Option<Self>,
    ) -> Self {
        let kernel = WendlandQuintic::new(model.smoothing_length());
        let skin = SKIN * model.mean_spacing();
        // The lists may be older than the images' cut-off, so images reach one skin further than the kernel.
        let sources = sources(position, model.base_elevation, kernel.support() + 2.0 * skin);
        let stress_position = stress_node_positions(position, model.spacing);
        let list = previous
            .map(|geometry| geometry.list)
            .filter(|list| {
                let moved = |(now, then): (&Vec2, &Vec2)| (now - then).norm() > 0.5 * skin;
                !position.iter().zip(&list.reference).any(moved)
                    && list.from_stress.queries() == stress_position.len()
            })
            .filter(|list| list.sources_match(position, model.base_elevation, kernel.support() + 2.0 * skin))
            .unwrap_or_else(|| Lists {
                reference: position.to_vec(),
                from_stress: NeighbourList::build(
                    &stress_position,
                    &sources,
                    kernel.support(),
                    skin,
                    model.period,
                ),
                from_velocity: NeighbourList::build(position, &sources, kernel.support(), skin, model.period),
            });
        let stencils = Stencils { sources: &sources, volume, kernel, period: model.period };
        let (gradient, covariance, wall_table) = match model.numerics.operators {
            Operators::Conservative => {
                least_squares_tables(&stencils, &list.from_stress, &stress_position, wall)
            }
            Operators::Printed => printed_strain_tables(&stencils, &list.from_stress, &stress_position, wall),
        };
        let flow =
            model.water.is_some().then(|| flow_tables(model, &stencils, &list.from_velocity, position, wall));
        let printed = (model.numerics.operators == Operators::Printed)
            .then(|| printed_tables(model, &stencils, &list, position, &stress_position));
        let nodes = position.len();
        Self {
            gradient: Paired::new(gradient, nodes),
            covariance,
            wall: Paired::new(wall_table, nodes),
            flow,
            printed,
            list,
        }
    }

    /// Pairs between stress and velocity nodes, images folded.
    pub fn pairs(&self) -> usize {
        self.gradient.forward.entries()
    }

    /// Bytes of the weight tables.
    pub fn bytes(&self) -> usize {
        let flow = self
            .flow
            .as_ref()
            .map_or(0, |flow| flow.divergence.bytes() + flow.diffusion.as_ref().map_or(0, Csr::bytes));
        let printed = self.printed.as_ref().map_or(0, |tables| {
            let values = [&tables.interpolation, &tables.ghost_stress, &tables.mirror_stress];
            let vectors = [&tables.kernel_gradient, &tables.ghost_gradient, &tables.pressure_gradient];
            values.map(Csr::bytes).iter().sum::<usize>() + vectors.map(Csr::bytes).iter().sum::<usize>()
        });
        let covariance = size_of_val(self.covariance.as_slice());
        self.gradient.bytes() + self.wall.bytes() + covariance + flow + printed
    }
}

impl Lists {
    /// Whether the images are those the lists were made with (a node may have entered the wall's reach).
    fn sources_match(&self, position: &[Vec2], base: f64, reach: f64) -> bool {
        position
            .iter()
            .zip(&self.reference)
            .all(|(now, then)| (now.y - base < reach) == (then.y - base < reach))
    }
}

type StrainTables = (Csr<GradientWeight>, Vec<[f64; 3]>, Csr<WallWeight>);

/// Least-squares gradient, with the wall's share apart: images change the fit of each component differently.
fn least_squares_tables(
    stencils: &Stencils,
    list: &NeighbourList,
    points: &[Vec2],
    wall: Wall,
) -> StrainTables {
    let mut gradient = Csr::with_capacity(points.len(), list.pairs());
    let mut walls = Csr::with_capacity(points.len(), 0);
    let mut covariance = Vec::with_capacity(points.len());
    for (s, &at) in points.iter().enumerate() {
        let members = stencils.all(list, s, at);
        let real = real_only(&members);
        let mut row = Vec::with_capacity(real.len());
        let mut wall_row = Vec::new();
        // A detached grain (no plane neighbourhood) strains no more and carries no force.
        if let Ok(fit) = LeastSquaresFit::new(&real, stencils.kernel) {
            row.extend(real.iter().enumerate().map(|(k, m)| (m.owner, fit.weight(k, m))));
            let c = fit.covariance();
            covariance.push([c.m11, c.m12, c.m22]);
            if real.len() < members.len()
                && let Ok(full) = LeastSquaresFit::new(&members, stencils.kernel)
            {
                for (k, m) in members.iter().enumerate() {
                    let g = full.weight(k, m).gradient;
                    let seen = |parity: Parity| match (parity, m.mirrored) {
                        (Parity::Free, _) => Vec2::zeros(),
                        (_, false) => g,
                        (parity, true) => g * parity.sign(),
                    };
                    wall_row.push((m.owner, WallWeight { x: seen(wall.tangential), y: seen(wall.normal) }));
                }
                for (owner, weight) in &row {
                    let undone = |parity: Parity| {
                        if parity == Parity::Free { Vec2::zeros() } else { -weight.gradient }
                    };
                    let weight = WallWeight { x: undone(wall.tangential), y: undone(wall.normal) };
                    wall_row.push((*owner, weight));
                }
            }
        } else {
            covariance.push([0.0; 3]);
        }
        gradient.push_row(&mut row);
        walls.push_row(&mut wall_row);
    }
    (gradient, covariance, walls)
}

/// Eq. 8 with the corrected kernel gradient and the linear fit as value at the stress node.
fn printed_strain_tables(
    stencils: &Stencils,
    list: &NeighbourList,
    points: &[Vec2],
    wall: Wall,
) -> StrainTables {
    let mut gradient = Csr::with_capacity(points.len(), list.pairs());
    let mut walls = Csr::with_capacity(points.len(), 0);
    for (s, &at) in points.iter().enumerate() {
        let members = stencils.all(list, s, at);
        let (mut row, mut wall_row) = (Vec::new(), Vec::new());
        let corrected = corrected_gradient(&members, stencils.kernel);
        let fit = LeastSquaresFit::new(&members, stencils.kernel);
        if let (Ok(corrected), Ok(fit)) = (corrected, fit) {
            let total: Vec2 = corrected.iter().sum();
            for (k, (m, g)) in members.iter().zip(&corrected).enumerate() {
                let weight = g - total * fit.value_weight(k, m);
                if m.mirrored {
                    let image = |parity: Parity| weight * parity.sign();
                    wall_row.push((m.owner, WallWeight { x: image(wall.tangential), y: image(wall.normal) }));
                } else {
                    row.push((m.owner, GradientWeight { gradient: weight, share: 0.0 }));
                }
            }
        }
        gradient.push_row(&mut row);
        walls.push_row(&mut wall_row);
    }
    let covariance = vec![[0.0; 3]; points.len()];
    (gradient, covariance, walls)
}

/// Divergence and diffusion at velocity nodes (Eq. 7), images folded: velocity by the wall's parities, head even.
fn flow_tables(
    model: &Model,
    stencils: &Stencils,
    list: &NeighbourList,
    points: &[Vec2],
    wall: Wall,
) -> FlowTables {
    let mut divergence = Csr::with_capacity(points.len(), list.pairs());
    let mut diffusion = Csr::with_capacity(points.len(), list.pairs());
    let conductivity = |node: u32| model.regions[model.region[node as usize] as usize].hydraulic_conductivity;
    let drains = model.regions.iter().any(|region| region.hydraulic_conductivity > 0.0);
    // A component free of the wall has no image to be odd in: its own mirror keeps the row complete.
    let sign = |parity: Parity| if parity == Parity::Odd { -1.0 } else { 1.0 };
    let image = Vec2::new(sign(wall.tangential), sign(wall.normal));
    for (i, &at) in points.iter().enumerate() {
        let own = id(i);
        let members = stencils.all(list, i, at);
        let (mut row, mut head_row) = (Vec::new(), Vec::new());
        if let Ok(corrected) = corrected_gradient(&members, stencils.kernel) {
            let factor = laplacian_factor(&members, &corrected);
            // sum V x_ji D F~ of Eq. 7: zero on a full lattice, it keeps linear heads exact elsewhere.
            let first_moment: Vec2 = members.iter().zip(&factor).map(|(m, f)| m.offset * (2.0 * f)).sum();
            for ((m, g), f) in members.iter().zip(&corrected).zip(&factor) {
                let seen = if m.mirrored { g.component_mul(&image) } else { *g };
                row.push((m.owner, seen));
                row.push((own, -g));
                // The harmonic mean carries the flux across a contact of two soils exactly.
                let (k_i, k_j) = (conductivity(own), conductivity(m.owner));
                let k_mean = if k_i + k_j > 0.0 { 2.0 * k_i * k_j / (k_i + k_j) } else { 0.0 };
                let weight = 2.0 * k_mean * f - k_i * first_moment.dot(g);
                head_row.push((m.owner, weight));
                head_row.push((own, -weight));
            }
        }
        divergence.push_row(&mut row);
        diffusion.push_row(&mut head_row);
    }
    let mut divergence = Paired::new(divergence, points.len());
    divergence.transposed.scale_by_column(stencils.volume);
    FlowTables { divergence, diffusion: drains.then_some(diffusion) }
}

/// Tables of Eqs 6, 9, 10 and 11 as printed.
fn printed_tables(
    model: &Model,
    velocity: &Stencils,
    list: &Lists,
    points: &[Vec2],
    stress_points: &[Vec2],
) -> PrintedTables {
    let kernel = velocity.kernel;
    // Eq. 6 and Eq. 10 gather from stress nodes, each with half its velocity node's volume.
    let stress_volume: Vec<f64> =
        velocity.volume.iter().flat_map(|v| [v / STRESS_NODES as f64; STRESS_NODES]).collect();
    let stress_sources = sources(stress_points, model.base_elevation, kernel.support());
    let ghosts: Vec<u32> = stress_sources.iter().filter(|s| s.mirrored).map(|s| s.owner).collect();
    let ghost_of = |owner: u32| ghosts.binary_search(&owner).map_or(0, id);
    let to_stress = NeighbourList::build(points, &stress_sources, kernel.support(), 0.0, model.period);
    let stencils =
        Stencils { sources: &stress_sources, volume: &stress_volume, kernel, period: model.period };
    let mut tables = PrintedTables {
        interpolation: Csr::with_capacity(points.len(), to_stress.pairs()),
        kernel_gradient: Csr::with_capacity(points.len(), to_stress.pairs()),
        ghost_gradient: Csr::with_capacity(points.len(), 0),
        ghost_stress: Csr::with_capacity(ghosts.len(), 0),
        mirror_stress: Csr::with_capacity(ghosts.len(), 0),
        pressure_gradient: Csr::with_capacity(points.len(), list.from_velocity.pairs()),
    };
    for (i, &at) in points.iter().enumerate() {
        let members = stencils.all(&to_stress, i, at);
        let real = real_only(&members);
        let shares = interpolation(&real, kernel).unwrap_or_default();
        let mut row: Vec<_> = real.iter().zip(shares).map(|(m, share)| (m.owner, share)).collect();
        tables.interpolation.push_row(&mut row);
        let weigh = |m: &Member| kernel.gradient(m.offset) * m.volume;
        let mut row: Vec<_> = real.iter().map(|m| (m.owner, weigh(m))).collect();
        tables.kernel_gradient.push_row(&mut row);
        let mut row: Vec<_> =
            members.iter().filter(|m| m.mirrored).map(|m| (ghost_of(m.owner), weigh(m))).collect();
        tables.ghost_gradient.push_row(&mut row);

        let real = real_only(&velocity.all(&list.from_velocity, i, at));
        let fit = consistent_fit(&real, kernel).unwrap_or_default();
        let mut row: Vec<_> = real.iter().zip(fit).map(|(m, (_, gradient))| (m.owner, gradient)).collect();
        tables.pressure_gradient.push_row(&mut row);
    }
    for &ghost in &ghosts {
        let at = stress_points[ghost as usize];
        let beyond = Vec2::new(0.0, 2.0 * (model.base_elevation - at.y));
        let real = real_only(&velocity.all(&list.from_stress, ghost as usize, at));
        let fit = consistent_fit(&real, kernel).unwrap_or_default();
        let mut row: Vec<_> = real
            .iter()
            .zip(&fit)
            .map(|(m, (value, gradient))| (m.owner, value + beyond.dot(gradient)))
            .collect();
        tables.ghost_stress.push_row(&mut row);
        let mut row: Vec<_> = real.iter().zip(&fit).map(|(m, (value, _))| (m.owner, *value)).collect();
        tables.mirror_stress.push_row(&mut row);
    }
    tables
}

/// Gradient of Eq. 9 of a nodal field at the velocity nodes, unit of the field per m.
pub fn consistent_gradient(model: &Model, position: &[Vec2], volume: &[f64], field: &[f64]) -> Vec<Vec2> {
    let kernel = WendlandQuintic::new(model.smoothing_length());
    let sources = sources(position, f64::NEG_INFINITY, 0.0);
    let list = NeighbourList::build(position, &sources, kernel.support(), 0.0, model.period);
    let stencils = Stencils { sources: &sources, volume, kernel, period: model.period };
    position
        .iter()
        .enumerate()
        .map(|(i, &at)| {
            let members = stencils.all(&list, i, at);
            let fit = consistent_fit(&members, kernel).unwrap_or_default();
            members.iter().zip(fit).map(|(m, (_, gradient))| gradient * field[m.owner as usize]).sum()
        })
        .collect()
}

/// Linear least-squares weights of arbitrary points from nodes at `position`: rows are points.
pub fn point_weights(model: &Model, position: &[Vec2], points: &[Vec2]) -> Csr<f64> {
    let kernel = WendlandQuintic::new(model.smoothing_length());
    let volume = vec![0.0; position.len()];
    let sources = sources(position, f64::NEG_INFINITY, 0.0);
    let list = NeighbourList::build(points, &sources, kernel.support(), 0.0, model.period);
    let stencils = Stencils { sources: &sources, volume: &volume, kernel, period: model.period };
    let mut table = Csr::with_capacity(points.len(), list.pairs());
    for (k, &at) in points.iter().enumerate() {
        let members = stencils.all(&list, k, at);
        let mut row: Vec<_> = match LeastSquaresFit::new(&members, kernel) {
            Ok(fit) => members.iter().enumerate().map(|(k, m)| (m.owner, fit.value_weight(k, m))).collect(),
            // Beside too few nodes for a fit the nearest one speaks for the point.
            Err(_) => nearest(position, at).into_iter().collect(),
        };
        table.push_row(&mut row);
    }
    table
}

fn nearest(position: &[Vec2], at: Vec2) -> Option<(u32, f64)> {
    let distance = |x: &Vec2| (x - at).norm_squared();
    position
        .iter()
        .enumerate()
        .min_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)))
        .map(|(i, _)| (id(i), 1.0))
}
