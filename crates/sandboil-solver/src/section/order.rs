//! The order in which a section keeps its nodes.

use crate::section::description::{Model, Operators, STRESS_NODES};

/// The model with nodes sorted by region, then by row and column of the lattice, and the user's index of each
/// node. Soil loops then run over contiguous rows of one soil model, and neighbours are close in memory.
pub(crate) fn sorted(model: &Model) -> (Model, Vec<usize>) {
    let lowest = model.position.iter().map(|x| x.y).fold(f64::INFINITY, f64::min);
    let row = |i: usize| ((model.position[i].y - lowest) / model.spacing.y).round();
    let mut order: Vec<usize> = (0..model.nodes()).collect();
    order.sort_by(|&a, &b| {
        let key = |i: usize| (model.region[i], row(i), model.position[i].x);
        let ((ra, ya, xa), (rb, yb, xb)) = (key(a), key(b));
        ra.cmp(&rb).then(ya.total_cmp(&yb)).then(xa.total_cmp(&xb)).then(a.cmp(&b))
    });
    let sorted = Model {
        position: order.iter().map(|&i| model.position[i]).collect(),
        volume: order.iter().map(|&i| model.volume[i]).collect(),
        region: order.iter().map(|&i| model.region[i]).collect(),
        surface_elevation: order.iter().map(|&i| model.surface_elevation[i]).collect(),
        vertical_effective_stress: match model.numerics.operators {
            // Corners have an order of their own.
            Operators::Dual => model.vertical_effective_stress.clone(),
            Operators::Conservative | Operators::Printed => order
                .iter()
                .flat_map(|&i| [0, 1].map(|k| model.vertical_effective_stress[STRESS_NODES * i + k]))
                .collect(),
        },
        pore_pressure: order.iter().filter_map(|&i| model.pore_pressure.get(i).copied()).collect(),
        saturation: order.iter().filter_map(|&i| model.saturation.get(i).copied()).collect(),
        ..model.clone()
    };
    (sorted, order)
}
