//! Spectra of the skeleton operators: speeds of waves, waves that are not resolved, and stability of a free
//! block. Lengths in spacings, frequencies in wave speed over spacing.

use crate::{
    section::{
        description::{Model, Operators, STRESS_NODES, stress_node_offset},
        outline::EdgesView,
        stress_layout::StressLayout,
    },
    skeleton::{
        deformation::Deformation,
        inertia::Dispersion,
        phases::Phases,
        point::StressPoint,
        printed::PrintedStress,
        strain_and_force::{conservative_force, motion},
    },
    testing::square_block,
    weights::geometry::Geometry,
};
use Operators::{Conservative, Dual, Printed};
use nalgebra::{Complex, DMatrix, Matrix2};
use sandboil_soil::Stress;
use sandboil_sph::Vec2;
use std::f64::consts::PI;

/// Lame's constants over the density: unit shear-wave speed, Poisson's ratio 0.3.
pub const SHEAR: f64 = 1.0;
const LAME: f64 = 1.5;
/// Plane waves under the operators of an unbounded lattice.
struct Lattice {
    /// For each stress point of a cell of the lattice: offsets and gradient weights of its neighbours.
    stencils: Vec<Vec<(Vec2, Vec2)>>,
}

impl Lattice {
    fn new(operators: Operators, smoothing_ratio: f64) -> Self {
        const SIDE: usize = 15;
        let mut model = square_block(SIDE);
        model.numerics.operators = operators;
        model.numerics.smoothing_ratio = smoothing_ratio;
        let volume = vec![1.0; model.nodes()];
        let edges = EdgesView::statics(&model.outline);
        let geometry = Geometry::build(&model, &model.position, &volume, edges);
        let centre = SIDE * (SIDE / 2) + SIDE / 2;
        let origin = model.position[centre];
        let stencil = |s: usize| {
            let row = geometry.gradient.forward.iter_row(s);
            row.map(|(j, weight)| (model.position[j] - origin, weight.gradient)).collect()
        };
        let layout = StressLayout::new(&model);
        // A cell has one corner of its own.
        let count = if layout.dual().is_some() { 1 } else { STRESS_NODES };
        Self { stencils: layout.of_node(centre).take(count).map(|(s, _)| stencil(s)).collect() }
    }

    /// Stiffness over mass for a wave vector, for Lame's constants over the density.
    fn stiffness(&self, wave: Vec2, lame: f64, shear: f64) -> Matrix2<Complex<f64>> {
        let mut stiffness = Matrix2::<Complex<f64>>::zeros();
        for stencil in &self.stencils {
            let mut g = [Complex::new(0.0, 0.0); 2];
            for (offset, weight) in stencil {
                let phase = Complex::from_polar(1.0 / (self.stencils.len() as f64).sqrt(), wave.dot(offset));
                g[0] += phase * weight.x;
                g[1] += phase * weight.y;
            }
            let confined = lame + 2.0 * shear;
            stiffness[(0, 0)] += Complex::from(confined * g[0].norm_sqr() + shear * g[1].norm_sqr());
            stiffness[(1, 1)] += Complex::from(confined * g[1].norm_sqr() + shear * g[0].norm_sqr());
            let mixed = g[0].conj() * g[1] * lame + g[1].conj() * g[0] * shear;
            stiffness[(0, 1)] += mixed;
            stiffness[(1, 0)] += mixed.conj();
        }
        stiffness
    }

    /// Squared frequencies of a wave vector, lower first, for a compression-wave modulus `LAME + 2 SHEAR` and a
    /// shear modulus `SHEAR` over the density.
    fn squared_frequencies(&self, wave: Vec2) -> [f64; 2] {
        roots(&self.stiffness(wave, LAME, SHEAR))
    }

    /// The same with corrected inertia.
    fn corrected_squared_frequencies(&self, wave: Vec2, coefficient: f64) -> [f64; 2] {
        let unit_speeds = self.stiffness(wave, -1.0, 1.0) * Complex::from(coefficient);
        roots(&((Matrix2::identity() + unit_speeds) * self.stiffness(wave, LAME, SHEAR)))
    }

    fn shear_frequency(&self, wave: Vec2) -> f64 {
        self.squared_frequencies(wave)[0].max(0.0).sqrt()
    }
}

