//! Weight tables of the current geometry. They stay frozen while strains are small.

use crate::{
    balance,
    boundary::{Condition, Outline, Surroundings, Walls, id},
    conduction::Conduction,
    model::{Model, Operators, STRESS_NODES, stress_node_offset},
};
use sandboil_sph::{
    Csr, GradientWeight, LeastSquaresFit, Mat2, NeighbourList, Period, Vec2, WendlandQuintic,
    operators::{Member, consistent_fit, corrected_gradient, interpolation, stencil},
};
use std::{
    collections::BTreeMap,
    ops::{AddAssign, MulAssign},
};

/// Skin of the neighbour lists over the particle spacing: the lists survive displacements of half of it.
const SKIN: f64 = 0.3;

/// How the velocity `(v_x, v_y)` of a node enters the gradients of both components at a stress node, 1/m.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct VectorWeight {
    /// `grad v_x` is the sum of `x[0] v_x + x[1] v_y`.
    pub x: [Vec2; 2],
    /// `grad v_y` is the sum of `y[0] v_x + y[1] v_y`.
    pub y: [Vec2; 2],
}

impl VectorWeight {
    /// Each component by itself.
    pub fn plain(gradient: Vec2) -> Self {
        Self { x: [gradient, Vec2::zeros()], y: [Vec2::zeros(), gradient] }
    }

    /// One component by itself.
    pub fn of_component(component: usize, gradient: Vec2, map: Mat2) -> Self {
        let shown = [0, 1].map(|from| gradient * map[(component, from)]);
        let nothing = [Vec2::zeros(); 2];
        if component == 0 { Self { x: shown, y: nothing } } else { Self { x: nothing, y: shown } }
    }

    /// Largest of its parts, 1/m.
    pub fn magnitude(&self) -> f64 {
        self.x.iter().chain(&self.y).map(Vec2::amax).fold(0.0, f64::max)
    }

    /// Rows `grad v_x`, `grad v_y` of a node's velocity.
    #[inline]
    pub fn gradients(&self, v: Vec2) -> (Vec2, Vec2) {
        (self.x[0] * v.x + self.x[1] * v.y, self.y[0] * v.x + self.y[1] * v.y)
    }

    /// The force on the node of a nominal stress `[xx, xy, yx, yy]`: the transpose of the gradients, less the sign.
    #[inline]
    pub fn contract(&self, [xx, xy, yx, yy]: [f64; 4]) -> Vec2 {
        let (row_x, row_y) = (Vec2::new(xx, xy), Vec2::new(yx, yy));
        Vec2::new(
            self.x[0].dot(&row_x) + self.y[0].dot(&row_y),
            self.x[1].dot(&row_x) + self.y[1].dot(&row_y),
        )
    }
}

impl AddAssign for VectorWeight {
    fn add_assign(&mut self, other: Self) {
        for (own, more) in self.x.iter_mut().chain(&mut self.y).zip(other.x.into_iter().chain(other.y)) {
            *own += more;
        }
    }
}

impl MulAssign<f64> for VectorWeight {
    fn mul_assign(&mut self, factor: f64) {
        for own in self.x.iter_mut().chain(&mut self.y) {
            *own *= factor;
        }
    }
}

/// A table and its transpose: one gathers, the other gives the force back.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct Paired<T> {
    /// Rows gather.
    pub forward: Csr<T>,
    /// Rows collect what their column took part in.
    pub transposed: Csr<T>,
}

impl<T: Copy + AddAssign> Paired<T> {
    /// A table with so many columns, and its transpose.
    pub fn new(forward: Csr<T>, columns: usize) -> Self {
        let transposed = forward.transposed(columns);
        Self { forward, transposed }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.forward.bytes() + self.transposed.bytes()
    }
}

/// Tables that only a section with water has.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct FlowTables {
    /// `div v` at velocity nodes, component-wise weights with walls folded in (last term of Eq. 7). The
    /// transposed table is weighted with the row's volume: it is the pressure force.
    pub divergence: Paired<Vec2>,
}

