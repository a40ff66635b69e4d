//! Paged trees: of a file, of memory, or on a web server.

use super::{OpenOptions, SourceContent, SourceFormat, memory_need};
use crate::Error;
use crate::input::{self, FileCounts};
use crate::pages::file::PagedFile;
#[cfg(feature = "remote")]
use crate::pages::format::{MAGIC, is_paged_file};
#[cfg(feature = "remote")]
use crate::pages::http::HttpSource;
use crate::pages::join;
use crate::pages::source::ByteSource;
use crate::progress::Progress;
use crate::tree;
use std::sync::Arc;

/// Tells whether a name is an address: a scheme, `://` and more.
pub(super) fn is_address(name: &str) -> bool {
    name.split_once("://").is_some_and(|(scheme, _)| {
        scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && scheme
                .chars()
                .all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    })
}

/// Reads a paged file: its first page where pages are streamed, else all of them.
pub(super) fn read_pages(
    source: Arc<dyn ByteSource>,
    options: &OpenOptions,
    progress: &dyn Progress,
) -> Result<SourceContent, Error> {
    let file_bytes = source.len();
    let file = PagedFile::open(source).map_err(tree::Error::from)?;
    if options.page_reading.leaves_pages(&file) && options.keep.is_empty() {
        let model = file.stand_in(file.origin()).map_err(tree::Error::from)?;
        return Ok(SourceContent {
            format: SourceFormat::PagedTree,
            counts: FileCounts {
                vertices: if file.is_surface() {
                    0
                } else {
                    file.header().leaf_count
                },
                faces: if file.is_surface() {
                    file.header().leaf_count
                } else {
                    0
                },
            },
            paged: Some(file),
            ..SourceContent::tree(model, file_bytes)
        });
    }
    memory_need::check_pages(&file, options.memory_bytes)?;
    let model = join::whole_model(&file, progress)?;
    Ok(SourceContent {
        format: SourceFormat::PagedTree,
        ..SourceContent::tree(model, file_bytes)
    })
}

/// Reads a paged file on a web server.
#[cfg(feature = "remote")]
pub(super) fn read_address(
    url: &str,
    options: &OpenOptions,
    progress: &dyn Progress,
) -> Result<SourceContent, Error> {
    let failed = |cause: String| input::Error::Fetch {
        url: url.to_owned(),
        cause,
    };
    let source = HttpSource::open(url);
    let source = source.map_err(|error| failed(error.to_string()))?;
    let mut start = [0; MAGIC.len()];
    let read = source.read_at(0, &mut start);
    if read.is_err() || !is_paged_file(&start) {
        let cause = "not a paged tree, the only kind of file that is read over a network; download it, or put one there (surfel build)";
        return Err(failed(cause.to_owned()).into());
    }
    read_pages(Arc::new(source), options, progress)
}

/// Refuses all addresses.
#[cfg(not(feature = "remote"))]
pub(super) fn read_address(
    url: &str,
    _options: &OpenOptions,
    _progress: &dyn Progress,
) -> Result<SourceContent, Error> {
    let url = url.to_owned();
    Err(input::Error::Remote { url }.into())
}
