//! Dispersion-corrected inertia: short waves are as fast as long ones, to fourth order in the wave number.
//!
//! The least-squares gradient `g` of a wave `k` is too small, `|g|^2 = k^2 (1 - b k^2)`, and so is the
//! stiffness. Let `D = M^-1 K_1` be the operator of an elastic skeleton whose shear and compression waves
//! have unit speed, made of the same gradient and its transpose. With the acceleration `(1 + b D) M^-1 F`
//! squared frequencies are `c^2 |g|^2 (1 + b |g|^2) = c^2 k^2 (1 + O(k^4))`. `D` is symmetric with respect to
//! the masses, positive, and zero for rigid motion. The inertia `M (1 + b D)^-1` is therefore symmetric and
//! positive: energy stays bounded for any behaviour of the soil, and forces conserve linear and angular
//! momentum as before.

use crate::{
    edges::dashpots::{Dashpot, Dashpots},
    parallel::{Rows, chunks, for_each_chunk},
    section::{
        description::{Model, Operators, stress_node_offset},
        node_id::id,
    },
    skeleton::{point::StressPoint, strain_and_force::motion},
    weights::{geometry::Geometry, lattice::lattice},
};
use sandboil_sph::{Csr, LeastSquaresFit, Vec2, WendlandQuintic};
use std::collections::BTreeMap;

/// The correction in a stage.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct Dispersion {
    /// `b`, m2.
    coefficient: f64,
    /// Flux at every stress node, from which `b M D` is summed.
    flux: Vec<Flux>,
}

/// Stress `(xx, xy)` of `K_1` times volume and `b`, kN. With unit speeds Lame's constants are `mu = rho`,
/// `lambda = -rho`, so that only changes of shape matter: `xx = -yy = rho (a_x,x - a_y,y)` and `xy = rho
/// (a_x,y + a_y,x)`.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
struct Flux {
    normal: f64,
    shear: f64,
}

impl Flux {
    /// From the rows of the acceleration gradient; `scale` is `b` times mass, Mg/m m2.
    #[inline]
    fn new(x: Vec2, y: Vec2, scale: f64) -> Self {
        Self { normal: scale * (x.x - y.y), shear: scale * (x.y + y.x) }
    }

    /// As `[xx, xy, yx, yy]`.
    #[inline]
    fn tensor(self) -> [f64; 4] {
        [self.normal, self.shear, self.shear, -self.normal]
    }

    /// Force by a gradient weight without images, kN/m.
    #[inline]
    fn through(self, g: Vec2) -> Vec2 {
        Vec2::new(self.normal * g.x + self.shear * g.y, self.shear * g.x - self.normal * g.y)
    }
}

/// `b` on the undeformed lattice, m2, for waves along an axis, from the third moments of the stencil and from
/// the second moments, which are not zero away from the lattice's centres of symmetry. The mean of both axes
/// is used; on a square lattice `b` of every other direction is within a hundredth of it.
fn coefficient(model: &Model) -> f64 {
    let kernel = WendlandQuintic::new(model.smoothing_length());
    let at = match model.numerics.operators {
        Operators::Dual => 0.5 * model.spacing,
        Operators::Conservative | Operators::Printed => stress_node_offset(model.spacing),
    };
    let members = lattice(model, at);
    // With a kernel too narrow for a fit there is no strain, and nothing to correct.
    let Ok(fit) = LeastSquaresFit::new(&members, kernel) else { return 0.0 };
    let lost = |axis: Vec2| {
        let (mut second, mut third) = (Vec2::zeros(), 0.0);
        for (k, member) in members.iter().enumerate() {
            let (g, x) = (fit.weight(k, member).gradient, member.offset.dot(&axis));
            second += g * (x * x);
            third += g.dot(&axis) * x * x * x;
        }
        third / 3.0 - 0.25 * second.norm_squared()
    };
    0.5 * (lost(Vec2::x()) + lost(Vec2::y()))
}

