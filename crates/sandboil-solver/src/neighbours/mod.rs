//! Ground beside a section that acts on it: free-field columns.

pub mod column;
pub mod free_field;
pub mod identity;
pub mod side_tables;
