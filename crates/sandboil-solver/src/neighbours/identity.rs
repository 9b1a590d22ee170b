//! Identity of a free-field column: all input on which its motion in a stage depends.

use crate::{
    error::{SolverError, StateError},
    neighbours::free_field::{column_model, segment_at},
    section::{description::Model, edge_nodes::EdgeNodes, order::sorted, outline::Hand},
    stages::{gravity::Gravity, stage::Stage},
};

/// Identities of the columns of the left and the right side in a stage, for free-field sides. Columns with
/// equal bytes have the same motion, also in different sections. `gravity` is the static stage before, if
/// there is one.
///
/// # Errors
/// A description that cannot be written as bytes.
pub fn column_identities(
    model: &Model,
    gravity: Option<Gravity>,
    stage: impl Into<Stage>,
) -> Result<[Option<Vec<u8>>; 2], SolverError> {
    let stage = stage.into();
    let (model, _) = sorted(model);
    let edges = EdgeNodes::new(&model);
    let mut identities = [None, None];
    for hand in Hand::BOTH {
        let (true, Some(side)) = (stage.free_field()[hand as usize], model.outline.sides[hand as usize])
        else {
            continue;
        };
        let column = with_own_regions(column_model(&model, &edges, hand));
        let of_column = stage.of_column(segment_at(&stage, side.x), model.outline.lowest());
        let bytes = postcard::to_stdvec(&(column, gravity, of_column));
        identities[hand as usize] =
            Some(bytes.map_err(|_| StateError::Damaged("the description of a column cannot be written"))?);
    }
    Ok(identities)
}

/// The model without the regions that have no nodes in it.
fn with_own_regions(model: Model) -> Model {
    let mut used: Vec<u32> = model.region.clone();
    used.sort_unstable();
    used.dedup();
    let index = |region: &u32| used.binary_search(region).map_or(0, crate::section::node_id::id);
    Model {
        region: model.region.iter().map(index).collect(),
        regions: used.iter().map(|&region| model.regions[region as usize].clone()).collect(),
        ..model
    }
}
