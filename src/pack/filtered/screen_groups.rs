//! Neighbouring filtered splats of a list, with the rows of the picture that each few of them may touch.

use crate::abi::FilteredSplat;
use crate::abi::constants::LARGEST_SMALL_BLENDED_PX;

/// Splats whose rows are known together. They lie near each other, in the order of the tree.
const GROUP: usize = 16;

/// Consecutive splats of a list that lie near each other.
#[derive(Debug, Clone, Copy, Default)]
struct ScreenGroup {
    /// Index of the first splat, and how many there are.
    first: u32,
    count: u16,
    /// The first row that they may touch, and one past the last.
    rows: [u16; 2],
}

/// The splats of a list in groups of neighbours, as the processor's renderer goes through them.
#[derive(Debug, Default)]
pub struct ScreenGroups {
    groups: Vec<ScreenGroup>,
    /// Some are larger than [`LARGEST_SMALL_BLENDED_PX`].
    has_large: bool,
}

impl ScreenGroups {
    /// Groups of a list without gaps.
    pub fn of(splats: &[FilteredSplat]) -> Self {
        let mut groups = Self::default();
        groups.add(0, splats);
        groups
    }

    /// Adds splats whose first lies at index `first` of the list.
    pub(crate) fn add(&mut self, first: usize, splats: &[FilteredSplat]) {
        let groups = splats.chunks(GROUP).enumerate();
        self.groups
            .extend(groups.map(|(index, splats)| ScreenGroup {
                first: (first + index * GROUP) as u32,
                count: splats.len() as u16,
                rows: rows_of(splats),
            }));
        let is_large = |splat: &FilteredSplat| splat.side_px > LARGEST_SMALL_BLENDED_PX;
        self.has_large |= splats.iter().any(is_large);
    }

    /// Adds the groups of another part of the list.
    pub(crate) fn append(&mut self, mut others: Self) {
        self.groups.append(&mut others.groups);
        self.has_large |= others.has_large;
    }

    /// Tells whether no splat is larger than [`LARGEST_SMALL_BLENDED_PX`], the limit of compute and of the processor's
    /// renderer.
    pub fn are_small(&self) -> bool {
        !self.has_large
    }

    /// The groups, as slices of `splats`, that may touch a row from `rows[0]` up to and without `rows[1]`. May give too
    /// many, never too few.
    pub(crate) fn in_rows<'a>(
        &'a self,
        splats: &'a [FilteredSplat],
        [first, end]: [u32; 2],
    ) -> impl Iterator<Item = &'a [FilteredSplat]> {
        self.groups
            .iter()
            .filter(move |group| u32::from(group.rows[0]) < end && u32::from(group.rows[1]) > first)
            .map(|group| &splats[group.first as usize..][..usize::from(group.count)])
    }
}

/// The rows that splats may touch; none where they are no numbers.
fn rows_of(splats: &[FilteredSplat]) -> [u16; 2] {
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    for splat in splats {
        // Half of the larger of square and rectangle, and what rounding to steps moves.
        let reach = 0.5 * splat.side_px.max(splat.extent_px[1]).max(1.0) + 1.0 / 64.0;
        low = low.min(splat.window_px[1] - reach);
        high = high.max(splat.window_px[1] + reach);
    }
    // Saturating: what lies outside of all pictures stays outside.
    [low as u16, high.ceil() as u16]
}