/// Masses of the nodes, Mg/m: the mass of each stress node is distributed by the weights of the fit's value
/// there. These masses are consistent with the operator for rows beside an edge or a contact; inside the
/// ground they are the nodes' own masses.
pub fn lumped_masses(value: &Csr<f64>, points: &[StressPoint], nodes: usize) -> Vec<f64> {
    let mut mass = vec![0.0; nodes];
    for (s, point) in points.iter().enumerate() {
        for (j, weight) in value.iter_row(s) {
            mass[j] += weight * point.density * point.volume;
        }
    }
    mass
}

impl Dispersion {
    /// The correction of `points` stress nodes.
    pub fn new(model: &Model, points: usize) -> Self {
        Self { coefficient: coefficient(model), flux: vec![Flux::default(); points] }
    }

    /// `b`, m2.
    #[cfg(test)]
    pub fn coefficient(&self) -> f64 {
        self.coefficient
    }

    /// Gathers the accelerations of the nodes without correction, m/s2.
    pub fn gather(
        &mut self,
        threaded: bool,
        geometry: &Geometry,
        points: &[StressPoint],
        acceleration: &[Vec2],
    ) {
        let coefficient = self.coefficient;
        let mut unit = (vec![(); points.len()], vec![(); points.len()], vec![(); chunks(points.len())]);
        let rows = Rows { a: &mut self.flux, b: &mut unit.0, c: &mut unit.1 };
        for_each_chunk(threaded, rows, &mut unit.2, |first, rows, ()| {
            for (k, flux) in rows.a.iter_mut().enumerate() {
                let mass = points[first + k].density * points[first + k].volume;
                let (x, y) = motion(geometry, first + k, acceleration).gradient();
                *flux = Flux::new(x, y, coefficient * mass);
            }
        });
    }

    /// Correction of the acceleration of velocity node `j`, m/s2.
    #[inline]
    pub fn acceleration(&self, geometry: &Geometry, j: usize, mass: f64) -> Vec2 {
        let mut sum = Vec2::zeros();
        for (s, weight) in geometry.gradient.transposed.iter_row(j) {
            sum += self.flux[s].through(weight.gradient);
        }
        for (s, weight) in geometry.wall.transposed.iter_row(j) {
            sum += weight.contract(self.flux[s].tensor());
        }
        sum / mass
    }

    /// Correction of the accelerations by a unit force of each dashpot, 1/Mg. The tractions of dashpots are
    /// found after all other forces have acted.
    pub fn spread(
        &self,
        geometry: &Geometry,
        points: &[StressPoint],
        mass: &[f64],
        dashpots: &Dashpots,
    ) -> Csr<Vec2> {
        let mut table = Csr::with_capacity(dashpots.all().len(), 0);
        let (gradient, wall) = (&geometry.gradient, &geometry.wall);
        for Dashpot { point, direction, .. } in dashpots.all() {
            let mut slopes = BTreeMap::<usize, (Vec2, Vec2)>::new();
            let mut take = |s: usize, (x, y): (Vec2, Vec2)| {
                let slope = slopes.entry(s).or_default();
                slope.0 += x;
                slope.1 += y;
            };
            for (j, weight) in dashpots.trace().iter_row(*point) {
                let pushed = direction * (weight / mass[j]);
                for (s, weight) in gradient.transposed.iter_row(j) {
                    take(s, (weight.gradient * pushed.x, weight.gradient * pushed.y));
                }
                for (s, weight) in wall.transposed.iter_row(j) {
                    take(s, weight.gradients(pushed));
                }
            }
            let mut row = Vec::new();
            for (s, (x, y)) in slopes {
                let flux = Flux::new(x, y, self.coefficient * points[s].density * points[s].volume);
                for (j, weight) in gradient.forward.iter_row(s) {
                    row.push((id(j), flux.through(weight.gradient) / mass[j]));
                }
                for (j, weight) in wall.forward.iter_row(s) {
                    row.push((id(j), weight.contract(flux.tensor()) / mass[j]));
                }
            }
            table.push_row(&mut row);
        }
        table
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.flux.as_slice())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::{
        run::time_step::{
            CORRECTED_FILTER, CORRECTED_RESPONSE, DRAINED_COEFFICIENT, DUAL_CORRECTED_RESPONSE,
            DUAL_DRAINED_COEFFICIENT, FILTER_EIGENVALUE,
        },
        section::{
            description::STRESS_NODES,
            outline::{Condition, EdgesView, Outline, Side, Support, Walls},
            stress_layout::StressLayout,
        },
        skeleton::{
            contacts::Contacts,
            spectrum_tests::{SHEAR, disordered, filter_matrix},
        },
        testing::square_block,
        weights::points::stress_node_values,
    };
    use nalgebra::{DMatrix, DVector};

