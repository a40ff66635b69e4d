//! The bytes of a glTF file: its description and its buffers, in one file (GLB), in data addresses or beside it.

use std::borrow::Cow;
use std::io::Read;
use std::path::{Component, Path};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::super::job::ReadJob;
use super::super::text::shown;
use super::super::{Error, FilePlace};
use super::document::GltfDocument;

/// Marks of GLB and of its chunks.
const MAGIC: &[u8] = b"glTF";
const JSON: u32 = 0x4e4f_534a;
const BINARY: u32 = 0x004e_4942;

/// The description as text, and the buffer that lies in the same file.
pub(super) struct GltfChunks<'a> {
    pub(super) json: &'a [u8],
    pub(super) binary: Option<&'a [u8]>,
}

/// Divides a file into its chunks; a file without the mark is the description itself.
pub(super) fn chunks<'a>(job: &ReadJob<'_>, data: &'a [u8]) -> Result<GltfChunks<'a>, Error> {
    if !data.starts_with(MAGIC) {
        return Ok(GltfChunks {
            json: data,
            binary: None,
        });
    }
    let word = |at: usize| {
        let bytes = data.get(at..).and_then(|rest| rest.first_chunk::<4>());
        bytes.map(|&bytes| u32::from_le_bytes(bytes))
    };
    if let Some(version) = word(4).filter(|&version| version != 2) {
        let reason = format!("GLB version {version}; version 2 is read");
        return Err(job.syntax(FilePlace::Byte(4), reason));
    }
    let (mut json, mut binary) = (None, None);
    let mut at = 12;
    while let (Some(length), Some(kind)) = (word(at), word(at + 4)) {
        let start = at + 8;
        let end = start + length as usize;
        let Some(chunk) = data.get(start..end) else {
            let missing = format!("a chunk of {length} bytes, {} are left", data.len() - start);
            return Err(job.truncated(FilePlace::Byte(at as u64), missing));
        };
        match kind {
            JSON if json.is_none() => json = Some(chunk),
            BINARY if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        at = end;
    }
    let Some(json) = json else {
        return Err(job.truncated(
            FilePlace::Byte(data.len().min(12) as u64),
            "the description",
        ));
    };
    Ok(GltfChunks { json, binary })
}

/// Gets the buffers that anything is read from.
pub(super) fn buffers<'a>(
    job: &ReadJob<'_>,
    document: &GltfDocument,
    binary: Option<&'a [u8]>,
) -> Result<Vec<Cow<'a, [u8]>>, Error> {
    let mut out = Vec::new();
    for (index, buffer) in document.buffers.iter().enumerate() {
        let is_used = document
            .buffer_views
            .iter()
            .any(|view| view.buffer == index);
        out.push(match &buffer.uri {
            _ if !is_used => Cow::Borrowed(&[][..]),
            None => Cow::Borrowed(binary.unwrap_or(&[])),
            Some(uri) => Cow::Owned(fetch(job, index, uri, buffer.byte_length)?),
        });
    }
    Ok(out)
}

/// Gets the bytes of an address: in the address itself, or a file in the folder of the model.
fn fetch(job: &ReadJob<'_>, index: usize, uri: &str, length: u64) -> Result<Vec<u8>, Error> {
    let fault = |reason: String| {
        let name = shown(uri.as_bytes());
        job.syntax(
            FilePlace::Byte(0),
            format!("buffer {index} (`{name}`) {reason}"),
        )
    };
    if let Some(data) = uri.strip_prefix("data:") {
        let text = data
            .split_once(";base64,")
            .map(|(_, text)| text)
            .ok_or_else(|| fault("is not in base64".to_owned()))?;
        return STANDARD
            .decode(text)
            .map_err(|error| fault(format!("is no base64: {error}")));
    }
    if uri.contains("://") {
        return Err(fault("is an address; addresses are not fetched".to_owned()));
    }
    let name = without_percents(uri);
    let path = Path::new(&name);
    let stays_below = path
        .components()
        .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    let Some(folder) = job.folder.filter(|_| stays_below) else {
        return Err(fault("is not in the folder of the model".to_owned()));
    };
    let file = std::fs::File::open(folder.join(path))
        .map_err(|error| fault(format!("cannot be read: {error}")))?;
    let limit = length.min(job.options.limits.file_bytes);
    let mut bytes = Vec::new();
    file.take(limit)
        .read_to_end(&mut bytes)
        .map_err(|error| fault(format!("cannot be read: {error}")))?;
    Ok(bytes)
}

/// A name whose bytes may be written as `%20`.
pub(super) fn without_percents(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        let hex = bytes.get(at + 1..at + 3).filter(|_| bytes[at] == b'%');
        let value = hex
            .and_then(|hex| std::str::from_utf8(hex).ok())
            .and_then(|hex| u8::from_str_radix(hex, 16).ok());
        match value {
            Some(value) => {
                out.push(value);
                at += 3;
            }
            None => {
                out.push(bytes[at]);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}
