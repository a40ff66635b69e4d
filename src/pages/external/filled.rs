//! The leaf pages of all chunks, and what lies above them.

use super::skeleton::TreeSkeleton;
use super::spool::SpooledTops;
use super::{ExternalError, ExternalReport, ModelSpace};
use crate::mesh::stream::StreamFacts;
use crate::pages::format::HEADER;
use crate::pages::page_tops::TopSource;
use crate::pages::upper::{LeafPageFacts, LeafPages, UpperPages, upper_pages};
use crate::pages::write::header_of;
use crate::tree::{ClosedEvidence, Model};

/// What is known of the leaf pages once all are written.
#[derive(Default)]
pub(super) struct FilledPages {
    pub(super) pages: Vec<LeafPageFacts>,
    /// First levels of the pages.
    pub(super) tops: Option<SpooledTops>,
    /// The farthest that a vertex was moved.
    pub(super) moved: f64,
    pub(super) evidence: ClosedEvidence,
    /// The farthest of a vertex from the middle of the box.
    pub(super) reach: f64,
}

impl FilledPages {
    /// Makes what lies above the leaf pages of a model with these nodes in this space.
    ///
    /// # Errors
    /// The temporary file cannot be read; more pages than 32 bits can number.
    pub(super) fn upper(
        mut self,
        mut skeleton: TreeSkeleton,
        space: ModelSpace,
        (facts, report): (&StreamFacts, &ExternalReport),
    ) -> Result<UpperPages, ExternalError> {
        let is_surface = !facts.is_cloud();
        skeleton.join(is_surface);
        let leaf_level = skeleton.leaf_level();
        let shared = skeleton.shared();
        let (tree, sizes) = skeleton.into_parts();
        let model = Model {
            tree,
            origin: space.origin(),
            min: space.min,
            max: space.max,
            orbit_center: space.center(),
            orbit_radius: self.reach as f32,
            is_closed: is_surface && self.evidence.is_closed(),
            has_colors: facts.has_colors,
            ..Model::default()
        };
        let mut header = header_of(&model, is_surface);
        (header.leaf_count, header.node_count) = (report.leaves, report.nodes);
        let leaves = LeafPages {
            patches: None,
            level: leaf_level,
            first_byte: HEADER as u64,
            pages: &self.pages,
            sizes: &sizes,
            shared,
            moved: self.moved,
        };
        let tops: &mut dyn TopSource = match &mut self.tops {
            Some(tops) => tops,
            None => &mut Vec::new().into_iter(),
        };
        Ok(upper_pages(&model, &leaves, tops, header)?)
    }
}