    /// The operators and masses of a block of unit volumes.
    pub(crate) struct Block {
        pub geometry: Geometry,
        pub points: Vec<StressPoint>,
        pub mass: Vec<f64>,
        coefficient: f64,
    }

    impl Block {
        /// A block of one density; `moduli` are the shear moduli and confined moduli of the regions.
        pub fn new(model: &Model, walls: Walls, moduli: &[[f64; 2]], density: f64) -> Self {
            let edges = EdgesView { outline: &model.outline, walls };
            let nodes = model.nodes();
            let mut geometry = Geometry::build(model, &model.position, &vec![1.0; nodes], edges);
            let layout = StressLayout::new(model);
            let point = |s: usize| {
                let [shear_modulus, stiffness] = moduli[layout.region(model, s)];
                let volume = layout.volume(s, &vec![1.0; nodes]);
                StressPoint { shear_modulus, stiffness, density, volume, ..StressPoint::default() }
            };
            let points: Vec<StressPoint> = (0..layout.count(nodes)).map(point).collect();
            let value = stress_node_values(model, &layout, &model.position, edges);
            let mut mass = lumped_masses(&value, &points, nodes);
            if layout.dual().is_none() {
                let contacts = Contacts::new(model, &points);
                contacts.sharpen(model, &model.position, &points, &value, &mut geometry, &mut mass);
            }
            Self { geometry, points, mass, coefficient: coefficient(model) }
        }

