//! Amounts of a paged file that are read when it is opened.

use super::file::PagedFile;

/// Amount of a paged tree file that is read when it is opened.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PageReading {
    /// Pages of the whole file, joined to one model.
    #[default]
    Whole,
    /// Page that the others hang from. The model stands in for the others, and
    /// [`OpenedModel::paged`](crate::open::OpenedModel::paged) has the file, for
    /// [`PagedModel`](crate::render::paged_model::PagedModel).
    ByPage,
    /// Page that the others hang from, where pages have records of error patches; else all.
    ByPageWithRecords,
}

impl PageReading {
    /// Tells whether the pages of a file stay where they are.
    pub(crate) fn leaves_pages(self, file: &PagedFile) -> bool {
        match self {
            Self::Whole => false,
            Self::ByPage => true,
            Self::ByPageWithRecords => file.has_patches() || !file.is_surface(),
        }
    }
}
