//! Consolidation: in one dimension against Terzaghi's series, under a load in waves against finite elements.

use crate::common::{column, dual, elastic, shaking};
use nalgebra::{DMatrix, DVector};
use sandboil_solver::{Conductivity, Diffusion, Operators, Outline, Simulation, Vec2, Water};
use std::f64::consts::PI;

const HEIGHT: f64 = 1.0;
const SHEAR: f64 = 3.0e3;
const BULK: f64 = 6.0e3;
const UNIT_WEIGHT: f64 = 10.0;
/// Slow enough that the column's inertia has no effect: a wave crosses it 400 times before T = 0.05.
const CONDUCTIVITY: f64 = 1e-4;
const LOAD: f64 = 1.0;

/// Excess pressure over the load at a height above the impermeable base (Terzaghi 1943).
fn series(height: f64, time_factor: f64) -> f64 {
    (0..200)
        .map(|k| {
            let m = PI * (f64::from(k) + 0.5);
            2.0 / m * (m * (1.0 - height / HEIGHT)).sin() * (-m * m * time_factor).exp()
        })
        .sum()
}

/// Root mean square of `p/p0` less the series over the rows, at time factors 0.05, 0.2 and 0.5.
fn errors(rows: usize, operators: Operators, smoothing_ratio: f64, diffusion: Diffusion) -> [f64; 3] {
    let mut region = elastic(SHEAR, BULK);
    region.hydraulic_conductivity = Conductivity::isotropic(CONDUCTIVITY);
    let porosity = region.porosity;
    let water = Water { unit_weight: UNIT_WEIGHT, bulk_modulus: 1e6 };
    let mut model = column(HEIGHT, HEIGHT / rows as f64, 1, region, Some(water));
    model.numerics.diffusion = diffusion;
    model.numerics.smoothing_ratio = smoothing_ratio;
    if operators == Operators::Dual {
        model = dual(model);
    }
    let heights: Vec<f64> = model.position.iter().map(|x| x.y).collect();
    let confined = BULK + 4.0 / 3.0 * SHEAR;
    let diffusivity = CONDUCTIVITY / (UNIT_WEIGHT * (1.0 / confined + porosity / water.bulk_modulus));
    let mut simulation = Simulation::new(&model, 1).unwrap();
    let stage = shaking(None, 0.5 * HEIGHT * HEIGHT / diffusivity, Vec::new());
    simulation.begin(stage).unwrap();
    simulation.set_excess_pore_pressure(&vec![LOAD; rows]).unwrap();
    [0.05, 0.2, 0.5].map(|time_factor| {
        simulation.advance(u64::MAX, time_factor * HEIGHT * HEIGHT / diffusivity).unwrap();
        let excess = simulation.excess_pore_pressure().unwrap();
        let squares = excess.iter().zip(&heights).map(|(p, y)| (p / LOAD - series(*y, time_factor)).powi(2));
        (squares.sum::<f64>() / rows as f64).sqrt()
    })
}

#[test]
fn terzaghi() {
    for (rows, limits) in [(20, [3e-3, 1.5e-3, 6e-4]), (50, [5e-4, 3e-4, 1e-4])] {
        for (operators, ratio) in
            [(Operators::Conservative, 1.2), (Operators::Conservative, 1.4), (Operators::Dual, 1.2)]
        {
            for diffusion in [Diffusion::Implicit, Diffusion::Explicit] {
                let errors = errors(rows, operators, ratio, diffusion);
                println!(
                    "{operators:?}, {rows} rows, h/dx {ratio}, {diffusion:?}: rms p/p0 {errors:.4?} at T 0.05, 0.2, 0.5"
                );
                for (error, limit) in errors.iter().zip(limits) {
                    assert!(*error < limit, "{error} above {limit}");
                }
            }
        }
    }
}

/// The smooth, impermeable layer of depth [`HEIGHT`] under a load `LOAD cos(k x)`, drained at its surface,
/// with Poisson's ratio zero: the effect of Mandel and Cryer, pressure that first increases inside.
mod waves_of_load {
    use super::*;

    /// Wavelength of the load.
    const WAVE: f64 = 2.5 * HEIGHT;
    const NUMBER: f64 = 2.0 * PI / WAVE;
    const BULK: f64 = 2.0 / 3.0 * SHEAR;
    const CONFINED: f64 = 2.0 * SHEAR;
    const BULK_OF_WATER: f64 = 1e6;
    const POROSITY: f64 = 0.4;
    const MOBILITY: f64 = CONDUCTIVITY / UNIT_WEIGHT;
    /// Time factors `c_v t / H^2` at which pressure is compared: the base's peak among them.
    const TIME_FACTORS: [f64; 7] = [0.01, 0.02, 0.04, 0.06, 0.08, 0.12, 0.2];

