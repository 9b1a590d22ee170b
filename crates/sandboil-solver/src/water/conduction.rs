//! Darcy's law between nodes: `div (k grad H)` of Eqs 3 and 7 as an exchange of water.
//!
//! Of a tensor `k = k_minor I + (k_major - k_minor) m m^T` the isotropic part passes between pairs of nodes, by the pair
//! factors of Eq. 7 with the harmonic mean of the conductivities on the way, which carries a flux across a contact of two
//! soils exactly.
//! What the major direction `m` conducts beyond that follows the gradient at the stress nodes. Both parts are symmetric
//! and positive: what one node loses another gains, a uniform head moves nothing, and no ratio of the conductivities
//! makes heads grow. (Eq. 7's own factor `e.(4 k - tr k I).e` turns negative where `k_major > 3 k_minor`, and
//! heads between rows grow from a ratio of about twelve.) Nothing crosses an edge or the ground surface by itself: images
//! beyond them show the head of their node, which keeps the conduction along them whole.

use crate::{
    section::{
        bins::Bins,
        description::{Model, STRESS_NODES},
        node_id::id,
        outline::{Outline, Walls, nearest_on},
    },
    weights::{
        geometry::Geometry,
        images::{Crossing, Image, Surroundings},
        points::stress_node_positions,
        rows::{Paired, least_squares_tables},
        stencils::Stencils,
    },
};
use sandboil_sph::{
    Csr, NeighbourList, Vec2, WendlandQuintic,
    operators::{GradientWeight, corrected_gradient, laplacian_factor},
};

/// Exchange of water between the nodes of a section, and with what stands beyond its edges.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Conduction {
    /// Inflow of a node from another per metre of head, m/s: symmetric.
    pairs: Csr<f64>,
    /// Pairs of a node with the image of another, or of itself.
    beyond: Vec<Beyond>,
    /// What stress nodes add in anisotropic soil.
    along: Option<Along>,
}

/// A node and an image that it sees.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Beyond {
    /// The node that sees.
    pub node: u32,
    /// The owner of the image.
    pub owner: u32,
    /// Inflow per metre of head, m/s, while nothing crosses the edge.
    pub closed: f64,
    /// The same where the head on the edge is prescribed: by the conductivity across the edge.
    pub open: f64,
    /// The edge between the owner and its image, two at a corner.
    pub crossings: [Option<Crossing>; 2],
    /// Whether the edge is the ground surface.
    pub at_surface: bool,
}

/// What a node sees of the head beyond an edge: `sign` times that of the pair's owner, exchanged by `strength`, m/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Across {
    /// Exchange, m/s.
    pub strength: f64,
    /// 1 where nothing crosses the edge, -1 where a head stands on it.
    pub sign: f64,
}

/// Conduction along the major direction at stress nodes, beyond the isotropic part.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Along {
    /// `V (k_major - k_minor)` of each stress node, m3/s per m.
    strength: Vec<f64>,
    /// Weights of the head's derivative along the major direction, 1/m.
    derivative: Paired<f64>,
}

