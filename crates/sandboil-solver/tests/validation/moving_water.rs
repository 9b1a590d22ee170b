//! Hydraulic conditions and partly saturated soil while the ground moves, against closed forms and flow at rest.

use crate::{
    common::{column, elastic, shaking},
    free_field::{LAYOUTS, Layout},
};
use sandboil_soil::VanGenuchten;
use sandboil_solver::{
    Conductivity, Diffusion, HydraulicBoundary, HydraulicCondition, Model, MovingBoundary, Seepage, Series,
    Shaking, Side, Simulation, Support, Until, Vec2, Water,
};

const HEIGHT: f64 = 1.0;
const SPACING: f64 = 0.05;
const COLUMNS: usize = 3;
const WIDTH: f64 = COLUMNS as f64 * SPACING;
const SHEAR: f64 = 3.0e3;
const BULK: f64 = 6.0e3;
const CONFINED: f64 = BULK + 4.0 / 3.0 * SHEAR;
const WATER: Water = Water { unit_weight: 10.0, bulk_modulus: 1e6 };

/// A saturated column, its water table at the surface.
fn ground(conductivity: f64, diffusion: Diffusion) -> Model {
    let mut region = elastic(SHEAR, BULK);
    region.hydraulic_conductivity = Conductivity::isotropic(conductivity);
    let mut model = column(HEIGHT, SPACING, COLUMNS, region, Some(WATER));
    model.numerics.diffusion = diffusion;
    model
}

/// Both layouts of stress points with both kinds of diffusion.
fn on_both_layouts() -> impl Iterator<Item = (Layout, Diffusion)> {
    let with = |layout| [Diffusion::Implicit, Diffusion::Explicit].map(|diffusion| (layout, diffusion));
    LAYOUTS.into_iter().flat_map(with)
}

fn across(elevation: f64, condition: HydraulicCondition, at_rest: Option<f64>) -> MovingBoundary {
    let line = vec![Vec2::new(0.0, elevation), Vec2::new(WIDTH, elevation)];
    MovingBoundary { boundary: HydraulicBoundary { line, condition }, at_rest }
}

/// A linear change from one value to another between two times, s.
fn ramp(from: (f64, f64), to: (f64, f64)) -> Series {
    Series { time: vec![from.0, to.0], value: vec![from.1, to.1] }
}

/// A stage without waves, with enough damping to stay near equilibrium in slow changes.
fn without_waves(duration: f64, conditions: Vec<MovingBoundary>) -> Shaking {
    Shaking { conditions, local_damping: 0.3, ..shaking(None, duration, Vec::new()) }
}

fn run(model: &Model, stage: Shaking) -> Simulation {
    let mut simulation = Simulation::new(model, 1).unwrap();
    simulation.begin(stage).unwrap();
    simulation.advance(u64::MAX, f64::INFINITY).unwrap();
    simulation
}

/// Largest difference of a nodal field from a function of the height.
fn departure(model: &Model, field: &[f64], expected: impl Fn(f64) -> f64) -> f64 {
    let misses = model.position.iter().zip(field).map(|(at, value)| (value - expected(at.y)).abs());
    misses.fold(0.0, f64::max)
}

fn heave(simulation: &Simulation) -> Vec<f64> {
    simulation.displacement().iter().map(|u| u[1]).collect()
}

/// A change of the water level above submerged ground changes the pressure everywhere, and moves no node
/// after the pores have adapted.
#[test]
fn water_on_the_ground_weighs_through_its_pressure() {
    const FALL: f64 = 4.0;
    for ((name, layout), diffusion) in on_both_layouts() {
        let mut model = layout(ground(1e-3, diffusion));
        let pond = 6.0 * WATER.unit_weight;
        model.pore_pressure.iter_mut().for_each(|pressure| *pressure += pond);
        let level = HEIGHT + 6.0;
        let falling = HydraulicCondition::Reservoir(ramp((0.0, level), (0.2, level - FALL)));
        let simulation = run(&model, without_waves(2.0, vec![across(HEIGHT, falling, None)]));
        let change = -WATER.unit_weight * FALL;
        let pressure = departure(&model, &simulation.excess_pore_pressure().unwrap(), |_| change) / -change;
        // A load carried by the skeleton alone would move the surface by q H / M'.
        let moved = departure(&model, &heave(&simulation), |_| 0.0) / (-change * HEIGHT / CONFINED);
        println!(
            "{name}, {diffusion:?}: pressure off by {pressure:.1e}, displacement {moved:.1e} of that of the load alone"
        );
        assert!(pressure < 1e-3 && moved < 2e-3);
    }
}

