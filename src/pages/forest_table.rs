//! The table of a forest: the files whose trees it joins, with the header of each.
//!
//! It lies between the header of the forest's own file and its first page. So a forest opens as fast as any file, whatever
//! the number of its trees; each of their files is opened when its first page is needed.

use super::format::{COLORS, FOREST, PagedHeader, TRIANGLES};
use crate::tree::file::hash;
use bytemuck::{Pod, Zeroable};

/// Longest name of a file, bytes.
pub(super) const LONGEST_PATH: usize = 4096;

/// A file of a forest.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ForestEntry {
    /// Path from the folder of the forest's file, with `/` between its parts; or an address of a web server.
    pub(super) path: String,
    /// Header of the file: one with another has changed.
    pub(super) header: PagedHeader,
}

/// The beginning of the table.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct TableStart {
    count: u32,
    pad: u32,
    /// Checksum of all that follows.
    checksum: u64,
}

/// Writes a table.
pub(super) fn encode(entries: &[ForestEntry]) -> Vec<u8> {
    let mut rest = Vec::new();
    for entry in entries {
        rest.extend((entry.path.len() as u32).to_le_bytes());
        rest.extend(entry.path.as_bytes());
        rest.extend(bytemuck::bytes_of(&entry.header));
    }
    let start = TableStart {
        count: entries.len() as u32,
        pad: 0,
        checksum: hash(&rest),
    };
    let mut bytes = bytemuck::bytes_of(&start).to_vec();
    bytes.append(&mut rest);
    bytes
}

/// Takes as many bytes off the front.
fn take<'a>(bytes: &mut &'a [u8], count: usize) -> Result<&'a [u8], String> {
    let (own, rest) = (bytes.split_at_checked(count))
        .ok_or_else(|| "the table of files ends too early".to_owned())?;
    *bytes = rest;
    Ok(own)
}

/// Reads the table of a forest with this header.
///
/// # Errors
/// What is wrong with it.
pub(super) fn decode(mut bytes: &[u8], forest: &PagedHeader) -> Result<Vec<ForestEntry>, String> {
    let start: TableStart =
        bytemuck::pod_read_unaligned(take(&mut bytes, size_of::<TableStart>())?);
    if start.pad != 0 || start.count == 0 || start.checksum != hash(bytes) {
        return Err("the checksum of the table of files is wrong".to_owned());
    }
    let mut entries = Vec::new();
    let (mut leaves, mut pages, mut end) = (0u64, forest.page_count, forest.file_length);
    for _ in 0..start.count {
        let length = take(&mut bytes, 4)?;
        let length = u32::from_le_bytes(length.try_into().unwrap_or_default()) as usize;
        if length == 0 || length > LONGEST_PATH {
            return Err("a file without a name, or with one too long".to_owned());
        }
        let path = str::from_utf8(take(&mut bytes, length)?)
            .map_err(|_| "the name of a file is no text".to_owned())?;
        let header: PagedHeader =
            bytemuck::pod_read_unaligned(take(&mut bytes, size_of::<PagedHeader>())?);
        let within = |(_, cause): (u64, String)| format!("the header of {path}: {cause}");
        header.validate(header.file_length).map_err(within)?;
        let kind = TRIANGLES | COLORS;
        if header.flags & FOREST != 0
            || header.flags & kind != forest.flags & kind
            || header.leaf_count == 0
            || header.root.id != 0
        {
            return Err(format!("{path} is of another kind than the whole"));
        }
        leaves = leaves.saturating_add(header.leaf_count);
        pages = pages.saturating_add(header.page_count);
        end = end.saturating_add(header.file_length);
        entries.push(ForestEntry {
            path: path.to_owned(),
            header,
        });
    }
    if !bytes.is_empty() {
        return Err("bytes behind the table of files".to_owned());
    }
    if leaves != forest.leaf_count {
        return Err("the files have another number of leaves than the whole".to_owned());
    }
    if pages > u64::from(u32::MAX) || end > u64::MAX / 2 {
        return Err("the files have more pages than can be numbered".to_owned());
    }
    Ok(entries)
}
