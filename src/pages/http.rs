//! A file on a web server, read by ranges of bytes (RFC 9110, section 14).

use super::source::ByteSource;
use std::io::{self, Read};
use std::ops::Range;
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
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    use crate::pages::check::check;
    use crate::pages::file::PagedFile;
    use crate::pages::tests::{GeneratedShape, SMALL_PAGES, model};
    use crate::pages::write::to_bytes;
    use crate::progress::Silent;
    use std::io::{BufRead, BufReader, Write};
    use std::net::{TcpListener, TcpStream};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A server on this machine that sends ranges of one file; the path of a request says what it does wrong.
    struct FaultyServer {
        address: String,
        requests: Arc<AtomicUsize>,
    }

    impl FaultyServer {
        fn start(bytes: Vec<u8>) -> Self {
            let listener = TcpListener::bind("127.0.0.1:0").unwrap();
            let address = format!("http://{}", listener.local_addr().unwrap());
            let requests = Arc::new(AtomicUsize::new(0));
            let (bytes, count) = (Arc::new(bytes), requests.clone());
            std::thread::spawn(move || {
                for stream in listener.incoming() {
                    let (bytes, count) = (bytes.clone(), count.clone());
                    std::thread::spawn(move || serve(stream.unwrap(), &bytes, &count));
                }
            });
            Self { address, requests }
        }

        fn open(&self, path: &str) -> io::Result<HttpSource> {
            HttpSource::open(&format!("{}/{path}", self.address))
        }
    }

    fn serve(mut stream: TcpStream, bytes: &[u8], count: &AtomicUsize) {
        let mut lines = BufReader::new(stream.try_clone().unwrap()).lines();
        loop {
            let head: Vec<String> = (lines.by_ref())
                .map_while(Result::ok)
                .take_while(|line| !line.is_empty())
                .collect();
            let Some(first) = head.first() else { return };
            let number = count.fetch_add(1, Ordering::Relaxed);
            let path = first.split(' ').nth(1).unwrap().to_owned();
            let range = head.iter().find_map(|line| {
                let line = line.to_ascii_lowercase();
                let (from, to) = line.strip_prefix("range: bytes=")?.split_once('-')?;
                Some(from.parse::<usize>().unwrap()..to.parse::<usize>().unwrap() + 1)
            });
            let range = range.unwrap();
            let range = range.start..range.end.min(bytes.len());
            let body = &bytes[range.clone()];
            let tag = if path == "/changes" { number } else { 0 };
            let head = |status: &str, length: usize| {
                format!("HTTP/1.1 {status}\r\nContent-Length: {length}\r\nETag: \"{tag}\"\r\n")
            };
            let content = format!(
                "Content-Range: bytes {}-{}/{}\r\n",
                range.start,
                range.end - 1,
                bytes.len()
            );
            let mut send = |head: String, body: &[u8]| {
                let _ = stream.write_all(format!("{head}\r\n").as_bytes());
                let _ = stream.write_all(body);
            };
            match path.as_str() {
                "/whole" => send(head("200 OK", bytes.len()), bytes),
                "/none" => send(head("404 Not Found", 2), b"no"),
                "/breaks" if number > 0 => send(head("500 Internal Server Error", 0), b""),
                "/silent" => send(head("206 Partial Content", body.len()), body),
                "/short" => {
                    send(
                        head("206 Partial Content", body.len()) + &content,
                        &body[1..],
                    );
                    return;
                }
                _ => send(head("206 Partial Content", body.len()) + &content, body),
            }
        }
    }

    fn file_bytes() -> Vec<u8> {
        to_bytes(&model(GeneratedShape::Torus, 12_000, false), &SMALL_PAGES).unwrap()
    }

    #[test]
    fn a_file_is_read_by_ranges() {
        let bytes = file_bytes();
        assert!(bytes.len() as u64 > 2 * FIRST);
        let server = FaultyServer::start(bytes.clone());
        let source = Arc::new(server.open("torus.surfel").unwrap());
        assert_eq!(source.len(), bytes.len() as u64);
        let mut part = vec![0; 1000];
        for offset in [0, 60_000, 65_000, bytes.len() - 1000] {
            source.read_at(offset as u64, &mut part).unwrap();
            assert_eq!(part, bytes[offset..offset + 1000]);
        }
        // What is in the beginning is not asked for again.
        assert_eq!(server.requests.load(Ordering::Relaxed), 3);
        assert!(source.read_at(bytes.len() as u64 - 999, &mut part).is_err());
        let file = PagedFile::open(source).unwrap();
        assert_eq!(server.requests.load(Ordering::Relaxed), 3);
        let report = check(&file, &Silent);
        assert!(report.is_clean() && report.leaves == 12_000, "{report:?}");
    }

    #[test]
    fn servers_that_do_wrong_are_named() {
        let server = FaultyServer::start(file_bytes());
        for (path, wanted) in [
            ("whole", "sends whole files only"),
            ("none", "404"),
            ("silent", "does not say"),
            ("short", "of 65536 bytes"),
        ] {
            let error = server.open(path).unwrap_err().to_string();
            assert!(error.contains(wanted), "{path}: {error}");
        }
        for (path, wanted) in [("changes", "has changed"), ("breaks", "500")] {
            let server = FaultyServer::start(file_bytes());
            let source = server.open(path).unwrap();
            let error = source.read_at(100_000, &mut [0; 10]).unwrap_err();
            assert!(error.to_string().contains(wanted), "{path}: {error}");
        }
        assert!(HttpSource::open("http://127.0.0.1:1/a").is_err());
    }

    #[test]
    fn ranges_are_parsed() {
        assert_eq!(parsed("bytes 0-99/1234"), Some((0..100, 1234)));
        for wrong in [
            "bytes */12",
            "bytes 5-3/12",
            "0-1/2",
            "bytes 0-1/*",
            "bytes 0-18446744073709551615/2",
        ] {
            assert_eq!(parsed(wrong), None, "{wrong}");
        }
    }
}