/// Tables of the printed operators (Eqs 6, 10, 11).
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct PrintedTables {
    /// Stress at velocity nodes from stress nodes, Eq. 10.
    pub interpolation: Csr<f64>,
    /// `V_j grad_i W_ij` from velocity node to real stress nodes.
    pub kernel_gradient: Csr<Vec2>,
    /// The same to the mirrored stress nodes beyond the edges; columns index `ghost_stress` rows.
    pub ghost_gradient: Csr<Vec2>,
    /// Linear extrapolation of Eq. 11 from velocity nodes to mirrored stress nodes.
    pub ghost_stress: Csr<f64>,
    /// Value at the mirror point, from velocity nodes: the odd shear of the compliant base.
    pub mirror_stress: Csr<f64>,
    /// Gradient of Eq. 9 at velocity nodes, for the pore pressure.
    pub pressure_gradient: Csr<Vec2>,
    /// Whether a mirrored stress node lies below a base that carries no shear but the dashpots'.
    pub odd_shear: Vec<bool>,
}

/// All weights of one geometry.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Geometry {
    /// Gradient at stress nodes from velocity nodes, without walls.
    pub gradient: Paired<GradientWeight>,
    /// Position covariance `(xx, xy, yy)` of each stress node's stencil, m2: the filter's linear part.
    pub covariance: Vec<[f64; 3]>,
    /// What the images beyond base and sides add.
    pub wall: Paired<VectorWeight>,
    /// Flow tables, if there is water.
    pub flow: Option<FlowTables>,
    /// Tables of the printed operators, if chosen.
    pub printed: Option<PrintedTables>,
    /// Whether weights near the base were changed to bring stress into balance.
    pub is_balanced: bool,
    list: Lists,
}

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Lists {
    reference: Vec<Vec2>,
    /// Owners of the sources: a node may have entered an edge's reach since.
    owners: Vec<u32>,
    from_stress: NeighbourList,
    from_velocity: NeighbourList,
}

/// Whether a node has moved further than lists with a skin bear, m.
fn has_left((now, then): (&Vec2, &Vec2), skin: f64) -> bool {
    (now - then).norm() > 0.5 * skin
}

/// Positions of all stress nodes of the given velocity nodes (offsets do not rotate), m.
pub fn stress_node_positions(position: &[Vec2], spacing: Vec2) -> Vec<Vec2> {
    let offset = stress_node_offset(spacing);
    position.iter().flat_map(|&x| [x + offset, x - offset]).collect()
}

/// Stencils of one query kind, cut to the kernel's support.
pub struct Stencils<'a> {
    pub around: &'a Surroundings,
    pub volume: &'a [f64],
    pub kernel: WendlandQuintic,
    pub period: Option<Period>,
}

