//! The first levels of leaf pages, which the page above them has as well.
//!
//! A leaf page is read only where one of its nodes some levels below its root is too large for a splat. So a page that is read
//! gives many splats, and little of what is read is finer than the picture. Without these levels a page whose root is just
//! too large brought a thousand times what was drawn of it, and as many pages were opened as splats were drawn.

use crate::tree::{NodeRecords, Tree};

/// Levels that a leaf page with so many levels of nodes has in common with the page above: its root's, and the next.
pub(super) fn shared_levels(page_levels: usize) -> usize {
    page_levels.saturating_sub(3).min(2)
}

/// Number of records that a leaf page has in common with the page above.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TopSize {
    /// Nodes, with the root.
    pub(super) nodes: u32,
    /// Nodes of the level below these, which are leaves of the page above.
    pub(super) leaves: u32,
}

impl TopSize {
    /// Of a page that is a leaf of the page above.
    pub(super) const ALONE: Self = Self {
        nodes: 0,
        leaves: 1,
    };

    /// Sizes for all nodes of a level, by the numbers of children of that level and of those below it: as many levels as are
    /// shared.
    pub(super) fn of_level(levels: &[Vec<u8>], root_count: usize) -> Vec<Self> {
        let mut sizes = vec![Self::ALONE; root_count];
        let mut at = vec![0usize; levels.len()];
        for size in &mut sizes {
            let mut own = 1u32;
            for (counts, at) in levels.iter().zip(&mut at) {
                size.nodes += own;
                let end = (*at + own as usize).min(counts.len());
                own = counts[*at..end].iter().map(|&count| u32::from(count)).sum();
                *at = end;
            }
            size.leaves = own;
        }
        sizes
    }

    /// Sizes for all nodes of a level of a tree.
    pub(super) fn of_tree(tree: &Tree, level: usize, shared: usize) -> Vec<Self> {
        let counts = |level| {
            let nodes = tree.level(level);
            nodes
                .map(|id| tree.nodes[id as usize].child_count)
                .collect()
        };
        let levels: Vec<Vec<u8>> = (level..level + shared).map(counts).collect();
        Self::of_level(&levels, tree.level(level).len())
    }
}

/// Records of the first levels of a leaf page, as they are decoded, in model space: breadth-first, the level below them too.
#[derive(Debug, Clone, Default)]
pub(super) struct PageTop(pub(super) Vec<NodeRecords>);

/// Tops of leaf pages in the order of the file.
pub(super) trait TopSource {
    /// The top of the next page.
    ///
    /// # Errors
    /// The disk that has it cannot be read.
    fn next_top(&mut self) -> std::io::Result<PageTop>;
}

impl TopSource for std::vec::IntoIter<PageTop> {
    fn next_top(&mut self) -> std::io::Result<PageTop> {
        Ok(self.next().unwrap_or_default())
    }
}