/// Entries of a matrix that is being built, row by row.
pub type Rows = Vec<Vec<(u32, f64)>>;
impl Conduction {
    /// Tables of a geometry: stencils of the nodes at `points`, gradients at their stress nodes. With `has_profile` the
    /// ground surface is an edge, that of the columns of the lattice.
    pub fn new(
        model: &Model,
        stencils: &Stencils,
        gradient: &Csr<GradientWeight>,
        points: &[Vec2],
        has_profile: bool,
    ) -> Self {
        let support = stencils.kernel.support();
        let around = if has_profile {
            with_surface(model, stencils.around, points, support)
        } else {
            stencils.around.clone()
        };
        let list = NeighbourList::build(points, &around.sources, support, 0.0, model.period);
        let edge_images = stencils.around.images.len();
        let stencils = Stencils { around: &around, ..*stencils };
        let conductivity = |node: usize| model.regions[model.region[node] as usize].hydraulic_conductivity;
        // One soil needs no search.
        let bins = model
            .regions
            .windows(2)
            .any(|pair| pair[0].hydraulic_conductivity.minor != pair[1].hydraulic_conductivity.minor)
            .then(|| Bins::new(points, model.spacing.x.max(model.spacing.y)));
        let mean = |i: usize, j: usize, offset: Vec2| {
            let harmonic =
                |k: f64, other: f64| if k + other > 0.0 { 2.0 * k * other / (k + other) } else { 0.0 };
            let ends = [i, j].map(|node| conductivity(node).minor);
            let Some(bins) = bins.as_ref().filter(|_| ends[0] > 0.0 && ends[1] > 0.0) else {
                return harmonic(ends[0], ends[1]);
            };
            let resistance = |sample: u32| {
                let at = points[i] + offset * ((f64::from(sample) + 0.5) / f64::from(PATH_SAMPLES));
                bins.nearest(points, at, |_| true).map_or(0.0, |node| conductivity(node).minor).recip()
            };
            f64::from(PATH_SAMPLES) / (0..PATH_SAMPLES).map(resistance).sum::<f64>()
        };
        let mut one_sided = Csr::with_capacity(points.len(), list.pairs());
        let mut beyond = Vec::new();
        for (i, &at) in points.iter().enumerate() {
            let members = stencils.all(&list, i, at);
            let mut row = Vec::new();
            if let Ok(corrected) = corrected_gradient(&members, stencils.kernel) {
                for (m, factor) in members.iter().zip(laplacian_factor(&members, &corrected)) {
                    let j = m.owner as usize;
                    let strength = 2.0 * stencils.volume[i] * factor;
                    match (m.source as usize).checked_sub(points.len()) {
                        None if j == i => {}
                        None => row.push((m.owner, 0.5 * strength * mean(i, j, m.offset))),
                        Some(image) => {
                            let strength = strength * mean(i, j, points[j] - points[i]);
                            let crossings = around.crossings[image];
                            let at_surface = image >= edge_images;
                            let k = conductivity(j);
                            let across = crossings[0].map_or(k.direction, |crossing| crossing.normal);
                            let ratio = across.dot(&(k.tensor() * across)) / k.minor;
                            // The image of `i` that `j` sees is the other half of the pair.
                            let halves = if j == i {
                                [(id(i), 1.0), (id(i), 0.0)]
                            } else {
                                [(id(i), 0.5), (m.owner, 0.5)]
                            };
                            for ((node, share), owner) in halves.into_iter().zip([m.owner, id(i)]) {
                                let closed = share * strength.max(0.0);
                                if closed > 0.0 {
                                    let open = closed * ratio;
                                    beyond.push(Beyond { node, owner, closed, open, crossings, at_surface });
                                }
                            }
                        }
                    }
                }
            }
            one_sided.push_row(&mut row);
        }
        let other_sided = one_sided.transposed(points.len());
        let mut pairs = Csr::with_capacity(points.len(), one_sided.entries());
        for i in 0..points.len() {
            let both = one_sided.iter_row(i).chain(other_sided.iter_row(i));
            pairs.push_row(&mut both.map(|(j, half)| (id(j), *half)).collect::<Vec<_>>());
        }
        // In a ragged corner the corrected kernel may point backwards; water never flows uphill.
        pairs.map_values(|strength| strength.max(0.0));
        let anisotropic = model.regions.iter().any(|region| !region.hydraulic_conductivity.is_isotropic());
        let along = anisotropic.then(|| {
            let mut derivative = Csr::with_capacity(gradient.rows(), gradient.entries());
            let mut strength = Vec::with_capacity(gradient.rows());
            for s in 0..gradient.rows() {
                let k = conductivity(s / STRESS_NODES);
                let excess = k.major - k.minor;
                strength.push(excess * stencils.volume[s / STRESS_NODES] / STRESS_NODES as f64);
                let mut row: Vec<_> = if excess > 0.0 {
                    gradient
                        .iter_row(s)
                        .map(|(j, weight)| (id(j), weight.gradient.dot(&k.direction)))
                        .collect()
                } else {
                    Vec::new()
                };
                derivative.push_row(&mut row);
            }
            Along { strength, derivative: Paired::new(derivative, points.len()) }
        });
        Self { pairs, beyond, along }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let along = self
            .along
            .as_ref()
            .map_or(0, |along| along.derivative.bytes() + size_of_val(along.strength.as_slice()));
        self.pairs.bytes() + size_of_val(self.beyond.as_slice()) + along
    }

    /// What nodes see beyond the edges.
    pub fn beyond(&self) -> &[Beyond] {
        &self.beyond
    }

    /// Exchange between pairs, each with the factor `of_pair` (relative conductivity): inflow of node `i` is
    /// `sum_j a_ij H_j`, m/s.
    pub fn pair_rows(&self, of_pair: impl Fn(usize, usize) -> f64) -> Rows {
        (0..self.pairs.rows())
            .map(|i| {
                let mut own = 0.0;
                let mut row: Vec<(u32, f64)> = self
                    .pairs
                    .iter_row(i)
                    .map(|(j, strength)| {
                        let exchange = strength * of_pair(i, j);
                        own -= exchange;
                        (id(j), exchange)
                    })
                    .collect();
                row.push((id(i), own));
                row
            })
            .collect()
    }

    /// Adds to the inflow of every node (m2/s) what follows the gradient of the head at stress nodes, each with the
    /// factor `of_point`.
    pub fn flow_along(&self, head: &[f64], of_point: impl Fn(usize) -> f64, inflow: &mut [f64]) {
        let Some(Along { strength, derivative }) = &self.along else { return };
        let flux: Vec<f64> = (0..strength.len())
            .map(|s| {
                let slope: f64 = derivative.forward.iter_row(s).map(|(j, w)| w * head[j]).sum();
                strength[s] * of_point(s) * slope
            })
            .collect();
        for (j, inflow) in inflow.iter_mut().enumerate() {
            *inflow -= derivative.transposed.iter_row(j).map(|(s, w)| w * flux[s]).sum::<f64>();
        }
    }

    /// Whether the conductivity has a direction anywhere.
    pub fn has_direction(&self) -> bool {
        self.along.is_some()
    }

