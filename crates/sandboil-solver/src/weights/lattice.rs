//! Stencils of the undeformed lattice.

use crate::section::description::Model;
use sandboil_sph::{Vec2, WendlandQuintic, operators::Member};

/// Members of a stencil inside the undeformed lattice; its centre `at` is given relative to a node, m.
pub fn lattice(model: &Model, at: Vec2) -> Vec<Member> {
    let support = WendlandQuintic::new(model.smoothing_length()).support();
    let volume = model.cell();
    let reach = |spacing: f64, at: f64| ((support + at.abs()) / spacing).ceil();
    let (columns, rows) = (reach(model.spacing.x, at.x), reach(model.spacing.y, at.y));
    let span = |count: f64| (0..).map(move |k| f64::from(k) - count).take_while(move |k| *k <= count);
    span(columns)
        .flat_map(|column| span(rows).map(move |row| (column, row)))
        .map(|(column, row)| Vec2::new(column * model.spacing.x, row * model.spacing.y) - at)
        .filter(|offset| offset.norm() < support)
        .map(|offset| Member { owner: 0, source: 0, mirrored: false, offset, volume })
        .collect()
}