impl Stencils<'_> {
    /// The members around one query of a list.
    pub fn all(&self, list: &NeighbourList, query: usize, at: Vec2) -> Vec<Member> {
        stencil(list, query, at, &self.around.sources, self.volume, self.kernel, self.period)
    }

    /// Those of `members` that show the velocity component: the nodes, and images of which `shows` is true.
    fn showing(&self, members: &[Member], shows: impl Fn(&crate::boundary::Image) -> bool) -> Vec<Member> {
        members.iter().copied().filter(|m| self.around.image(m.source).is_none_or(&shows)).collect()
    }

    /// Velocity of a member from that of its node.
    pub fn map(&self, member: &Member) -> Mat2 {
        self.around.image(member.source).map_or_else(Mat2::identity, |image| image.map)
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
        (outline, walls): (&Outline, Walls),
        previous: Option<Self>,
    ) -> Self {
        let kernel = WendlandQuintic::new(model.smoothing_length());
        let skin = SKIN * model.mean_spacing();
        // The lists may be older than the images' cut-off, so images reach one skin further than the kernel.
        let around = Surroundings::new(position, outline, walls, kernel.support() + 2.0 * skin);
        let stress_position = stress_node_positions(position, model.spacing);
        let list = previous
            .map(|geometry| geometry.list)
            .filter(|list| {
                !position.iter().zip(&list.reference).any(|pair| has_left(pair, skin))
                    && list.from_stress.queries() == stress_position.len()
            })
            .filter(|list| list.owners.iter().copied().eq(around.owners()))
            .unwrap_or_else(|| {
                let list = |queries: &[Vec2]| {
                    NeighbourList::build(queries, &around.sources, kernel.support(), skin, model.period)
                };
                Lists {
                    reference: position.to_vec(),
                    owners: around.owners().collect(),
                    from_stress: list(&stress_position),
                    from_velocity: list(position),
                }
            });
        let stencils = Stencils { around: &around, volume, kernel, period: model.period };
        let (gradient, covariance, wall_table) = match model.numerics.operators {
            Operators::Conservative => least_squares_tables(&stencils, &list.from_stress, &stress_position),
            Operators::Printed => printed_strain_tables(&stencils, &list.from_stress, &stress_position),
        };
        let is_balanced = balance::is_needed(model, outline, walls);
        let wall_table = if is_balanced {
            let of_stress = (&list.from_stress, stress_position.as_slice());
            wall_table.with_more(balance::corrections(model, outline, &stencils, of_stress))
        } else {
            wall_table
        };
        let flow = model.water.is_some().then(|| flow_tables(&stencils, &list.from_velocity, position));
        let printed = (model.numerics.operators == Operators::Printed)
            .then(|| printed_tables(&stencils, &list, position, &stress_position, (outline, walls)));
        let nodes = position.len();
        Self {
            gradient: Paired::new(gradient, nodes),
            covariance,
            wall: Paired::new(wall_table, nodes),
            flow,
            printed,
            is_balanced,
            list,
        }
    }

    /// Lets strain and divergence see velocities beside those of the nodes, from index `nodes` on. No force goes back
    /// to them.
    pub fn see_guests(
        &mut self,
        strain: BTreeMap<usize, Vec<(u32, VectorWeight)>>,
        divergence: BTreeMap<usize, Vec<(u32, Vec2)>>,
    ) {
        self.wall.forward = self.wall.forward.with_more(strain);
        if let Some(flow) = &mut self.flow {
            flow.divergence.forward = flow.divergence.forward.with_more(divergence);
        }
    }

    /// Adds to the gradients at some stress nodes, and to the force that is their transpose.
    pub fn enhance(&mut self, more: BTreeMap<usize, Vec<(u32, VectorWeight)>>, nodes: usize) {
        self.wall = Paired::new(self.wall.forward.with_more(more), nodes);
    }

    /// Whether some node has left the skin of the lists.
    pub fn is_left(&self, model: &Model, position: &[Vec2]) -> bool {
        let skin = SKIN * model.mean_spacing();
        position.iter().zip(&self.list.reference).any(|pair| has_left(pair, skin))
    }

    /// Nodes listed near node `i`, itself among them, and how many periods to the right each stands; without images.
    pub fn nodes_near(&self, i: usize) -> impl Iterator<Item = (usize, f64)> {
        let nodes = self.list.reference.len();
        let near = self.list.from_velocity.of(i).iter();
        near.map(|pair| (pair.source as usize, f64::from(pair.wraps))).filter(move |(j, _)| *j < nodes)
    }

    /// Bounds of the largest squared wave numbers that strain and divergence see, 1/m2 (Gershgorin): how sharp the weights
    /// are. `volume` of the nodes, m2.
    pub fn sharpness(&self, volume: &[f64]) -> [f64; 2] {
        let half = |s: usize| volume[s / STRESS_NODES] / STRESS_NODES as f64;
        let strain = |s: usize| -> f64 {
            let free = self.gradient.forward.iter_row(s).map(|(_, weight)| weight.gradient.norm());
            free.sum::<f64>() + self.wall.forward.iter_row(s).map(|(_, w)| w.magnitude()).sum::<f64>()
        };
        let of_points: Vec<f64> = (0..self.gradient.forward.rows()).map(|s| half(s) * strain(s)).collect();
        let of_node = |j: usize| -> f64 {
            let free = self.gradient.transposed.iter_row(j).map(|(s, w)| w.gradient.norm() * of_points[s]);
            let walls = self.wall.transposed.iter_row(j).map(|(s, w)| w.magnitude() * of_points[s]);
            (free.sum::<f64>() + walls.sum::<f64>()) / volume[j]
        };
        let skeleton = (0..volume.len()).map(of_node).fold(0.0, f64::max);
        let water = self.flow.as_ref().map_or(0.0, |flow| {
            let reach: Vec<f64> = (0..volume.len())
                .map(|i| flow.divergence.forward.iter_row(i).map(|(_, w)| w.norm()).sum())
                .collect();
            // The transposed weights carry the volumes of their rows.
            let row = |j| flow.divergence.transposed.iter_row(j);
            let of_node = |j: usize| row(j).map(|(i, w)| w.norm() * reach[i]).sum::<f64>() / volume[j];
            (0..volume.len()).map(of_node).fold(0.0, f64::max)
        });
        [skeleton, water]
    }

    /// Pairs between stress and velocity nodes, images folded.
    pub fn pairs(&self) -> usize {
        self.gradient.forward.entries()
    }

    /// Bytes of the weight tables.
    pub fn bytes(&self) -> usize {
        let flow = self.flow.as_ref().map_or(0, |flow| flow.divergence.bytes());
        let printed = self.printed.as_ref().map_or(0, |tables| {
            let values = [&tables.interpolation, &tables.ghost_stress, &tables.mirror_stress];
            let vectors = [&tables.kernel_gradient, &tables.ghost_gradient, &tables.pressure_gradient];
            values.map(Csr::bytes).iter().sum::<usize>() + vectors.map(Csr::bytes).iter().sum::<usize>()
        });
        let covariance = size_of_val(self.covariance.as_slice());
        self.gradient.bytes() + self.wall.bytes() + covariance + flow + printed
    }
}

