//! Memory that a model takes as a whole, beside what is free: what does not fit is refused before it is read, since the system
//! would end the program in the middle.

use super::{ModelSource, OpenOptions, open_stream};
use crate::free_memory;
use crate::input;
use crate::pages;
use crate::pages::file::PagedFile;
use crate::progress::SilentProgress;
use crate::tree;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Bytes of memory of a triangle or point with its share of vertices and nodes while the tree is built, at least. Meshes of 8,
/// 16 and 50 million triangles were seen to take 111, 110 and 127, clouds of 4 and 16 million points 117.
const BUILT_BYTES: u64 = 110;

/// Bytes of memory of a leaf of a paged file while all pages are joined, at least. A surface of 8 million triangles was seen to
/// take 176, a cloud of 16 million points 172.
const JOINED_BYTES: u64 = 170;

/// Bytes of memory for a byte of a file, at most: of the best packed points two bytes are one point.
const MOST_PACKED: u64 = 60;

/// Memory that a model takes as a whole, which is more than there is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MemoryNeed {
    /// Name of what takes it, for messages.
    pub what: String,
    /// Bytes that it takes, at least.
    pub needed: u64,
    /// Bytes that there are.
    pub free: u64,
    /// The model can be built piece by piece into a file that opens at once.
    pub is_streamed: bool,
}

impl MemoryNeed {
    /// Need of a source that takes more memory as a whole than `options` allow, or than is free; `None` where it fits, and
    /// where that cannot be told before it is read. Looks at the beginning of the file alone.
    pub fn of(source: &ModelSource, options: &OpenOptions) -> Option<Self> {
        let free = options.memory_bytes.or_else(free_memory::with_swap)?;
        let need = match source {
            ModelSource::File(path) => of_file(path, source, options, free)?,
            ModelSource::Generator(_) => of_stream(source, options)?,
            ModelSource::StandardInput | ModelSource::Scene(_) | ModelSource::Address(_) => {
                return None;
            }
        };
        (need.needed > free).then_some(Self { free, ..need })
    }

    /// The error of opening it nevertheless, by the name it was given.
    pub(super) fn refused(self, path: &Path) -> input::Error {
        let name = path.display();
        let advice = match self.is_streamed {
            true => format!("build a file that opens at once: surfel build {name} -o FILE.surfel"),
            false => "convert it to binary PLY, LAS or LAZ, and surfel build makes a file of that which opens at once"
                .to_owned(),
        };
        input::Error::NeedsMemory {
            path: PathBuf::from(path),
            what: self.what,
            needed: self.needed,
            free: self.free,
            advice,
        }
    }
}

fn of_file(
    path: &Path,
    source: &ModelSource,
    options: &OpenOptions,
    free: u64,
) -> Option<MemoryNeed> {
    // A pipe is opened once, by its reader.
    let metadata = (std::fs::metadata(path).ok()).filter(std::fs::Metadata::is_file)?;
    if metadata.len().saturating_mul(MOST_PACKED) <= free {
        return None;
    }
    let mut start = Vec::new();
    let file = File::open(path).ok()?;
    file.take(64).read_to_end(&mut start).ok()?;
    if pages::format::is_paged_file(&start) {
        return None;
    }
    let streamed = match tree::file::is_tree_file(&start) {
        true => None,
        false => of_stream(source, options),
    };
    // At least what it is stored in.
    Some(streamed.unwrap_or(MemoryNeed {
        what: "all of it".to_owned(),
        needed: metadata.len(),
        free,
        is_streamed: false,
    }))
}

fn of_stream(source: &ModelSource, options: &OpenOptions) -> Option<MemoryNeed> {
    let mut plain = options.clone();
    // Colors by an attribute take no less.
    plain.input.color = None;
    // What is damaged is told by its reader.
    let opened = open_stream(source, &plain, &SilentProgress).ok()??;
    let facts = opened.stream.facts();
    let (items, noun) = match facts.is_cloud() {
        true => (facts.vertices, "points"),
        false => (facts.faces, "faces"),
    };
    Some(MemoryNeed {
        what: format!("its {items} {noun} as a whole"),
        needed: items.saturating_mul(BUILT_BYTES),
        free: 0,
        is_streamed: true,
    })
}