/// Eigenvalues of a matrix that is similar to a Hermitian one, lower first.
fn roots(matrix: &Matrix2<Complex<f64>>) -> [f64; 2] {
    let (half, product) = (0.5 * matrix.trace().re, matrix.determinant().re);
    let root = (half * half - product).max(0.0).sqrt();
    [half - root, half + root]
}

/// Waves are slower than exact; with the weighted fit by a twentieth less than with the corrected kernel of
/// Eq. 8.
#[test]
fn phase_speed_of_shear_waves() {
    for (operators, ratio, slow) in [
        (Conservative, 1.4, [0.0244, 0.0942, 0.242]),
        (Conservative, 1.2, [0.0179, 0.0700, 0.184]),
        (Conservative, 1.0, [0.0127, 0.0499, 0.133]),
        (Dual, 1.2, [0.0179, 0.0700, 0.184]),
        (Printed, 1.4, [0.026, 0.10, 0.26]),
        (Printed, 1.2, [0.020, 0.076, 0.20]),
        (Printed, 1.0, [0.013, 0.053, 0.14]),
    ] {
        let lattice = Lattice::new(operators, ratio);
        for (points, expected) in [20.0, 10.0, 6.0].into_iter().zip(slow) {
            let k = 2.0 * PI / points;
            let found = 1.0 - lattice.shear_frequency(Vec2::new(0.0, k)) / k;
            println!(
                "{operators:?} h/dx {ratio}, {points} points per wavelength: {:.2} % too slow",
                100.0 * found
            );
            assert!((found - expected).abs() < 0.03 * expected + 5e-4, "{found} {expected}");
        }
    }
}

/// With corrected inertia shear and compression waves of any direction are accurate to fourth order: from 20
/// to 40 points per wavelength the error of their speed falls by a factor of nearly sixteen.
#[test]
fn corrected_phase_speed_is_of_fourth_order() {
    let cases = [
        (Conservative, 1.0, 6e-4),
        (Conservative, 1.2, 1.1e-3),
        (Conservative, 1.4, 2e-3),
        (Dual, 1.2, 1.1e-3),
    ];
    for (operators, ratio, bound) in cases {
        let lattice = Lattice::new(operators, ratio);
        let mut model = square_block(2);
        model.numerics.operators = operators;
        model.numerics.smoothing_ratio = ratio;
        let coefficient = Dispersion::new(&model, 0).coefficient();
        let slow = |points: f64| {
            [0.0, PI / 8.0, PI / 4.0, PI / 2.0].map(|angle| {
                let k = 2.0 * PI / points;
                let wave = Vec2::new(angle.cos(), angle.sin()) * k;
                let [shear, confined] = lattice.corrected_squared_frequencies(wave, coefficient);
                (1.0 - (shear / SHEAR).sqrt() / k)
                    .abs()
                    .max((1.0 - (confined / (LAME + 2.0 * SHEAR)).sqrt() / k).abs())
            })
        };
        let [at_40, at_20, at_10] =
            [40.0, 20.0, 10.0].map(|points| slow(points).into_iter().fold(0.0, f64::max));
        println!(
            "{operators:?} h/dx {ratio}: {:.3}, {:.3}, {:.2} % at 40, 20, 10 points",
            100.0 * at_40,
            100.0 * at_20,
            100.0 * at_10
        );
        assert!(at_20 < bound && at_20 / at_40 > 10.0, "{at_40} {at_20}");
    }
}

/// Both frequencies would be zero if stress nodes were at their velocity nodes. The velocity filter damps the
/// checkerboard.
#[test]
fn stress_nodes_resist_the_shortest_waves() {
    for (operators, ratio, rows, checkerboard) in [
        (Conservative, 1.4, 0.250, 0.019),
        (Conservative, 1.2, 0.576, 0.098),
        (Conservative, 1.0, 1.106, 0.482),
        (Printed, 1.4, 0.22, 0.07),
        (Printed, 1.2, 0.50, 0.13),
        (Printed, 1.0, 0.98, 0.42),
    ] {
        let lattice = Lattice::new(operators, ratio);
        let found = [Vec2::new(0.0, PI), Vec2::new(PI, PI)].map(|wave| lattice.shear_frequency(wave));
        println!("{operators:?} h/dx {ratio}: w(0,pi) {:.3}, w(pi,pi) {:.3} c_s/dx", found[0], found[1]);
        assert!((found[0] - rows).abs() < 5e-3 && (found[1] - checkerboard).abs() < 5e-3, "{found:?}");
    }
}

