//! Point clouds as scanners and drones deliver them. Every reader gives positions, colors and normals to the common last
//! step, and all else that a point carries as attributes ([`crate::mesh::attributes`]).

pub(super) mod e57;
mod guard;
pub(super) use guard::guarded;
pub(super) use roles::{attribute_name, kind_of};
pub(super) mod las;
pub(super) mod pcd;
mod roles;
mod sink;
pub(super) mod text;

use super::Error;
use super::job::ReadJob;
use super::part::PartFate;
use crate::mesh::attributes::AttributeColumn;
use crate::printable::printable;

/// Memory for kept points that a file may ask for whatever its size, in bytes, and the most unpacked bytes for a byte of
/// the file beyond it: compressed scans reach 60 times, only a file made for harm reaches more.
const FREE_BYTES: u64 = 24 << 20;
const LARGEST_RATIO: u64 = 256;

/// Refuses more points than the packed bytes can honestly stand for.
fn check_unpacked(
    job: &ReadJob<'_>,
    points: u64,
    point_bytes: u64,
    packed_bytes: u64,
) -> Result<(), Error> {
    let limit = packed_bytes.saturating_mul(LARGEST_RATIO).max(FREE_BYTES);
    let wanted = points.saturating_mul(point_bytes.max(1));
    if wanted > limit {
        return Err(job.too_large("unpacked bytes of points", wanted, limit));
    }
    job.check_vertices(points)
}

/// Keeps the columns that hold anything: an optional one that is zero everywhere says nothing. Lists all of them.
pub(super) fn keep_attributes(job: &mut ReadJob<'_>, columns: Vec<AttributeColumn>) {
    for column in columns {
        let name = format!("attribute {}", column.name);
        let count = column.values.len() as u64;
        let note = match column.range() {
            None => "no number".to_owned(),
            Some([low, high]) if low == high => format!("{low} everywhere"),
            Some([low, high]) => {
                let bytes = column.values.bytes_a_point();
                let plural = if bytes == 1 { "" } else { "s" };
                format!("{low} to {high}, {bytes} byte{plural} a point")
            }
        };
        job.inventory.add(name, count, PartFate::Kept, note);
        job.attributes.columns.push(column);
    }
}

/// The numbers of `N` bytes at `at`, zeros beyond the end of `bytes`.
#[inline]
fn bytes_at<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes
        .get(at..)
        .and_then(|rest| rest.first_chunk::<N>())
        .copied()
        .unwrap_or([0; N])
}

/// Most characters of the text of a coordinate system that are shown.
const MOST_SYSTEM_CHARS: usize = 1500;

/// The text of a coordinate system, in one line.
fn system_text(bytes: &[u8]) -> String {
    let bytes = &bytes[..bytes.len().min(4 * MOST_SYSTEM_CHARS)];
    let text = String::from_utf8_lossy(bytes);
    let words: Vec<&str> = text.trim_end_matches('\0').split_whitespace().collect();
    printable(&words.join(" "), MOST_SYSTEM_CHARS)
}

/// A text of a fixed field: up to its first zero, without what cannot be printed.
fn text_of(field: &[u8]) -> String {
    let end = field.iter().position(|&byte| byte == 0);
    super::text::shown(field[..end.unwrap_or(field.len())].trim_ascii())
}
