//! Gets the bytes: a file, standard input, the inside of a gzip file. All in bounds, all can be cancelled.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;

use super::job::ReadJob;
use super::{Error, InputStream};
use crate::progress::Progress;

/// Bytes read between two looks at the progress.
const CHUNK: usize = 4 << 20;

/// Unpacked bytes that are always allowed, and the ratio allowed beyond. Text models pack 3 to 20 times; deflate
/// can reach 1032 times, which only a file made for harm does.
const FREE_UNPACKED_BYTES: u64 = 64 << 20;
const LARGEST_RATIO: u64 = 256;

/// Opens a file; with its length in bytes, 0 where it has none.
pub(super) fn open_file(path: &Path) -> Result<(File, u64), Error> {
    let open_error = |source| Error::Open {
        path: path.to_owned(),
        source,
    };
    let file = File::open(path).map_err(open_error)?;
    let length = file.metadata().map_err(open_error)?.len();
    Ok((file, length))
}

/// Reads a stream to its end. A memory map of a file would save one copy (some 30 ms for 100 MB), but a file that another
/// program shortens meanwhile would then end the process; a copy cannot change under the reader.
pub(super) fn read_all(
    stream: &mut InputStream<'_>,
    limit: u64,
    progress: &dyn Progress,
) -> Result<Vec<u8>, Error> {
    let (path, expected) = (stream.path, stream.expected_bytes);
    let too_large = |found| Error::TooLarge {
        path: path.to_owned(),
        what: "bytes",
        found,
        limit,
    };
    let open_error = |source| Error::Open {
        path: path.to_owned(),
        source,
    };
    if expected > limit {
        return Err(too_large(expected));
    }
    progress.stage("read", expected);
    let mut bytes = Vec::new();
    // One byte more than expected, so that the read that finds the end needs no larger buffer.
    let reserve = usize::try_from(expected.saturating_add(1)).unwrap_or(usize::MAX);
    bytes
        .try_reserve_exact(reserve)
        .map_err(|_| open_error(io::ErrorKind::OutOfMemory.into()))?;
    loop {
        let got = (&mut *stream.reader)
            .take(CHUNK as u64)
            .read_to_end(&mut bytes)
            .map_err(open_error)?;
        progress.advance(got as u64);
        if progress.is_cancelled() {
            return Err(Error::Cancelled);
        }
        if bytes.len() as u64 > limit {
            return Err(too_large(bytes.len() as u64));
        }
        if got == 0 {
            return Ok(bytes);
        }
    }
}

/// Tells whether the bytes begin like a gzip file (RFC 1952).
pub(super) fn is_gzip(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x1f, 0x8b])
}

/// Unpacks a gzip file of one or more members, within the limits.
pub(super) fn unpack(job: &ReadJob<'_>, packed: &[u8]) -> Result<Vec<u8>, Error> {
    job.progress.stage("unpack", packed.len() as u64);
    let by_ratio = (packed.len() as u64)
        .saturating_mul(LARGEST_RATIO)
        .max(FREE_UNPACKED_BYTES);
    let limit = by_ratio.min(job.options.limits.unpacked_bytes);
    let mut rest = packed;
    let mut unpacked = Vec::new();
    let mut decoder = MultiGzDecoder::new(&mut rest);
    let mut reported = 0;
    loop {
        // At most one byte over the limit is unpacked: enough to know.
        let room = limit
            .saturating_sub(unpacked.len() as u64)
            .saturating_add(1);
        let got = decoder
            .by_ref()
            .take(room.min(CHUNK as u64))
            .read_to_end(&mut unpacked);
        let done = packed.len() - decoder.get_ref().len();
        job.progress.advance((done - reported) as u64);
        reported = done;
        if job.progress.is_cancelled() {
            return Err(Error::Cancelled);
        }
        match got {
            Err(source) => {
                return Err(Error::Gzip {
                    path: job.path.to_owned(),
                    unpacked: unpacked.len() as u64,
                    source,
                });
            }
            Ok(0) => return Ok(unpacked),
            Ok(_) if unpacked.len() as u64 > limit => {
                return Err(job.too_large("unpacked bytes", unpacked.len() as u64, limit));
            }
            Ok(_) => {}
        }
    }
}
