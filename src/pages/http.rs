//! A file on a web server, read by ranges of bytes (RFC 9110, section 14).

use super::source::ByteSource;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use std::io::{self, Read};
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;
use ureq::Agent;
use ureq::http::{HeaderMap, StatusCode, header};

/// Bytes that are asked for at first: the header and, of all but odd files, the first page.
const FIRST: u64 = 64 << 10;

/// The longest wait for a server to be reached; to answer; and between two pieces of an answer.
const CONNECT: Duration = Duration::from_secs(10);
const ANSWER: Duration = Duration::from_secs(30);
const BODY: Duration = Duration::from_secs(60);

/// Requests at once: a page is small, and most of the time of each goes into waiting.
const AT_ONCE: usize = 8;

/// A file on a web server. Nothing is kept but its beginning; a file that changes on the server meanwhile gives errors.
#[derive(Debug)]
pub struct HttpSource {
    url: String,
    agent: Agent,
    length: u64,
    /// The server's name for this state of the file.
    tag: Option<String>,
    start: Vec<u8>,
}

/// The answer to one request.
struct RangeAnswer {
    bytes: Vec<u8>,
    /// Bytes of the whole file.
    length: u64,
    tag: Option<String>,
}

impl HttpSource {
    /// Asks for the beginning of the file, in one request.
    ///
    /// # Errors
    /// The server cannot be reached, has no such file, or gives no ranges.
    pub fn open(url: &str) -> io::Result<Self> {
        let agent: Agent = Agent::config_builder()
            .http_status_as_error(false)
            .timeout_connect(Some(CONNECT))
            .timeout_recv_response(Some(ANSWER))
            .timeout_recv_body(Some(BODY))
            .max_idle_connections_per_host(2 * AT_ONCE)
            .user_agent(concat!("surfel/", env!("CARGO_PKG_VERSION")))
            .build()
            .into();
        let answer = ask(&agent, url, 0..FIRST)?;
        Ok(Self {
            url: url.to_owned(),
            agent,
            length: answer.length,
            tag: answer.tag,
            start: answer.bytes,
        })
    }
}

/// Asks for a range, of which a file that ends within it gives the first part.
fn ask(agent: &Agent, url: &str, range: Range<u64>) -> io::Result<RangeAnswer> {
    let wanted = format!("bytes={}-{}", range.start, range.end - 1);
    let mut response = agent
        .get(url)
        .header(header::RANGE, wanted)
        .call()
        .map_err(|error| io::Error::other(error.to_string()))?;
    match response.status() {
        StatusCode::PARTIAL_CONTENT => {}
        StatusCode::OK => {
            return Err(io::Error::other(
                "the server sends whole files only; download it, or use a server that sends ranges of bytes, such as nginx",
            ));
        }
        status => return Err(io::Error::other(format!("the server answers {status}"))),
    }
    let tag = text(response.headers(), header::ETAG);
    let content = text(response.headers(), header::CONTENT_RANGE).and_then(|text| parsed(&text));
    let Some((sent, length)) = content else {
        return Err(io::Error::other("the server does not say what it sends"));
    };
    if sent.start != range.start || sent.end > range.end || sent.end > length {
        return Err(io::Error::other("the server sends another range"));
    }
    let count = sent.end - sent.start;
    let mut bytes = Vec::new();
    let mut body = response.body_mut().as_reader().take(count);
    let read = body.read_to_end(&mut bytes);
    if let Err(error) = read {
        let cause = format!(
            "the answer ends after {} of {count} bytes: {error}",
            bytes.len()
        );
        return Err(io::Error::other(cause));
    }
    if bytes.len() as u64 != count {
        let cause = format!("the answer ends after {} of {count} bytes", bytes.len());
        return Err(io::Error::other(cause));
    }
    Ok(RangeAnswer { bytes, length, tag })
}

/// A header as text, where it is there and is text.
fn text(headers: &HeaderMap, name: header::HeaderName) -> Option<String> {
    Some(headers.get(name)?.to_str().ok()?.to_owned())
}

/// The range and the length of the file of a `Content-Range`, such as `bytes 0-99/1234`.
fn parsed(text: &str) -> Option<(Range<u64>, u64)> {
    let (range, length) = text.strip_prefix("bytes ")?.split_once('/')?;
    let (first, last) = range.split_once('-')?;
    let (first, last): (u64, u64) = (first.parse().ok()?, last.parse().ok()?);
    let length = length.parse().ok()?;
    (first <= last).then_some((first..last.checked_add(1)?, length))
}

impl ByteSource for HttpSource {
    fn name(&self) -> &str {
        &self.url
    }

    fn len(&self) -> u64 {
        self.length
    }

    fn parallel_reads(&self) -> usize {
        AT_ONCE
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let end = offset.checked_add(out.len() as u64);
        let Some(end) = end.filter(|&end| end <= self.length) else {
            return Err(io::ErrorKind::UnexpectedEof.into());
        };
        if out.is_empty() {
            return Ok(());
        }
        if end <= self.start.len() as u64 {
            out.copy_from_slice(&self.start[offset as usize..end as usize]);
            return Ok(());
        }
        let answer = ask(&self.agent, &self.url, offset..end)?;
        if answer.length != self.length || answer.tag != self.tag {
            return Err(io::Error::other(
                "the file on the server has changed; open it again",
            ));
        }
        if answer.bytes.len() != out.len() {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        out.copy_from_slice(&answer.bytes);
        Ok(())
    }

    fn beside(&self, path: &str) -> io::Result<Arc<dyn ByteSource>> {
        let address = address_beside(&self.url, path)
            .ok_or_else(|| io::Error::other(format!("{path} lies outside of {}", self.url)))?;
        let named = |error: io::Error| io::Error::new(error.kind(), format!("{address}: {error}"));
        Ok(Arc::new(Self::open(&address).map_err(named)?))
    }
}

/// Characters that a path has no other way in an address (RFC 3986, section 3.3).
const ESCAPED: &AsciiSet = &NON_ALPHANUMERIC
    .remove(b'-')
    .remove(b'.')
    .remove(b'_')
    .remove(b'~')
    .remove(b'/');

/// The address of a file by its path from the folder of another; `None` where that leads out of the server.
fn address_beside(url: &str, path: &str) -> Option<String> {
    let end = url.find(['?', '#']).unwrap_or(url.len());
    let server = url.find("://")? + 3;
    let server = server + url[server..end].find('/')?;
    let (server, folder) = url[..end].split_at(server);
    let mut parts: Vec<String> = folder.split('/').map(str::to_owned).collect();
    parts.pop();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." if parts.len() > 1 => drop(parts.pop()),
            ".." => return None,
            part => parts.push(utf8_percent_encode(part, ESCAPED).to_string()),
        }
    }
    Some(format!("{server}{}", parts.join("/")))
}

#[cfg(test)]
mod tests;