    /// Excess pressure under a crest immediately after loading, with incompressible soil and water: Stokes'
    /// problem of the layer.
    fn initial_pressure(height: f64) -> f64 {
        let depth = NUMBER * HEIGHT;
        LOAD * depth.sinh() * (NUMBER * height).cosh() / (depth.sinh() * depth.cosh() + depth)
    }

    /// Quadratic displacement `u sin(k x)`, `v cos(k x)` and linear pressure `p cos(k x)` over the height:
    /// Biot's equations in finite elements, with backward Euler; element size and step are so small that
    /// their errors are negligible. Pressure at evenly spaced heights for each of [`TIME_FACTORS`].
    fn finite_elements() -> Vec<Vec<f64>> {
        const ELEMENTS: usize = 40;
        const STEPS: usize = 200;
        const STATIONS: [[f64; 2]; 3] =
            [[-0.774_596_669_241_483_4, 5.0], [0.0, 8.0], [0.774_596_669_241_483_4, 5.0]];
        let (element, points) = (HEIGHT / ELEMENTS as f64, 2 * ELEMENTS + 1);
        let size = 2 * points + ELEMENTS + 1;
        let lame = BULK - 2.0 / 3.0 * SHEAR;
        let storage = POROSITY / BULK_OF_WATER;
        let mut skeleton = DMatrix::<f64>::zeros(size, size);
        let (mut coupling, mut stored, mut drained) = (skeleton.clone(), skeleton.clone(), skeleton.clone());
        for e in 0..ELEMENTS {
            let places: Vec<usize> = (0..3)
                .map(|i| 2 * e + i)
                .chain((0..3).map(|i| points + 2 * e + i))
                .chain((0..2).map(|i| 2 * points + e + i))
                .collect();
            for [s, weight] in STATIONS {
                let w = weight / 9.0 * 0.5 * element;
                let shape = [0.5 * s * (s - 1.0), 1.0 - s * s, 0.5 * s * (s + 1.0)];
                let slope = [s - 0.5, -2.0 * s, s + 0.5].map(|d| d * 2.0 / element);
                let row = |u: [f64; 3], v: [f64; 3], p: [f64; 2]| {
                    DVector::from_iterator(8, u.into_iter().chain(v).chain(p))
                };
                let none = [0.0; 3];
                let across = row(shape.map(|n| NUMBER * n), none, [0.0; 2]);
                let along = row(none, slope, [0.0; 2]);
                let sheared = row(slope, shape.map(|n| -NUMBER * n), [0.0; 2]);
                let pressure = row(none, none, [0.5 * (1.0 - s), 0.5 * (1.0 + s)]);
                let gradient = row(none, none, [-1.0 / element, 1.0 / element]);
                let volume = &across + &along;
                let of = |a: &DVector<f64>, b: &DVector<f64>| a * b.transpose();
                let add = |to: &mut DMatrix<f64>, part: DMatrix<f64>| {
                    for (a, &i) in places.iter().enumerate() {
                        for (b, &j) in places.iter().enumerate() {
                            to[(i, j)] += w * part[(a, b)];
                        }
                    }
                };
                let shear = (of(&across, &across) + of(&along, &along)) * 2.0 + of(&sheared, &sheared);
                add(&mut skeleton, of(&volume, &volume) * lame + shear * SHEAR);
                add(&mut coupling, of(&volume, &pressure));
                add(&mut stored, of(&pressure, &pressure) * storage);
                let inflow = of(&gradient, &gradient) + of(&pressure, &pressure) * (NUMBER * NUMBER);
                add(&mut drained, inflow * MOBILITY);
            }
        }
        // No settlement of the base, no pressure at the surface.
        let held = [points, size - 1];
        let mut start = DVector::zeros(size);
        for i in 0..=ELEMENTS {
            start[2 * points + i] = initial_pressure(i as f64 * element);
        }
        let load = &coupling * &start;
        let (mut now, mut time) = (start, 0.0);
        TIME_FACTORS
            .iter()
            .map(|factor| {
                let until = factor * HEIGHT * HEIGHT / (MOBILITY * CONFINED);
                let dt = (until - time) / STEPS as f64;
                time = until;
                let mut matrix = &skeleton - &coupling + &stored + coupling.transpose() + &drained * dt;
                for place in held {
                    matrix.row_mut(place).fill(0.0);
                    matrix[(place, place)] = 1.0;
                }
                let factors = matrix.lu();
                for _ in 0..STEPS {
                    let mut right = coupling.tr_mul(&now) + &stored * &now - &load;
                    for place in held {
                        right[place] = 0.0;
                    }
                    now = factors.solve(&right).unwrap();
                }
                now.rows(2 * points, ELEMENTS + 1).iter().copied().collect()
            })
            .collect()
    }

    /// Value at a height between evenly spaced ones.
    fn between(values: &[f64], height: f64) -> f64 {
        let place = height / HEIGHT * (values.len() - 1) as f64;
        let below = (place as usize).min(values.len() - 2);
        let share = place - below as f64;
        values[below] * (1.0 - share) + values[below + 1] * share
    }