/// Refuses a paged file that takes more memory as a whole than `limit` bytes, or than is free.
///
/// # Errors
/// [`input::Error::NeedsMemory`].
pub(super) fn check_pages(file: &PagedFile, limit: Option<u64>) -> Result<(), input::Error> {
    let leaves = file.header().leaf_count;
    let needed = leaves.saturating_mul(JOINED_BYTES);
    match limit.or_else(free_memory::with_swap) {
        Some(free) if needed > free => Err(input::Error::NeedsMemory {
            path: PathBuf::from(file.name()),
            what: format!("its {leaves} triangles or points as a whole"),
            needed,
            free,
            advice: "draw it page by page: leave out what needs all of it, such as photographs, a part that is kept, or \
                     another --method"
                .to_owned(),
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failing test panics")]

    use super::*;
    use crate::open::open;
    use crate::pages::reading::PageReading;
    use crate::pages::write::{PagedOptions, to_bytes};

    fn options(memory_bytes: u64) -> OpenOptions {
        OpenOptions {
            memory_bytes: Some(memory_bytes),
            page_reading: PageReading::ByPage,
            ..OpenOptions::default()
        }
    }

    fn refusal(path: &Path, memory_bytes: u64) -> String {
        let error = open(path, &options(memory_bytes), &SilentProgress).unwrap_err();
        error.to_string()
    }

    #[test]
    fn what_takes_more_memory_than_there_is_is_refused_with_the_way_out() {
        let folder = tempfile::tempdir().unwrap();
        let ply = folder.path().join("points.ply");
        let mut bytes =
            b"ply\nformat binary_little_endian 1.0\nelement vertex 1000\nproperty float x\n\
            property float y\nproperty float z\nend_header\n"
                .to_vec();
        for i in 0..1000 {
            bytes.extend(
                [i as f32, (i * i % 97) as f32, 0.0]
                    .map(f32::to_le_bytes)
                    .concat(),
            );
        }
        std::fs::write(&ply, bytes).unwrap();
        let text = refusal(&ply, 109_999);
        for part in ["its 1000 points", "110.0 kB", "surfel build", "points.ply"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let opened = open(&ply, &options(110_000), &SilentProgress).unwrap();
        assert_eq!(opened.model.vertices.len(), 1000);
        // A paged file is as large as one likes, unless all of it is wanted; a whole tree is not.
        let paged = folder.path().join("paged.surfel");
        let in_pages = to_bytes(&opened.model, &PagedOptions::default());
        std::fs::write(&paged, in_pages.unwrap()).unwrap();
        assert!(open(&paged, &options(10), &SilentProgress).is_ok());
        let all_of_it = |memory_bytes| OpenOptions {
            page_reading: PageReading::Whole,
            ..options(memory_bytes)
        };
        let refused = open(&paged, &all_of_it(169_999), &SilentProgress);
        let text = refused.unwrap_err().to_string();
        assert!(text.contains("draw it page by page"), "{text}");
        assert!(open(&paged, &all_of_it(170_000), &SilentProgress).is_ok());
        let whole = folder.path().join("whole.surfel");
        tree::file::write(&opened.model, &whole).unwrap();
        assert!(refusal(&whole, 10_000).contains("convert it"));
        // What is not read in pieces takes at least its bytes.
        let obj = folder.path().join("text.obj");
        std::fs::write(&obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        assert!(refusal(&obj, 20).contains("binary PLY"));
        assert!(open(&obj, &options(40), &SilentProgress).is_ok());
        let generated = Path::new("generate:sphere:1000");
        assert!(refusal(generated, 50_000).contains("faces"));
        assert!(open(generated, &options(200_000), &SilentProgress).is_ok());
    }

    #[test]
    fn what_the_system_has_is_the_usual_limit() {
        let source = ModelSource::parse(Path::new("generate:sphere:4000000000")).unwrap();
        let need = MemoryNeed::of(&source, &OpenOptions::default());
        // Where the system says what is free, it is less than 400 GB.
        assert_eq!(need.is_some(), free_memory::with_swap().is_some());
    }
}
