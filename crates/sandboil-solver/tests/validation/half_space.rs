//! Waves that leave: how much of them base and sides send back.

use crate::{
    common::{elastic, shaking},
    free_field::block,
    waves::weightless,
};
use sandboil_solver::{Model, Shaking, Simulation, Vertical, Water};
use sandboil_sph::Vec2;

const DENSITY: f64 = 2.0;
const SHEAR_SPEED: f64 = 100.0;
const SHEAR_MODULUS: f64 = DENSITY * SHEAR_SPEED * SHEAR_SPEED;
const BULK_MODULUS: f64 = 2.0 * SHEAR_MODULUS;
const WATER: Water = Water { unit_weight: 10.0, bulk_modulus: 1e6 };
/// Half-width of the pulses over the spacing: hardly a wave of fewer than 18 spacings in them.
const PULSE: f64 = 8.0;

fn speed(model: &Model, compression: bool) -> f64 {
    let region = &model.regions[0];
    let stiffness = if compression {
        BULK_MODULUS + 4.0 / 3.0 * SHEAR_MODULUS + model.water_stiffness(region.porosity)
    } else {
        SHEAR_MODULUS
    };
    (stiffness / model.mixture_density(0)).sqrt()
}

/// Weightless ground whose every edge absorbs, with a velocity field to begin with.
fn under_way(model: &Model, velocity: impl Fn(Vec2) -> Vec2, probes: Vec<Vec2>) -> Simulation {
    let mut simulation = Simulation::new(model, 2).unwrap();
    let mut stage = Shaking { free_field: [true; 2], ..shaking(None, 10.0, probes) };
    stage.base.vertical = Vertical::Absorbing;
    simulation.begin_shaking(stage).unwrap();
    let field: Vec<[f64; 2]> = model.position.iter().map(|&x| velocity(x).into()).collect();
    simulation.set_velocity(&field).unwrap();
    simulation
}

/// Pulses that run out to both sides at normal incidence: what comes back past a point half-way, over what went out.
#[test]
fn sides_absorb_waves_at_normal_incidence() {
    const SPACING: f64 = 0.25;
    const WIDTH: f64 = 20.0;
    for (what, water, compression, bound) in [
        ("P, dry", None, true, 0.02),
        ("S, dry", None, false, 0.02),
        ("P, undrained", Some(WATER), true, 0.02),
    ] {
        let region = elastic(SHEAR_MODULUS, BULK_MODULUS);
        let dry = weightless(block(1.0, SPACING, 1, region.clone(), water));
        let (c, fastest) = (speed(&dry, compression), speed(&dry, true));
        // Tall enough that what the ends of the pulse scatter is not yet at the middle.
        let height = 2.0 * SPACING * ((0.9 * WIDTH + 2.0 * PULSE * SPACING) * fastest / c / SPACING).ceil();
        let columns = (WIDTH / SPACING).round() as usize;
        let model = weightless(block(height, SPACING, columns, region, water));
        let direction = if compression { Vec2::x() } else { Vec2::y() };
        let shape = |x: Vec2| direction * (-((x.x - 0.5 * WIDTH) / (PULSE * SPACING)).powi(2)).exp();
        let mut simulation = under_way(&model, shape, vec![Vec2::new(0.25 * WIDTH, 0.5 * height)]);
        simulation.advance(u64::MAX, 0.9 * WIDTH / c).unwrap();
        simulation.finish_histories();
        let (times, values) = simulation.take_histories();
        let names = simulation.channel_names();
        let name = if compression { "velocity_x" } else { "velocity_y" };
        let place = names.iter().position(|found| *found == name).unwrap();
        let largest = |from: f64, to: f64| {
            let inside = times.iter().zip(values.chunks(names.len()));
            let inside = inside.filter(|(t, _)| (from * WIDTH / c..to * WIDTH / c).contains(*t));
            inside.map(|(_, row)| row[place].abs()).fold(0.0, f64::max)
        };
        // The pulse passes at a quarter of the width, its reflection at three quarters.
        let (out, back) = (largest(0.0, 0.5), largest(0.6, 0.9));
        println!("{what}: {:.2} % of {out:.3} come back, {} nodes", 100.0 * back / out, model.nodes());
        assert!((out - 0.5).abs() < 0.02, "{out}");
        assert!(back < bound * out, "{back} {out}");
    }
}

/// Beams that meet the sides at 45 degrees: the amplitude that stays in the section. Dashpots are made for normal
/// incidence; on plane waves theirs send back 7.0 % of P and 17.1 % of S here, converted waves included.
#[test]
#[ignore = "half a minute"]
fn sides_at_45_degrees() {
    const SPACING: f64 = 0.25;
    const WIDTH: f64 = 40.0;
    const HEIGHT: f64 = 160.0;
    // Several wavelengths wide, so that little of the beam runs in other directions.
    const BEAM: f64 = 16.0;
    for (what, compression, theory) in [("P", true, 0.070), ("S", false, 0.171)] {
        let region = elastic(SHEAR_MODULUS, BULK_MODULUS);
        let columns = (WIDTH / SPACING) as usize;
        let model = weightless(block(HEIGHT, SPACING, columns, region, None));
        let c = speed(&model, compression);
        let along = Vec2::new(1.0, 1.0).normalize();
        let across = Vec2::new(-along.y, along.x);
        // The gradient of a potential for P, its curl for S: neither holds the other.
        let beam = |x: Vec2| {
            let from = x - Vec2::new(0.5 * WIDTH, 0.5 * HEIGHT);
            let place = Vec2::new(from.dot(&along) / (PULSE * SPACING), from.dot(&across) / BEAM);
            let slope = place * (-place.norm_squared()).exp();
            let (slope_along, slope_across) = (slope.x, slope.y * PULSE * SPACING / BEAM);
            if compression {
                along * slope_along + across * slope_across
            } else {
                across * slope_along - along * slope_across
            }
        };
        let mut simulation = under_way(&model, beam, Vec::new());
        let energy = |simulation: &Simulation| -> f64 {
            simulation.velocity().iter().map(|v| v[0] * v[0] + v[1] * v[1]).sum()
        };
        let before = energy(&simulation);
        // The beams' centres meet the sides after `0.5 sqrt 2 WIDTH`, their far edges two half-widths later.
        let way = 0.5 * 2.0_f64.sqrt() * WIDTH + 2.0 * (BEAM + PULSE * SPACING);
        simulation.advance(u64::MAX, way / c).unwrap();
        // Half of the energy is strain by now.
        let amplitude = (2.0 * energy(&simulation) / before).sqrt();
        println!("{what} at 45 degrees: {:.1} % of the amplitude stays", 100.0 * amplitude);
        assert!((amplitude - theory).abs() < 0.05, "{amplitude}");
    }
}