/// Before the pores can drain, skeleton and water share the load by their stiffnesses: `dp = B dq`. The row
/// below the surface has the pressure of the water above, and the rows under it alternate about the shared
/// value.
#[test]
fn sudden_water_is_shared_by_skeleton_and_pores() {
    const RISE: f64 = 1.0;
    const BULK_MODULUS: f64 = 8e3;
    const ROUND_OFF: f64 = 1e-4;
    let error = |spacing: f64, layout: fn(Model) -> Model| -> f64 {
        let mut region = elastic(SHEAR, BULK);
        region.hydraulic_conductivity = Conductivity::isotropic(1e-9);
        let soft = Water { bulk_modulus: BULK_MODULUS, ..WATER };
        let mut model = layout(column(HEIGHT, spacing, 1, region, Some(soft)));
        model.pore_pressure.iter_mut().for_each(|pressure| *pressure += WATER.unit_weight);
        let rising = HydraulicCondition::Reservoir(ramp((0.0, 2.0), (0.5, 2.0 + RISE)));
        let simulation = run(&model, without_waves(1.0, vec![across(HEIGHT, rising, Some(2.0))]));
        let stiffness = BULK_MODULUS / 0.4;
        let expected = WATER.unit_weight * RISE * stiffness / (stiffness + CONFINED);
        let excess = simulation.excess_pore_pressure().unwrap();
        let pairs = excess.windows(2).zip(&model.position).filter(|(_, at)| at.y < 0.5 * HEIGHT);
        pairs.map(|(pair, _)| (0.5 * (pair[0] + pair[1]) / expected - 1.0).abs()).fold(0.0, f64::max)
    };
    for (name, layout) in LAYOUTS {
        let errors = [SPACING, 0.5 * SPACING].map(|spacing| error(spacing, layout));
        println!("{name}: error of the excess of pairs of rows in the lower half: {errors:.4?}");
        assert!(errors[0] < 0.01 && errors[1] < (0.6 * errors[0]).max(ROUND_OFF));
    }
}

/// Upward flow from a head at the base: heads fall along the column by Darcy's law, and effective stress
/// decreases by the same amount.
#[test]
fn a_head_at_the_base_lifts_the_ground() {
    const HEAD: f64 = 0.4;
    for ((name, layout), diffusion) in on_both_layouts() {
        let model = layout(ground(1e-3, diffusion));
        let pressed = HydraulicCondition::Head(ramp((0.0, HEIGHT), (0.1, HEIGHT + HEAD)));
        let simulation = run(&model, without_waves(2.0, vec![across(0.0, pressed, None)]));
        let load = WATER.unit_weight * HEAD;
        let excess =
            departure(&model, &simulation.excess_pore_pressure().unwrap(), |y| load * (1.0 - y / HEIGHT));
        let lift = |y: f64| load / CONFINED * (y - y * y / (2.0 * HEIGHT));
        let lifted = departure(&model, &heave(&simulation), lift) / lift(HEIGHT);
        println!("{name}, {diffusion:?}: error of excess {:.1e}, of heave {lifted:.1e}", excess / load);
        assert!(excess / load < 1e-3 && lifted < 5e-3);
    }
}

/// The same by an inflow: `q = gamma_f v / k` per depth.
#[test]
fn an_inflow_at_the_base_raises_the_head() {
    const CONDUCTIVITY: f64 = 1e-3;
    const INFLOW: f64 = 2e-4;
    for ((name, layout), diffusion) in on_both_layouts() {
        let model = layout(ground(CONDUCTIVITY, diffusion));
        let fed = HydraulicCondition::Flux(ramp((0.0, 0.0), (0.1, INFLOW)));
        let simulation = run(&model, without_waves(4.0, vec![across(0.0, fed, None)]));
        let load = WATER.unit_weight * INFLOW / CONDUCTIVITY * HEIGHT;
        let excess =
            departure(&model, &simulation.excess_pore_pressure().unwrap(), |y| load * (1.0 - y / HEIGHT));
        println!("{name}, {diffusion:?}: error of excess {:.1e}", excess / load);
        // A tenth of the pressure difference over a row: the half cell below the surface.
        assert!(excess / load < 0.1 * SPACING / HEIGHT);
    }
}

