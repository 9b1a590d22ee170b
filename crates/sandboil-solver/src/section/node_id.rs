//! Indices of nodes in tables.

#[allow(clippy::cast_possible_truncation)] // node counts stay far below 2^32
pub(crate) fn id(index: usize) -> u32 {
    index as u32
}