    /// For each of [`TIME_FACTORS`]: root mean square error of excess pressure over the largest initial
    /// pressure, and the pressure of the lowest row over its initial value, computed and reference.
    fn compare(rows: usize, reference: &[Vec<f64>]) -> Vec<[f64; 3]> {
        let spacing = HEIGHT / rows as f64;
        let columns = (WAVE / spacing).round() as usize;
        let mut region = elastic(SHEAR, BULK);
        region.hydraulic_conductivity = Conductivity::isotropic(CONDUCTIVITY);
        let water = Water { unit_weight: UNIT_WEIGHT, bulk_modulus: BULK_OF_WATER };
        let model = column(HEIGHT, spacing, columns, region, Some(water));
        let wave = |node: usize| (NUMBER * model.position[node].x).cos();
        let field = |over_height: &dyn Fn(f64) -> f64| -> Vec<f64> {
            (0..model.nodes()).map(|node| over_height(model.position[node].y) * wave(node)).collect()
        };
        let lowest = model.position[0].y;
        let mut simulation = Simulation::new(&model, 1).unwrap();
        simulation.begin(shaking(None, 1e3, Vec::new())).unwrap();
        simulation.set_excess_pore_pressure(&field(&initial_pressure)).unwrap();
        let mut compared = Vec::new();
        for (factor, reference) in TIME_FACTORS.iter().zip(reference) {
            simulation.advance(u64::MAX, factor * HEIGHT * HEIGHT / (MOBILITY * CONFINED)).unwrap();
            let (found, exact) =
                (simulation.excess_pore_pressure().unwrap(), field(&|y| between(reference, y)));
            let squares: f64 = found.iter().zip(&exact).map(|(p, exact)| (p - exact).powi(2)).sum();
            let error = (squares / found.len() as f64).sqrt() / initial_pressure(HEIGHT);
            let amplitude =
                (0..columns).map(|node| found[node] * wave(node)).sum::<f64>() * 2.0 / columns as f64;
            let [rise, exact] = [amplitude, between(reference, lowest)].map(|p| p / initial_pressure(lowest));
            compared.push([error, rise, exact]);
        }
        compared
    }

    #[test]
    fn pressure_rises_inside_before_it_falls() {
        let reference = finite_elements();
        let [coarse, fine] = [10, 20].map(|rows| {
            let compared = compare(rows, &reference);
            for (factor, [error, rise, exact]) in TIME_FACTORS.iter().zip(&compared) {
                println!(
                    "{rows} rows, T {factor}: rms p/p0 {error:.4}, lowest row over its start {rise:.3}, exact {exact:.3}"
                );
            }
            compared
        });
        for ([coarse, ..], [fine, ..]) in coarse.iter().zip(&fine) {
            assert!(*fine < 1e-2 && *fine < 0.4 * coarse, "{fine} after {coarse}");
        }
        let [_, rise, exact] = fine.into_iter().max_by(|a, b| a[2].total_cmp(&b[2])).unwrap();
        assert!(exact > 1.5 && (rise / exact - 1.0).abs() < 0.02, "{rise} for {exact}");
    }
}

/// Pore pressure of a weightless undrained block over the total stress on it: by the confined modulus under
/// stress in one direction, by `K + G/3` under equal stress in both directions in plane strain.
#[test]
fn undrained_block() {
    const SIDE: usize = 11;
    let porosity = 0.4;
    for (bulk_modulus, both) in [(1e4, false), (1e4, true), (1e6, false), (1e6, true)] {
        let water = Water { unit_weight: UNIT_WEIGHT, bulk_modulus };
        let mut model =
            crate::waves::weightless(column(SIDE as f64, 1.0, SIDE, elastic(SHEAR, BULK), Some(water)));
        if both {
            (model.period, model.outline) = (None, Outline::none());
        }
        let mut simulation = Simulation::new(&model, 1).unwrap();
        simulation.begin(shaking(None, 1.0, Vec::new())).unwrap();
        let press = |x: &Vec2| [if both { -1e-6 * x.x } else { 0.0 }, -1e-6 * x.y];
        simulation.set_velocity(&model.position.iter().map(press).collect::<Vec<_>>()).unwrap();
        simulation.advance(1, f64::INFINITY).unwrap();
        let node = SIDE * SIDE / 2;
        let pressure = simulation.excess_pore_pressure().unwrap()[node];
        let stress = simulation.stress()[node][0];
        let pressed = if both { 0.5 * (stress[0] + stress[1]) } else { stress[1] };
        let skeleton = if both { BULK + SHEAR / 3.0 } else { BULK + 4.0 / 3.0 * SHEAR };
        let (found, exact) =
            (pressure / (pressure - pressed), bulk_modulus / porosity / (bulk_modulus / porosity + skeleton));
        println!("K_f {bulk_modulus:e} kPa, both ways {both}: dp/dq {found:.6}, exact {exact:.6}");
        assert!((found / exact - 1.0).abs() < 1e-3);
    }
}