        /// A matrix divided by the roots of the masses on both sides, so that it stays symmetric.
        pub fn scaled(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
            let root = |k: usize| self.mass[k / 2].sqrt();
            DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)] / (root(i) * root(j)))
        }

        /// `b D + 1`, scaled.
        fn response(&self) -> DMatrix<f64> {
            let nodes = self.mass.len();
            let mut dispersion =
                Dispersion { coefficient: self.coefficient, flux: vec![Flux::default(); self.points.len()] };
            let mut matrix = DMatrix::zeros(2 * nodes, 2 * nodes);
            for column in 0..2 * nodes {
                let mut acceleration = vec![Vec2::zeros(); nodes];
                acceleration[column / 2][column % 2] = 1.0;
                dispersion.gather(false, &self.geometry, &self.points, &acceleration);
                for j in 0..nodes {
                    let added = dispersion.acceleration(&self.geometry, j, 1.0);
                    matrix[(2 * j, column)] = added.x;
                    matrix[(2 * j + 1, column)] = added.y;
                }
            }
            DMatrix::identity(2 * nodes, 2 * nodes) + self.scaled(&matrix)
        }

        /// Elastic stiffness, kPa/m per unit thickness.
        pub fn stiffness(&self) -> DMatrix<f64> {
            let nodes = self.mass.len();
            let mut strain = DMatrix::zeros(3 * self.points.len(), 2 * nodes);
            for column in 0..2 * nodes {
                let mut moved = vec![Vec2::zeros(); nodes];
                moved[column / 2][column % 2] = 1.0;
                for (s, point) in self.points.iter().enumerate() {
                    let (x, y) = motion(&self.geometry, s, &moved).gradient();
                    let shear = (point.volume * point.shear_modulus).sqrt();
                    let bulk = (point.volume * (point.stiffness - point.shear_modulus)).sqrt();
                    strain[(3 * s, column)] = bulk * (x.x + y.y);
                    strain[(3 * s + 1, column)] = shear * (x.x - y.y);
                    strain[(3 * s + 2, column)] = shear * (x.y + y.x);
                }
            }
            strain.transpose() * strain
        }
    }

    /// The block with its upper `rows` rows as another region.
    pub(crate) fn layered(mut model: Model, rows: usize) -> Model {
        let top = model.position.iter().map(|x| x.y).fold(f64::NEG_INFINITY, f64::max);
        for (region, x) in model.region.iter_mut().zip(&model.position) {
            *region = u32::from(top - x.y < rows as f64 - 0.5);
        }
        model.regions.push(model.regions[0].clone());
        model
    }

    /// The inverse of the inertia is symmetric, at least as large as that of the masses, and equal to it for
    /// rigid motion, rotation included. The masses are positive, and their sum is that of the block.
    #[test]
    fn the_inertia_is_symmetric_and_keeps_momentum() {
        let cases = [Operators::Conservative, Operators::Dual]
            .into_iter()
            .flat_map(|operators| [1.0, 1.2, 1.4, 1.6].map(|ratio| (operators, ratio)));
        for (operators, ratio) in cases {
            for (disorder, base) in [(0.0, None), (0.1, None), (0.1, Some(Condition::VerticalRoller))] {
                let mut model = layered(disordered(9, disorder), 4);
                model.numerics.operators = operators;
                model.numerics.smoothing_ratio = ratio;
                let walls = if let Some(base) = base {
                    model.outline = Outline::level(-0.5);
                    Walls::shaken(&model.outline, base, [false; 2])
                } else {
                    Walls::statics(&model.outline)
                };
                let block = Block::new(&model, walls, &[[1.0, 3.5], [10.0, 35.0]], 1.0);
                assert!(block.mass.iter().all(|mass| *mass > 0.2));
                let matrix = block.response();
                assert!((&matrix - matrix.transpose()).amax() < 1e-13);
                assert!(matrix.symmetric_eigenvalues().min() > 1.0 - 1e-12);
                if base.is_none() {
                    assert!((block.mass.iter().sum::<f64>() - model.nodes() as f64).abs() < 1e-11);
                    let rotation = DVector::from_fn(matrix.nrows(), |row, _| {
                        let x = model.position[row / 2];
                        block.mass[row / 2].sqrt() * if row % 2 == 0 { 1.0 - x.y } else { 2.0 + x.x }
                    });
                    assert!((&matrix * &rotation - &rotation).amax() < 1e-11);
                }
            }
        }
    }

    /// Images continue the ground beyond a held side: nodes keep their own mass there, but not at a free
    /// surface.
    #[test]
    fn nodes_beside_a_held_side_keep_their_mass() {
        const SIDE: usize = 13;
        let end = SIDE as f64 - 0.5;
        let mut model = square_block(SIDE);
        let side = |x: f64, support: Support| Some(Side { x, extent: [-0.5, end], support });
        model.outline =
            Outline { sides: [side(-0.5, Support::FreeSlip), side(end, Support::NoSlip)], ..Outline::none() };
        let block = Block::new(&model, Walls::statics(&model.outline), &[[1.0, 3.0]], 1.0);
        for (mass, at) in block.mass.iter().zip(&model.position) {
            // The middle row takes part in no stencil that the surfaces cut.
            assert!((at.y - 6.0).abs() > 0.5 || (mass - 1.0).abs() < 1e-12, "{at}: {mass}");
            assert!(at.y < end - 1.0 || *mass > 1.1, "{at}: {mass}");
        }
    }

    /// Largest eigenvalue of the response times a symmetric matrix.
    fn largest(response: &DMatrix<f64>, matrix: &DMatrix<f64>) -> f64 {
        // Similar to the symmetric R^T K R, with R R^T the response.
        let root = response.clone().cholesky().unwrap().l();
        let eigenvalues = (root.transpose() * matrix * root).symmetric_eigenvalues();
        assert!(eigenvalues.min() > -1e-12 * eigenvalues.max());
        eigenvalues.max()
    }

    /// With corrected inertia no mode of a free block is faster, or more strongly filtered, than the time
    /// step assumes, at Poisson's ratios of 0, 0.3 and 0.48, uniform or under a layer of a hundredth or a
    /// hundred times the stiffness.
    #[test]
    fn limit_of_the_time_step() {
        // Shear modulus with a wave speed well above the least speed of the filter, kPa.
        const STIFF: f64 = 1e4;
        let cases = [1.0, 1.2, 1.4, 1.6].map(|ratio| (Operators::Conservative, ratio));
        for (operators, ratio) in cases.into_iter().chain([1.0, 1.2].map(|ratio| (Operators::Dual, ratio))) {
            for (rows, contrast) in [(0, 1.0), (3, 0.01), (5, 4.0), (5, 100.0)] {
                let mut model = layered(square_block(10), rows);
                model.numerics.operators = operators;
                model.numerics.smoothing_ratio = ratio;
                for lame in [0.0, 1.5, 24.0] {
                    let walls = Walls::statics(&model.outline);
                    let moduli = [SHEAR, contrast].map(|shear| [STIFF * shear, STIFF * shear * (lame + 2.0)]);
                    let block = Block::new(&model, walls, &moduli, 1.0);
                    let shear = contrast.max(SHEAR) * STIFF;
                    let response = block.response();
                    let filter = block.scaled(&filter_matrix(&block.geometry, &block.points, 0.1));
                    let filter = largest(&response, &filter) / (0.1 * shear.sqrt());
                    let squared = largest(&response, &block.scaled(&block.stiffness()));
                    let found = 2.0 * ((lame + 2.0) * shear / squared).sqrt() / ratio;
                    println!(
                        "{operators:?} h/dx {ratio}, {rows} rows of {contrast}, lambda/mu {lame}: dt c_d/h {found:.3}, filter {filter:.3} xi C_s/dx"
                    );
                    let (own, response) = match operators {
                        Operators::Dual => (DUAL_DRAINED_COEFFICIENT, DUAL_CORRECTED_RESPONSE),
                        _ => (DRAINED_COEFFICIENT, CORRECTED_RESPONSE),
                    };
                    assert!(found > own / response.sqrt(), "{found}");
                    // On the dual lattice the filter is strongest on waves of little stiffness: see `corrected_inertia`.
                    let is_dual = operators == Operators::Dual;
                    assert!(is_dual || filter < FILTER_EIGENVALUE * CORRECTED_FILTER, "{filter}");
                }
            }
        }
    }

    /// The table of accelerations by the dashpots' tractions agrees with the correction itself.
    #[test]
    fn dashpot_tractions_get_the_same_correction() {
        let mut model = disordered(8, 0.1);
        model.outline = Outline::level(-0.5);
        let nodes = model.nodes();
        let edges = EdgesView {
            outline: &model.outline,
            walls: Walls::shaken(&model.outline, Condition::VerticalRoller, [false; 2]),
        };
        let geometry = Geometry::build(&model, &model.position, &vec![1.0; nodes], edges);
        let points =
            vec![StressPoint { density: 2.0, volume: 0.5, ..StressPoint::default() }; STRESS_NODES * nodes];
        let mass: Vec<f64> = (0..nodes).map(|j| 1.0 + 0.01 * j as f64).collect();
        let mut trace = Csr::with_capacity(1, 3);
        trace.push_row(&mut [(2, 1.5), (10, -0.6), (18, 0.1)]);
        let direction = Vec2::new(0.6, 0.8);
        let dashpots = vec![Dashpot { point: 0, direction, impedance: 1.0, length: 1.0 }];
        let dashpots = Dashpots::new(dashpots, trace, &mass);
        let mut dispersion = Dispersion::new(&model, points.len());
        let spread = dispersion.spread(&geometry, &points, &mass, &dashpots);
        let mut pushed = vec![Vec2::zeros(); nodes];
        for (j, weight) in dashpots.trace().iter_row(0) {
            pushed[j] = direction * (weight / mass[j]);
        }
        dispersion.gather(false, &geometry, &points, &pushed);
        let mut found = vec![Vec2::zeros(); nodes];
        for (j, response) in spread.iter_row(0) {
            found[j] = *response;
        }
        for (j, found) in found.iter().enumerate() {
            let expected = dispersion.acceleration(&geometry, j, mass[j]);
            assert!((found - expected).norm() < 1e-13, "{j}: {found} {expected}");
        }
    }
}