    /// The same as entries of a matrix.
    fn add_along(&self, of_point: impl Fn(usize) -> f64, rows: &mut Rows) {
        let Some(Along { strength, derivative }) = &self.along else { return };
        for (j, row) in rows.iter_mut().enumerate() {
            for (s, own) in derivative.transposed.iter_row(j) {
                let scale = -strength[s] * of_point(s) * own;
                row.extend(derivative.forward.iter_row(s).map(|(k, w)| (id(k), scale * w)));
            }
        }
    }

    /// The exchange of soil that loses water through a free surface alone: `leaks` per metre of head of each node, m/s.
    /// Nothing passes the nodes that are `shut`.
    pub fn leaking(&self, leaks: &[f64], shut: impl Fn(usize) -> bool) -> Csr<f64> {
        let open = |i: usize, j: usize| if shut(i) || shut(j) { 0.0 } else { 1.0 };
        let mut rows = self.pair_rows(open);
        let along = |s: usize| {
            let mut seen = self.along.iter().flat_map(|along| along.derivative.forward.iter_row(s));
            if seen.any(|(node, _)| shut(node)) { 0.0 } else { 1.0 }
        };
        self.add_along(along, &mut rows);
        for pair in &self.beyond {
            let strength = pair.closed * open(pair.node as usize, pair.owner as usize);
            let row = &mut rows[pair.node as usize];
            row.push((pair.owner, strength));
            row.push((pair.node, -strength));
        }
        for (node, leak) in leaks.iter().enumerate() {
            rows[node].push((id(node), -leak * open(node, node)));
        }
        collected(rows)
    }

    /// The whole exchange of soil with the relative conductivities of its nodes, m/s; none: saturated. `across` gives the
    /// exchange beyond the edges, by the index of [`Conduction::beyond`].
    pub fn exchange(&self, relative: Option<&[f64]>, across: impl Fn(usize) -> Across) -> Csr<f64> {
        let mut rows = self.pair_rows(|i, j| relative.map_or(1.0, |relative| between(relative, i, j)));
        self.add_along(|s| relative.map_or(1.0, |relative| relative[s / STRESS_NODES]), &mut rows);
        for (k, pair) in self.beyond.iter().enumerate() {
            let Across { strength, sign } = across(k);
            let row = &mut rows[pair.node as usize];
            row.push((pair.owner, sign * strength));
            row.push((pair.node, -strength));
        }
        collected(rows)
    }
}

/// Relative conductivity between two nodes: their mean, which places a wetting front within a spacing, where that of
/// the wetter one lets it run ahead.
pub fn between(relative: &[f64], i: usize, j: usize) -> f64 {
    0.5 * (relative[i] + relative[j])
}

/// Places on the way between two nodes at which the soil is looked up: on a lattice they measure the parts of the way on
/// both sides of a contact exactly.
pub const PATH_SAMPLES: u32 = 8;
/// Distance in x up to which two nodes stand in one column, in spacings.
pub const SAME_COLUMN: f64 = 0.5;
/// Nodes and images as they are, and all of them once more beyond the ground surface.
pub fn with_surface(model: &Model, around: &Surroundings, points: &[Vec2], reach: f64) -> Surroundings {
    // The ground goes with the uppermost node of each column.
    let mut profile: Vec<Vec2> = (0..points.len())
        .map(|node| (points[node], model.surface_elevation[node], model.position[node]))
        .filter(|(_, top, start)| top - start.y < model.spacing.y)
        .map(|(at, top, start)| Vec2::new(at.x, top + (at.y - start.y)))
        .collect();
    profile.sort_by(|a, b| a.x.total_cmp(&b.x).then(b.y.total_cmp(&a.y)));
    // One point for each column of the lattice: between them the ground is straight.
    profile.dedup_by(|next, kept| next.x - kept.x < SAME_COLUMN * model.spacing.x);
    if let [only] = profile[..] {
        profile.push(only + Vec2::new(model.spacing.x, 0.0));
    }
    let mut complete = around.clone();
    for (k, source) in around.sources.iter().enumerate() {
        let own = points[source.owner as usize];
        let (Some((foot, below)), Some((own_foot, normal))) =
            (nearest_on(&profile, source.position), nearest_on(&profile, own))
        else {
            continue;
        };
        let depth = (source.position - foot).dot(&below);
        if depth > 0.0 && depth < reach {
            let image = around.image(id(k)).copied().unwrap_or(Image::WHOLE);
            // What is seen beyond a corner crosses the surface where its node does.
            let side = k.checked_sub(points.len()).and_then(|image| around.crossings[image][0]);
            let surface = Some(Crossing { foot: own_foot, normal });
            complete.add(source.owner, 2.0 * foot - source.position, image, [surface, side]);
        }
    }
    complete
}

/// The table of rows.
pub fn collected(rows: Rows) -> Csr<f64> {
    let mut matrix = Csr::with_capacity(rows.len(), rows.iter().map(Vec::len).sum());
    for mut row in rows {
        matrix.push_row(&mut row);
    }
    matrix
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
