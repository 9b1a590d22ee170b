//! Free-field columns: ground beside a section, which acts on the section.

pub mod column;
pub mod free_field;
pub mod identity;
pub mod side_tables;
