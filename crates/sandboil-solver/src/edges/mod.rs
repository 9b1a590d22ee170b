//! Edges of a moving section: dashpots, compliant base, contact of single nodes.

pub mod base;
pub mod compliant_base;
pub mod contact;
pub mod dashpots;