/// A drain across the middle shortens the drainage path.
#[test]
fn a_drain_shortens_the_drainage_path() {
    let diffusivity = 1e-3 / (WATER.unit_weight * (1.0 / CONFINED + 0.4 / WATER.bulk_modulus));
    // Both halves have a drainage path of H/2 to the drain; the upper half also drains at its other end.
    let time = 0.3 * HEIGHT * HEIGHT / 4.0 / diffusivity;
    for ((name, layout), diffusion) in on_both_layouts() {
        let model = layout(ground(1e-3, diffusion));
        let left = |conditions: Vec<MovingBoundary>| {
            let mut simulation = Simulation::new(&model, 1).unwrap();
            simulation.begin(Shaking { conditions, ..shaking(None, time, Vec::new()) }).unwrap();
            simulation.set_excess_pore_pressure(&vec![1.0; model.nodes()]).unwrap();
            simulation.advance(u64::MAX, f64::INFINITY).unwrap();
            simulation.excess_pore_pressure().unwrap()[..COLUMNS].iter().sum::<f64>() / COLUMNS as f64
        };
        // The drain is at the pressure that was there at rest.
        let drained = left(vec![across(0.5 * HEIGHT, HydraulicCondition::Drain, Some(0.0))]);
        let alone = left(Vec::new());
        let series = |time_factor: f64| {
            let term = |k: f64| {
                4.0 / (std::f64::consts::PI * (2.0 * k + 1.0))
                    * (-1.0_f64).powf(k)
                    * (-(std::f64::consts::PI * (k + 0.5)).powi(2) * time_factor).exp()
            };
            (0..20).map(|k| term(f64::from(k))).sum::<f64>()
        };
        println!(
            "{name}, {diffusion:?}: at the base {drained:.4} (series {:.4}), without {alone:.4} ({:.4})",
            series(0.3),
            series(0.075)
        );
        assert!((drained - series(0.3)).abs() < 0.03 && (alone - series(0.075)).abs() < 0.01);
    }
}

/// Ground 2 m wide between rollers.
fn wide(spacing: f64, width: f64) -> Model {
    let mut model = ground(1e-3, Diffusion::Implicit);
    let columns = (width / spacing).round() as usize;
    let rows = (HEIGHT / spacing).round() as usize;
    model.spacing = Vec2::repeat(spacing);
    model.period = None;
    model.position = (0..rows * columns)
        .map(|k| Vec2::new((k % columns) as f64 + 0.5, (k / columns) as f64 + 0.5) * spacing)
        .collect();
    let side = |x: f64| Some(Side { x, extent: [0.0, HEIGHT], support: Support::FreeSlip });
    model.outline.sides = [side(0.0), side(width)];
    let nodes = model.nodes();
    model.volume = vec![spacing * spacing; nodes];
    model.region = vec![0; nodes];
    model.surface_elevation = vec![HEIGHT; nodes];
    model.vertical_effective_stress = vec![10.0; 2 * nodes];
    model.pore_pressure = model.position.iter().map(|x| WATER.unit_weight * (HEIGHT - x.y)).collect();
    model
}

/// In two dimensions, a head that is raised on half of a side spreads as through ground at rest: seepage on a lattice four
/// times as fine. The head jumps at its end, and errors there are of first order.
#[test]
fn a_head_on_a_side_spreads_as_through_ground_at_rest() {
    const WIDTH: f64 = 2.0;
    const FINER: usize = 4;
    let rise = 0.5;
    let line = |from: [f64; 2], to: [f64; 2]| vec![from.into(), to.into()];
    let side = |value: Series| HydraulicBoundary {
        line: line([0.0, 0.0], [0.0, 0.5 * HEIGHT]),
        condition: HydraulicCondition::Head(value),
    };
    let top = HydraulicBoundary {
        line: line([0.0, HEIGHT], [WIDTH, HEIGHT]),
        condition: HydraulicCondition::Head(Series::constant(HEIGHT)),
    };
    let raised = side(Series::constant(HEIGHT + rise));
    let fine = wide(SPACING / FINER as f64, WIDTH);
    let mut at_rest = Seepage::new(&fine, &fine.pore_pressure, vec![raised, top]).unwrap();
    at_rest.advance(Until::Steady, |_| true).unwrap();
    let model = wide(SPACING, WIDTH);
    let nodes = model.nodes();
    let columns = (WIDTH / SPACING).round() as usize;
    let mut expected = vec![0.0; nodes];
    for (head, at) in at_rest.head().into_iter().zip(&fine.position) {
        let [column, row] = [at.x, at.y].map(|x| (x / SPACING).floor() as usize);
        let share = 1.0 / (FINER * FINER) as f64;
        expected[row * columns + column] += share * WATER.unit_weight * (head - HEIGHT);
    }
    let moving =
        MovingBoundary { boundary: side(ramp((0.0, HEIGHT), (0.2, HEIGHT + rise))), at_rest: Some(HEIGHT) };
    for (name, layout) in LAYOUTS {
        let simulation = run(&layout(model.clone()), without_waves(3.0, vec![moving.clone()]));
        let excess = simulation.excess_pore_pressure().unwrap();
        let squares: f64 = excess.iter().zip(&expected).map(|(q, e)| (q - e).powi(2)).sum();
        let error = (squares / nodes as f64).sqrt() / (WATER.unit_weight * rise);
        println!("{name}: rms error of heads {error:.1e} of the rise");
        assert!(error < 6e-3);
    }
}