type StrainTables = (Csr<GradientWeight>, Vec<[f64; 3]>, Csr<VectorWeight>);

/// Gradient weights at a stress node: those of the nodes around it by themselves, the covariance of their places,
/// and what images change. Nothing for a detached grain (no plane neighbourhood): it strains no more and carries no
/// force.
pub struct StrainRow {
    /// Node and its weight, without images.
    pub free: Vec<(u32, GradientWeight)>,
    /// Position covariance `(xx, xy, yy)`, m2.
    pub covariance: [f64; 3],
    /// What images add for each node.
    pub walls: Vec<(u32, VectorWeight)>,
}

impl StrainRow {
    /// Least-squares gradient. Each velocity component is fitted to the nodes and to the images that show it.
    pub fn least_squares(stencils: &Stencils, members: &[Member]) -> Option<Self> {
        let real = real_only(members);
        let fit = LeastSquaresFit::new(&real, stencils.kernel).ok()?;
        let free: Vec<_> = real.iter().enumerate().map(|(k, m)| (m.owner, fit.weight(k, m))).collect();
        let c = fit.covariance();
        let mut walls = Vec::new();
        for component in [0, 1] {
            let seen = stencils.showing(members, |image| image.strain[component]);
            if seen.len() == real.len() {
                continue;
            }
            let Ok(full) = LeastSquaresFit::new(&seen, stencils.kernel) else { continue };
            walls.extend(seen.iter().enumerate().map(|(k, m)| {
                let gradient = full.weight(k, m).gradient;
                (m.owner, VectorWeight::of_component(component, gradient, stencils.map(m)))
            }));
            walls.extend(free.iter().map(|(owner, weight)| {
                (*owner, VectorWeight::of_component(component, -weight.gradient, Mat2::identity()))
            }));
        }
        Some(Self { free, covariance: [c.m11, c.m12, c.m22], walls })
    }
}

fn least_squares_tables(stencils: &Stencils, list: &NeighbourList, points: &[Vec2]) -> StrainTables {
    let mut gradient = Csr::with_capacity(points.len(), list.pairs());
    let mut walls = Csr::with_capacity(points.len(), 0);
    let mut covariance = Vec::with_capacity(points.len());
    for (s, &at) in points.iter().enumerate() {
        let row = StrainRow::least_squares(stencils, &stencils.all(list, s, at));
        let mut row = row.unwrap_or(StrainRow { free: Vec::new(), covariance: [0.0; 3], walls: Vec::new() });
        gradient.push_row(&mut row.free);
        walls.push_row(&mut row.walls);
        covariance.push(row.covariance);
    }
    (gradient, covariance, walls)
}

