//! One-dimensional consolidation against Terzaghi's series.

use crate::common::{column, elastic, shaking};
use sandboil_solver::{Conductivity, Diffusion, Outline, Simulation, Vec2, Water};
use std::f64::consts::PI;

const HEIGHT: f64 = 1.0;
const SHEAR: f64 = 3.0e3;
const BULK: f64 = 6.0e3;
const UNIT_WEIGHT: f64 = 10.0;
/// Slow enough that the column's inertia does not show: the wave crosses it 400 times before T = 0.05.
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
fn errors(rows: usize, smoothing_ratio: f64, diffusion: Diffusion) -> [f64; 3] {
    let mut region = elastic(SHEAR, BULK);
    region.hydraulic_conductivity = Conductivity::isotropic(CONDUCTIVITY);
    let porosity = region.porosity;
    let water = Water { unit_weight: UNIT_WEIGHT, bulk_modulus: 1e6 };
    let mut model = column(HEIGHT, HEIGHT / rows as f64, 1, region, Some(water));
    model.numerics.diffusion = diffusion;
    model.numerics.smoothing_ratio = smoothing_ratio;
    let heights: Vec<f64> = model.position.iter().map(|x| x.y).collect();
    let confined = BULK + 4.0 / 3.0 * SHEAR;
    let diffusivity = CONDUCTIVITY / (UNIT_WEIGHT * (1.0 / confined + porosity / water.bulk_modulus));
    let mut simulation = Simulation::new(&model, 1).unwrap();
    let stage = shaking(None, 0.5 * HEIGHT * HEIGHT / diffusivity, Vec::new());
    simulation.begin_shaking(stage).unwrap();
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
    for (rows, limits) in [(20, [4e-3, 2e-3, 1e-3]), (50, [1e-3, 5e-4, 2e-4])] {
        for smoothing_ratio in [1.2, 1.4] {
            for diffusion in [Diffusion::Implicit, Diffusion::Explicit] {
                let errors = errors(rows, smoothing_ratio, diffusion);
                println!(
                    "{rows} rows, h/dx {smoothing_ratio}, {diffusion:?}: rms p/p0 {errors:.4?} at T 0.05, 0.2, 0.5"
                );
                for (error, limit) in errors.iter().zip(limits) {
                    assert!(*error < limit, "{error} above {limit}");
                }
            }
        }
    }
}

/// Pore pressure of a weightless undrained block over the total stress that presses it: by the confined modulus when it
/// is pressed one way, by `K + G/3` when it is pressed from both sides in plane strain.
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
        simulation.begin_shaking(shaking(None, 1.0, Vec::new())).unwrap();
        let press = |x: &Vec2| [if both { -1e-6 * x.x } else { 0.0 }, -1e-6 * x.y];
        simulation.set_velocity(&model.position.iter().map(press).collect::<Vec<_>>()).unwrap();
        simulation.advance(1, f64::INFINITY).unwrap();
        let node = SIDE * SIDE / 2;
        let pressure = simulation.excess_pore_pressure().unwrap()[node];
        let [stress, _] = simulation.stress()[node];
        let pressed = if both { 0.5 * (stress[0] + stress[1]) } else { stress[1] };
        let skeleton = if both { BULK + SHEAR / 3.0 } else { BULK + 4.0 / 3.0 * SHEAR };
        let (found, exact) =
            (pressure / (pressure - pressed), bulk_modulus / porosity / (bulk_modulus / porosity + skeleton));
        println!("K_f {bulk_modulus:e} kPa, both ways {both}: dp/dq {found:.6}, exact {exact:.6}");
        assert!((found / exact - 1.0).abs() < 1e-3);
    }
}
