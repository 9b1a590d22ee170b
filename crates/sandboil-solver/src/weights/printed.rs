//! Tables of the printed operators (Eqs 6, 8, 10 and 11).

use crate::{
    section::{
        description::STRESS_NODES,
        node_id::id,
        outline::{Condition, EdgesView},
    },
    weights::{
        images::Surroundings,
        lists::Lists,
        rows::{StrainTables, VectorWeight},
        stencils::{Stencils, real_only},
    },
};
use sandboil_sph::{
    Csr, GradientWeight, LeastSquaresFit, NeighbourList, Vec2,
    operators::{Member, consistent_fit, corrected_gradient, interpolation},
};

/// Tables of the printed operators (Eqs 6, 10, 11).
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct PrintedTables {
    /// Stress at velocity nodes from stress nodes, Eq. 10.
    pub interpolation: Csr<f64>,
    /// `V_j grad_i W_ij` from velocity node to real stress nodes.
    pub kernel_gradient: Csr<Vec2>,
    /// The same to the mirrored stress nodes beyond the edges; columns are the rows of `ghost_stress`.
    pub ghost_gradient: Csr<Vec2>,
    /// Linear extrapolation of Eq. 11 from velocity nodes to mirrored stress nodes.
    pub ghost_stress: Csr<f64>,
    /// Value at the mirror point, from velocity nodes: for the antisymmetric shear stress at the compliant
    /// base.
    pub mirror_stress: Csr<f64>,
    /// Gradient of Eq. 9 at velocity nodes, for the pore pressure.
    pub pressure_gradient: Csr<Vec2>,
    /// Whether a mirrored stress node lies below a base whose only shear traction is that of the dashpots.
    pub odd_shear: Vec<bool>,
}

/// Eq. 8 with the corrected kernel gradient and the linear fit as value at the stress node.
pub fn printed_strain_tables(stencils: &Stencils, list: &NeighbourList, points: &[Vec2]) -> StrainTables {
    let mut gradient = Csr::with_capacity(points.len(), list.pairs());
    let mut walls = Csr::with_capacity(points.len(), 0);
    for (s, &at) in points.iter().enumerate() {
        let members =
            stencils.including(&stencils.all(list, s, at), |image| image.strain[0] && image.strain[1]);
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

/// Tables of Eqs 6, 9, 10 and 11 as printed.
pub fn printed_tables(
    velocity: &Stencils,
    list: &Lists,
    points: &[Vec2],
    stress_points: &[Vec2],
    edges: EdgesView,
) -> PrintedTables {
    let (kernel, period) = (velocity.kernel, velocity.period);
    // Eq. 6 and Eq. 10 gather from stress nodes, each with half its velocity node's volume.
    let stress_volume: Vec<f64> =
        velocity.volume.iter().flat_map(|v| [v / STRESS_NODES as f64; STRESS_NODES]).collect();
    let around = Surroundings::new(stress_points, edges.outline, edges.walls, kernel.support());
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
        // No stress is continued beyond an edge under tractions.
        let shown = stencils.including(&members, |image| image.strain[0] || image.strain[1]);
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
        tables.odd_shear.push(image.below && edges.walls.base == Condition::FreeSlip);
    }
    tables
}