/// Largest frequency of interior waves: the leapfrog limit `2 / w` over `dx / c_d`.
#[test]
fn interior_limit_of_the_time_step() {
    const SAMPLES: u32 = 60;
    let compression_speed = (LAME + 2.0 * SHEAR).sqrt();
    for (operators, ratio, limit) in [
        (Conservative, 1.0, 1.669),
        (Conservative, 1.2, 2.02),
        (Conservative, 1.4, 2.356),
        (Printed, 1.2, 2.10),
        (Printed, 1.4, 2.45),
        (Printed, 1.6, 2.81),
    ] {
        let lattice = Lattice::new(operators, ratio);
        let axis = || (0..=SAMPLES).map(|k| PI * f64::from(k) / f64::from(SAMPLES));
        let largest = axis()
            .flat_map(|x| axis().map(move |y| Vec2::new(x, y)))
            .map(|wave| lattice.squared_frequencies(wave)[1])
            .fold(0.0, f64::max);
        let found = 2.0 / largest.sqrt() * compression_speed;
        println!("{operators:?} h/dx {ratio}: dt c_d/dx {found:.3}");
        assert!((found / limit - 1.0).abs() < 0.02, "{found} {limit}");
    }
}

fn acceleration_matrix(model: &Model) -> DMatrix<f64> {
    elastic_matrix(model, LAME)
}

/// Acceleration of every node of a block under a unit displacement of every node, elastic: `-M^-1 K`. `lame` is the
/// first constant over the density.
pub fn elastic_matrix(model: &Model, lame: f64) -> DMatrix<f64> {
    let phases = Phases::new(model);
    let volume = phases.volume().to_vec();
    let edges = EdgesView::statics(&model.outline);
    let geometry = Geometry::build(model, &model.position, &volume, edges);
    let nodes = model.nodes();
    let mut matrix = DMatrix::zeros(2 * nodes, 2 * nodes);
    let mut points =
        vec![StressPoint { density: 1.0, volume: 0.5, ..StressPoint::default() }; STRESS_NODES * nodes];
    for column in 0..2 * nodes {
        let mut moved = vec![Vec2::zeros(); nodes];
        moved[column / 2][column % 2] = 1.0;
        for (s, point) in points.iter_mut().enumerate() {
            let strain = motion(&geometry, s, &moved).increment(&Deformation::default(), 1.0);
            let volume = lame * (strain.xx + strain.yy);
            point.stress = Stress {
                xx: volume + 2.0 * SHEAR * strain.xx,
                yy: volume + 2.0 * SHEAR * strain.yy,
                xy: SHEAR * strain.xy,
                zz: 0.0,
            };
        }
        let still = Vec2::zeros();
        let force: Box<dyn Fn(usize) -> Vec2> = if let Some(tables) = &geometry.printed {
            let mut stress = PrintedStress::default();
            stress.update(tables, &points);
            let (points, phases) = (&points, &phases);
            Box::new(move |j| stress.force(tables, j, points, phases))
        } else {
            let shares: Vec<_> = (0..points.len())
                .map(|s| {
                    motion(&geometry, s, &vec![still; nodes]).share(&points[s], geometry.covariance[s], 0.0)
                })
                .collect();
            let (geometry, points) = (&geometry, &points);
            Box::new(move |j| conservative_force(geometry, j, still, &shares, points))
        };
        for j in 0..nodes {
            let acting = force(j);
            matrix[(2 * j, column)] = acting.x;
            matrix[(2 * j + 1, column)] = acting.y;
        }
    }
    matrix
}

/// Fastest growth of any mode, in shear-wave speed over spacing: eigenvalues `-w^2` off the negative real axis.
fn growth_rate(acceleration: &DMatrix<f64>) -> f64 {
    acceleration.complex_eigenvalues().iter().map(|value| value.sqrt().re.abs()).fold(0.0, f64::max)
}

pub fn disordered(side: usize, amplitude: f64) -> Model {
    let mut model = square_block(side);
    for (k, x) in model.position.iter_mut().enumerate() {
        // Two incommensurate steps around the unit circle scatter the nodes without a pattern.
        let (sin, cos) = (2.399_963 * k as f64).sin_cos();
        *x += Vec2::new(cos, sin) * (amplitude * (0.618_034 * k as f64).fract());
    }
    model
}

