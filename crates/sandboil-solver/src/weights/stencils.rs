//! Stencils around one kind of queries.

use crate::weights::images::{Image, Surroundings};
use sandboil_sph::{
    Mat2, NeighbourList, Period, Vec2, WendlandQuintic,
    operators::{Member, stencil},
};

/// Stencils around one kind of queries, cut to the kernel's support.
pub struct Stencils<'a> {
    pub around: &'a Surroundings,
    pub volume: &'a [f64],
    pub kernel: WendlandQuintic,
    pub period: Option<Period>,
}

impl Stencils<'_> {
    /// The members around one query of a list.
    pub fn all(&self, list: &NeighbourList, query: usize, at: Vec2) -> Vec<Member> {
        stencil(list, query, at, &self.around.sources, self.volume, self.kernel, self.period)
    }

    /// The nodes among `members`, and the images for which `is_included` is true.
    pub fn including(&self, members: &[Member], is_included: impl Fn(&Image) -> bool) -> Vec<Member> {
        members.iter().copied().filter(|m| self.around.image(m.source).is_none_or(&is_included)).collect()
    }

    /// Map from the velocity of a member's node to that of the member.
    pub fn map(&self, member: &Member) -> Mat2 {
        self.around.image(member.source).map_or_else(Mat2::identity, |image| image.map)
    }
}

/// The members that are nodes.
pub fn real_only(members: &[Member]) -> Vec<Member> {
    members.iter().copied().filter(|m| !m.mirrored).collect()
}