/// A condition that stays as it was at rest moves nothing, also where water flows through it.
#[test]
fn unchanged_conditions_move_nothing() {
    let mut model = ground(1e-4, Diffusion::Auto);
    // Water that flows upwards at rest.
    for (pressure, at) in model.pore_pressure.iter_mut().zip(&model.position) {
        *pressure += WATER.unit_weight * 0.2 * (HEIGHT - at.y);
    }
    let pressed = across(0.0, HydraulicCondition::Head(Series::constant(1.2)), Some(1.2));
    let face = across(HEIGHT, HydraulicCondition::SeepageFace, Some(0.0));
    for (_, layout) in LAYOUTS {
        let simulation = run(&layout(model.clone()), without_waves(0.5, vec![pressed.clone(), face.clone()]));
        assert!(simulation.displacement().iter().flatten().all(|u| *u == 0.0));
        assert!(simulation.excess_pore_pressure().unwrap().iter().all(|q| q.abs() < 1e-12));
    }
}

/// Stiff ground that can move drains as ground at rest.
#[test]
fn ground_that_can_move_drains_as_ground_at_rest() {
    const DURATION: f64 = 8.0;
    let soft_water = Water { bulk_modulus: 2e4, ..WATER };
    let curve = VanGenuchten::new(3.0, 2.5, 0.1, 1.0).unwrap();
    let mut model = ground(1e-2, Diffusion::Explicit);
    model.water = Some(soft_water);
    model.regions[0].retention = Some(curve);
    model.regions[0].soil = elastic(3e5, 6e5).soil;
    // Hydrostatic under a water table at 0.6 m, suction above.
    for (pressure, at) in model.pore_pressure.iter_mut().zip(&model.position) {
        *pressure = soft_water.unit_weight * (0.6 - at.y);
    }
    model.saturation =
        model.pore_pressure.iter().map(|p| curve.at(p / soft_water.unit_weight).saturation).collect();
    let falling = HydraulicCondition::Head(ramp((0.0, 0.6), (0.5, 0.2)));
    let below = HydraulicBoundary {
        line: vec![Vec2::new(0.0, 0.0), Vec2::new(WIDTH, 0.0)],
        condition: falling.clone(),
    };
    let mut at_rest = Seepage::new(&model, &model.pore_pressure, vec![below]).unwrap();
    // Steps far shorter than the automatic ones: the time error of seepage is then small.
    for k in 1..=1000 {
        at_rest.advance(Until::Time(DURATION * f64::from(k) / 1000.0), |_| true).unwrap();
    }
    let expected = at_rest.head();
    for ((name, layout), diffusion) in on_both_layouts() {
        let mut model = layout(model.clone());
        model.numerics.diffusion = diffusion;
        let stage = without_waves(DURATION, vec![across(0.0, falling.clone(), Some(0.6))]);
        let mut begun = Simulation::new(&model, 1).unwrap();
        begun.begin(stage.clone()).unwrap();
        let simulation = run(&model, stage);
        let excess = simulation.excess_pore_pressure().unwrap();
        let head =
            |i: usize| model.position[i].y + (model.pore_pressure[i] + excess[i]) / soft_water.unit_weight;
        let miss = (0..model.nodes()).map(|i| (head(i) - expected[i]).abs()).fold(0.0, f64::max);
        let held = simulation.saturation().unwrap();
        let lost = |held: &[f64], at_rest: &[f64]| -> f64 {
            held.iter().zip(at_rest).map(|(now, then)| 0.4 * (then - now) * SPACING * SPACING).sum()
        };
        let here = lost(&held, &begun.saturation().unwrap());
        let there = lost(&at_rest.saturation(), &model.saturation);
        println!(
            "{name}, {diffusion:?}: heads off by {miss:.1e} m of 0.4, water drained {here:.5e} and {there:.5e} m2"
        );
        assert!(miss < 0.01 * 0.4 && (here / there - 1.0).abs() < 0.01);
        // The lowest rows, still saturated, no longer carry the weight of the water that has drained above:
        // total stress by Bishop, tension positive. Single rows alternate about it by some per cent.
        let begun = begun.stress();
        let at_rest_of = |i: usize| -begun[i].iter().map(|s| s[1]).sum::<f64>() / begun[i].len() as f64;
        let relief = |i: usize| {
            let stress = simulation.stress()[i].clone();
            let effective = stress.iter().map(|s| s[1]).sum::<f64>() / stress.len() as f64 + at_rest_of(i);
            let then = model.saturation[i] * model.pore_pressure[i];
            effective - (held[i] * (model.pore_pressure[i] + excess[i]) - then)
        };
        let relieved = 0.5 * (relief(0) + relief(COLUMNS));
        let weight = here * soft_water.unit_weight / WIDTH;
        println!("decrease of stress {relieved:.4} kPa, weight of drained water {weight:.4} kPa");
        assert!((relieved / weight - 1.0).abs() < 0.02);
    }
}
