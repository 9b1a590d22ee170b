//! Edges of a section in motion: dashpots, compliant base, contact.

pub mod base;
pub mod compliant_base;
pub mod contact;
pub mod dashpots;
