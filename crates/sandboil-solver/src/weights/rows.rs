//! Rows of weights: gradients at stress nodes and the divergence at velocity nodes.

use crate::weights::stencils::{Stencils, real_only};
use sandboil_sph::{
    Csr, GradientWeight, LeastSquaresFit, Mat2, NeighbourList, Vec2,
    operators::{Member, corrected_gradient},
};
use std::ops::{AddAssign, MulAssign};

/// How the velocity `(v_x, v_y)` of a node enters the gradients of both components at a stress node, 1/m.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct VectorWeight {
    /// `grad v_x` is the sum of `x[0] v_x + x[1] v_y`.
    pub x: [Vec2; 2],
    /// `grad v_y` is the sum of `y[0] v_x + y[1] v_y`.
    pub y: [Vec2; 2],
}

impl VectorWeight {
    /// The same gradient weight for each component, without coupling.
    pub fn plain(gradient: Vec2) -> Self {
        Self { x: [gradient, Vec2::zeros()], y: [Vec2::zeros(), gradient] }
    }

    /// The weight of an image in the gradient of one component; `map` gives the image's velocity from that of
    /// its node.
    pub fn of_component(component: usize, gradient: Vec2, map: Mat2) -> Self {
        let shown = [0, 1].map(|from| gradient * map[(component, from)]);
        let nothing = [Vec2::zeros(); 2];
        if component == 0 { Self { x: shown, y: nothing } } else { Self { x: nothing, y: shown } }
    }

    /// Largest component, 1/m.
    pub fn magnitude(&self) -> f64 {
        self.x.iter().chain(&self.y).map(Vec2::amax).fold(0.0, f64::max)
    }

    /// Rows `grad v_x`, `grad v_y` of a node's velocity.
    #[inline]
    pub fn gradients(&self, v: Vec2) -> (Vec2, Vec2) {
        (self.x[0] * v.x + self.x[1] * v.y, self.y[0] * v.x + self.y[1] * v.y)
    }

    /// The force of a nominal stress `[xx, xy, yx, yy]` on the node, with the opposite sign: the transpose of
    /// the gradients.
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
        for (sum, term) in self.x.iter_mut().chain(&mut self.y).zip(other.x.into_iter().chain(other.y)) {
            *sum += term;
        }
    }
}

impl MulAssign<f64> for VectorWeight {
    fn mul_assign(&mut self, factor: f64) {
        for component in self.x.iter_mut().chain(&mut self.y) {
            *component *= factor;
        }
    }
}

/// A table and its transpose: the first gathers velocities, the second forces.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct Paired<T> {
    /// Each row gathers from the columns.
    pub forward: Csr<T>,
    /// Its rows are the columns of `forward`.
    pub transposed: Csr<T>,
}

impl<T: Copy + AddAssign> Paired<T> {
    /// A table with a number of columns, and its transpose.
    pub fn new(forward: Csr<T>, columns: usize) -> Self {
        let transposed = forward.transposed(columns);
        Self { forward, transposed }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.forward.bytes() + self.transposed.bytes()
    }
}

/// Gradient weights, position covariances (m2) and additional weights by images of all stress nodes.
pub type StrainTables = (Csr<GradientWeight>, Vec<[f64; 3]>, Csr<VectorWeight>);

/// Gradient weights at a stress node: those of the nodes around it without images, the covariance of their
/// positions, and the changes by images. In a corner of two edges the nodes span the plane only with their images. Where
/// neighbours do not span it otherwise, as nodes that have left the ground, there is no row: no strain and no force from
/// stress.
pub struct StrainRow {
    /// Node and its weight, without images.
    pub free: Vec<(u32, GradientWeight)>,
    /// Position covariance `(xx, xy, yy)`, m2.
    pub covariance: [f64; 3],
    /// Additional weights of the nodes by images.
    pub walls: Vec<(u32, VectorWeight)>,
}

impl StrainRow {
    /// Least-squares gradient. Each velocity component is fitted to the nodes and to the images that have it.
    pub fn least_squares(stencils: &Stencils, members: &[Member]) -> Option<Self> {
        let real = real_only(members);
        let (mut free, mut covariance) = (Vec::new(), [0.0; 3]);
        if let Ok(fit) = LeastSquaresFit::new(&real, stencils.kernel) {
            free.extend(real.iter().enumerate().map(|(k, m)| (m.owner, fit.weight(k, m))));
            let c = fit.covariance();
            covariance = [c.m11, c.m12, c.m22];
        } else if !members.iter().any(|m| stencils.around.is_beyond_corner(m.source)) {
            return None;
        }
        let mut walls = Vec::new();
        for component in [0, 1] {
            let seen = stencils.including(members, |image| image.strain[component]);
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
        (!free.is_empty() || !walls.is_empty()).then_some(Self { free, covariance, walls })
    }
}

pub fn least_squares_tables(stencils: &Stencils, list: &NeighbourList, points: &[Vec2]) -> StrainTables {
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

/// Weights of the divergence at velocity node `own` (last term of Eq. 7). Each velocity component is gathered
/// from the nodes and from the images that have it.
pub fn divergence_row(stencils: &Stencils, members: &[Member], own: u32) -> Vec<(u32, Vec2)> {
    let mut row = Vec::new();
    for component in [0, 1] {
        let seen = stencils.including(members, |image| image.flow[component]);
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