/// Eq. 8 with the corrected kernel gradient and the linear fit as value at the stress node.
fn printed_strain_tables(stencils: &Stencils, list: &NeighbourList, points: &[Vec2]) -> StrainTables {
    let mut gradient = Csr::with_capacity(points.len(), list.pairs());
    let mut walls = Csr::with_capacity(points.len(), 0);
    for (s, &at) in points.iter().enumerate() {
        let members =
            stencils.showing(&stencils.all(list, s, at), |image| image.strain[0] && image.strain[1]);
        let (mut row, mut wall_row) = (Vec::new(), Vec::new());
        let corrected = corrected_gradient(&members, stencils.kernel);
        let fit = LeastSquaresFit::new(&members, stencils.kernel);
        if let (Ok(corrected), Ok(fit)) = (corrected, fit) {
            let total: Vec2 = corrected.iter().sum();
            for (k, (m, g)) in members.iter().zip(&corrected).enumerate() {
                let weight = g - total * fit.value_weight(k, m);
                if m.mirrored {
                    let map = stencils.map(m);
                    wall_row.extend([0, 1].map(|c| (m.owner, VectorWeight::of_component(c, weight, map))));
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

/// Weights of the divergence at velocity node `own`, one component of the velocity after the other (last term of
/// Eq. 7): each from the nodes and the images that show it.
pub fn divergence_row(stencils: &Stencils, members: &[Member], own: u32) -> Vec<(u32, Vec2)> {
    let mut row = Vec::new();
    for component in [0, 1] {
        let seen = stencils.showing(members, |image| image.flow[component]);
        let Ok(corrected) = corrected_gradient(&seen, stencils.kernel) else { continue };
        for (m, g) in seen.iter().zip(&corrected) {
            let map = stencils.map(m);
            row.push((m.owner, Vec2::new(map[(component, 0)], map[(component, 1)]) * g[component]));
            let mut own_share = Vec2::zeros();
            own_share[component] = -g[component];
            row.push((own, own_share));
        }
    }
    row
}

/// Exchange of water in a section that does not deform.
pub fn static_conduction(model: &Model) -> Conduction {
    let kernel = WendlandQuintic::new(model.smoothing_length());
    let (position, walls) = (&model.position, Walls::statics(&model.outline));
    let around = Surroundings::new(position, &model.outline, walls, kernel.support());
    let stencils = Stencils { around: &around, volume: &model.volume, kernel, period: model.period };
    let directed = model.regions.iter().any(|region| !region.hydraulic_conductivity.is_isotropic());
    // Only anisotropic soil asks for gradients at stress nodes.
    let points = if directed { stress_node_positions(position, model.spacing) } else { Vec::new() };
    let list = NeighbourList::build(&points, &around.sources, kernel.support(), 0.0, model.period);
    let (gradient, _, _) = least_squares_tables(&stencils, &list, &points);
    Conduction::new(model, &stencils, &gradient, position, true)
}

/// Exchange of water in a section that has moved to `position`, with nodes of `volume` (m2); `geometry` is that of the place.
/// With `has_profile` the ground surface is that of the columns of the lattice.
pub fn conduction(
    model: &Model,
    geometry: &Geometry,
    position: &[Vec2],
    volume: &[f64],
    (outline, walls): (&Outline, Walls),
    has_profile: bool,
) -> Conduction {
    let kernel = WendlandQuintic::new(model.smoothing_length());
    let around = Surroundings::new(position, outline, walls, kernel.support());
    let stencils = Stencils { around: &around, volume, kernel, period: model.period };
    Conduction::new(model, &stencils, &geometry.gradient.forward, position, has_profile)
}

/// Divergence at velocity nodes (Eq. 7), images folded.
fn flow_tables(stencils: &Stencils, list: &NeighbourList, points: &[Vec2]) -> FlowTables {
    let mut divergence = Csr::with_capacity(points.len(), list.pairs());
    for (i, &at) in points.iter().enumerate() {
        divergence.push_row(&mut divergence_row(stencils, &stencils.all(list, i, at), id(i)));
    }
    let mut divergence = Paired::new(divergence, points.len());
    divergence.transposed.scale_by_column(stencils.volume);
    FlowTables { divergence }
}

/// Tables of Eqs 6, 9, 10 and 11 as printed.
fn printed_tables(
    velocity: &Stencils,
    list: &Lists,
    points: &[Vec2],
    stress_points: &[Vec2],
    (outline, walls): (&Outline, Walls),
) -> PrintedTables {
    let (kernel, period) = (velocity.kernel, velocity.period);
    // Eq. 6 and Eq. 10 gather from stress nodes, each with half its velocity node's volume.
    let stress_volume: Vec<f64> =
        velocity.volume.iter().flat_map(|v| [v / STRESS_NODES as f64; STRESS_NODES]).collect();
    let around = Surroundings::new(stress_points, outline, walls, kernel.support());
    let ghost_of = |source: u32| source - id(stress_points.len());
    let to_stress = NeighbourList::build(points, &around.sources, kernel.support(), 0.0, period);
    let stencils = Stencils { around: &around, volume: &stress_volume, kernel, period };
    let ghosts = &around.sources[stress_points.len()..];
    let mut tables = PrintedTables {
        interpolation: Csr::with_capacity(points.len(), to_stress.pairs()),
        kernel_gradient: Csr::with_capacity(points.len(), to_stress.pairs()),
        ghost_gradient: Csr::with_capacity(points.len(), 0),
        ghost_stress: Csr::with_capacity(ghosts.len(), 0),
        mirror_stress: Csr::with_capacity(ghosts.len(), 0),
        pressure_gradient: Csr::with_capacity(points.len(), list.from_velocity.pairs()),
        odd_shear: Vec::with_capacity(ghosts.len()),
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
        // Where an edge is left to tractions no stress goes on beyond it.
        let shown = stencils.showing(&members, |image| image.strain[0] || image.strain[1]);
        let mut row: Vec<_> =
            shown.iter().filter(|m| m.mirrored).map(|m| (ghost_of(m.source), weigh(m))).collect();
        tables.ghost_gradient.push_row(&mut row);

        let real = real_only(&velocity.all(&list.from_velocity, i, at));
        let fit = consistent_fit(&real, kernel).unwrap_or_default();
        let mut row: Vec<_> = real.iter().zip(fit).map(|(m, (_, gradient))| (m.owner, gradient)).collect();
        tables.pressure_gradient.push_row(&mut row);
    }
    for (ghost, image) in ghosts.iter().zip(&around.images) {
        let owner = ghost.owner as usize;
        let at = stress_points[owner];
        let beyond = ghost.position - at;
        let real = real_only(&velocity.all(&list.from_stress, owner, at));
        let fit = consistent_fit(&real, kernel).unwrap_or_default();
        let mut row: Vec<_> = real
            .iter()
            .zip(&fit)
            .map(|(m, (value, gradient))| (m.owner, value + beyond.dot(gradient)))
            .collect();
        tables.ghost_stress.push_row(&mut row);
        let mut row: Vec<_> = real.iter().zip(&fit).map(|(m, (value, _))| (m.owner, *value)).collect();
        tables.mirror_stress.push_row(&mut row);
        tables.odd_shear.push(image.below && walls.base == Condition::FreeSlip);
    }
    tables
}

/// Gradient of Eq. 9 of a nodal field at the velocity nodes, unit of the field per m.
pub fn consistent_gradient(model: &Model, position: &[Vec2], volume: &[f64], field: &[f64]) -> Vec<Vec2> {
    let kernel = WendlandQuintic::new(model.smoothing_length());
    let around = Surroundings::bare(position);
    let list = NeighbourList::build(position, &around.sources, kernel.support(), 0.0, model.period);
    let stencils = Stencils { around: &around, volume, kernel, period: model.period };
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
    let around = Surroundings::bare(position);
    let list = NeighbourList::build(points, &around.sources, kernel.support(), 0.0, model.period);
    let stencils = Stencils { around: &around, volume: &volume, kernel, period: model.period };
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

/// Value of the linear fit at every stress node, as weights of the nodes that sum to one. Beyond an edge that is held the
/// ground goes on as it is: images there count for their nodes.
pub fn stress_node_values(model: &Model, position: &[Vec2], (outline, walls): (&Outline, Walls)) -> Csr<f64> {
    let kernel = WendlandQuintic::new(model.smoothing_length());
    let points = stress_node_positions(position, model.spacing);
    let around = Surroundings::new(position, outline, walls, kernel.support());
    let list = NeighbourList::build(&points, &around.sources, kernel.support(), 0.0, model.period);
    let volume = vec![0.0; position.len()];
    let stencils = Stencils { around: &around, volume: &volume, kernel, period: model.period };
    let mut table = Csr::with_capacity(points.len(), list.pairs());
    for (s, &at) in points.iter().enumerate() {
        let members =
            stencils.showing(&stencils.all(&list, s, at), |image| image.strain[0] && image.strain[1]);
        let mut row: Vec<_> = match LeastSquaresFit::new(&members, kernel) {
            Ok(fit) => members.iter().enumerate().map(|(k, m)| (m.owner, fit.value_weight(k, m))).collect(),
            // A detached grain keeps its mass.
            Err(_) => vec![(id(s / STRESS_NODES), 1.0)],
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