#[test]
fn a_free_block_is_stable_with_three_rigid_modes() {
    for disorder in [0.0, 0.1] {
        let matrix = acceleration_matrix(&disordered(10, disorder));
        let asymmetry = (&matrix - matrix.transpose()).amax() / matrix.amax();
        assert!(asymmetry < 1e-12, "{asymmetry}");
        let mut squared: Vec<f64> = (-&matrix).symmetric_eigenvalues().iter().copied().collect();
        squared.sort_by(f64::total_cmp);
        println!("disorder {disorder}: w^2 from {:.1e}, {:.1e}", squared[0], squared[3]);
        assert!(squared[0] > -1e-12 && squared[2] < 1e-12 && squared[3] > 1e-6, "{squared:?}");
        assert!(growth_rate(&matrix) < 1e-6);
    }
}

/// The skeleton limit at free surfaces: never below `0.99 h / c_d`, from which the time step is taken.
#[test]
fn surface_limit_of_the_time_step() {
    let compression_speed = (LAME + 2.0 * SHEAR).sqrt();
    for (ratio, limit) in [(1.0, 1.09), (1.2, 1.22), (1.4, 1.39)] {
        let mut model = square_block(10);
        model.numerics.smoothing_ratio = ratio;
        let largest = (-acceleration_matrix(&model)).symmetric_eigenvalues().max();
        let found = 2.0 / largest.sqrt() * compression_speed;
        println!("h/dx {ratio}: dt c_d/dx {found:.3} with free surfaces");
        assert!((found / limit - 1.0).abs() < 0.03 && found > 0.99 * ratio, "{found} {limit}");
    }
}

/// Why the printed form is not the default: its free block has growing modes, at a few per cent of `c_s/dx`.
#[test]
fn the_printed_form_has_growing_modes() {
    let mut model = square_block(10);
    model.numerics.operators = Printed;
    let rate = growth_rate(&acceleration_matrix(&model));
    println!("printed: growth {rate:.2e} c_s/dx");
    assert!((1e-3..5e-2).contains(&rate), "{rate}");
}

/// Damping matrix of the velocity filter on stress nodes without stress: `-dF/dv`.
pub fn filter_matrix(geometry: &Geometry, points: &[StressPoint], strength: f64) -> DMatrix<f64> {
    let nodes = geometry.gradient.transposed.rows();
    let mut matrix = DMatrix::zeros(2 * nodes, 2 * nodes);
    for column in 0..2 * nodes {
        let mut velocity = vec![Vec2::zeros(); nodes];
        velocity[column / 2][column % 2] = 1.0;
        let shares: Vec<_> = (0..points.len())
            .map(|s| motion(geometry, s, &velocity).share(&points[s], geometry.covariance[s], strength))
            .collect();
        for j in 0..nodes {
            let force = conservative_force(geometry, j, velocity[j], &shares, points);
            matrix[(2 * j, column)] = -force.x;
            matrix[(2 * j + 1, column)] = -force.y;
        }
    }
    matrix
}

/// The filter is as strong as the time step assumes, symmetric, and proportional to the current shear-wave
/// speed if this is above 20 m/s.
#[test]
fn strength_of_the_velocity_filter() {
    let model = square_block(10);
    let edges = EdgesView::statics(&model.outline);
    let geometry = Geometry::build(&model, &model.position, &vec![1.0; model.nodes()], edges);
    for (shear_modulus, speed) in [(1e4, 100.0), (1.0, 20.0), (0.0, 20.0)] {
        let point = StressPoint { density: 1.0, volume: 0.5, shear_modulus, ..StressPoint::default() };
        let matrix = filter_matrix(&geometry, &vec![point; STRESS_NODES * model.nodes()], 0.1);
        assert!((&matrix - matrix.transpose()).amax() < 1e-14 * speed);
        let eigenvalues = matrix.symmetric_eigenvalues();
        let largest = eigenvalues.max() / (0.1 * speed);
        println!("C_s {speed} m/s: eigenvalues of the filter up to {largest:.3} xi C_s/dx");
        assert!((largest - 1.05).abs() < 0.02 && eigenvalues.min() > -1e-12 * speed, "{largest}");
    }
}

#[test]
fn stress_nodes_lie_a_third_of_a_spacing_from_their_velocity_node() {
    assert!((stress_node_offset(Vec2::repeat(0.3)).norm() - 0.1).abs() < 1e-15);
}
