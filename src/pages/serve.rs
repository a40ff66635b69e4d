//! A small web server for the files of a folder, with ranges of bytes (RFC 9110, section 14): to try how paged files open over a
//! network, of any delay and speed, on one machine.
//!
//! It answers GET and HEAD of HTTP/1.1, one thread a connection. What lies outside of the folder is not there. It knows neither
//! encryption nor users: for anything but trying there are nginx and the like.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant, UNIX_EPOCH};

/// Bytes of a request's head at most, and its headers.
const LARGEST_HEAD: u64 = 16 << 10;
const MOST_HEADERS: usize = 64;

/// Connections at once.
const MOST_CONNECTIONS: usize = 256;

/// A connection that asks nothing for so long is closed.
const IDLE: Duration = Duration::from_secs(120);
/// Time for which the rest of a request that was refused is read.
const LINGER: Duration = Duration::from_millis(500);

/// Bytes that are sent at once: a slow line is shared by pieces of this size.
const PIECE: usize = 16 << 10;

/// Limits that make the line to the server slow.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SlowLine {
    /// Time that goes by before each answer, and once more for each new connection: the way there and back.
    pub delay: Duration,
    /// Bytes a second of all connections together; `None` for as fast as it goes.
    pub bytes_per_second: Option<f64>,
}

/// State that all connections share.
#[derive(Debug)]
struct SharedServer {
    folder: PathBuf,
    line: SlowLine,
    /// Time at which the line will be free.
    free: Mutex<Instant>,
    connections: AtomicUsize,
    requests: AtomicUsize,
}

/// A server that answers until the process ends.
#[derive(Debug)]
pub struct FileServer {
    listener: TcpListener,
    shared: Arc<SharedServer>,
}

/// A request, as far as it is understood.
#[derive(Debug, Default, PartialEq)]
struct FileRequest {
    path: String,
    is_head: bool,
    /// Header `Range`, where it names one range of bytes.
    range: Option<AskedRange>,
    /// Header `If-Range`.
    if_range: Option<String>,
    closes: bool,
}

/// A range as it is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum AskedRange {
    /// First and last byte, both included; without a last one to the end.
    From(u64, Option<u64>),
    /// Number of bytes at the end.
    Last(u64),
}

impl AskedRange {
    /// Range of a header such as `bytes=0-99`; `None` where it is no range, or several.
    fn parse(text: &str) -> Option<Self> {
        let (first, last) = text.trim().strip_prefix("bytes=")?.split_once('-')?;
        let number = |text: &str| text.trim().parse::<u64>().ok();
        match (first.trim(), last.trim()) {
            ("", count) => Some(Self::Last(number(count)?)),
            (first, "") => Some(Self::From(number(first)?, None)),
            (first, last) => {
                let (first, last) = (number(first)?, number(last)?);
                (first <= last).then_some(Self::From(first, Some(last)))
            }
        }
    }

    /// The bytes of a file of this length; `None` where it has none of them.
    fn of(self, length: u64) -> Option<Range<u64>> {
        let range = match self {
            Self::From(first, last) => {
                first..last.map_or(length, |last| last.saturating_add(1).min(length))
            }
            Self::Last(count) => length.saturating_sub(count)..length,
        };
        (range.start < range.end).then_some(range)
    }
}

impl FileServer {
    /// Listens at an address; port 0 is any that is free.
    ///
    /// # Errors
    /// The folder is none, or the system does not give the address.
    pub fn bind(folder: &Path, address: SocketAddr, line: SlowLine) -> io::Result<Self> {
        let folder = folder.canonicalize()?;
        if !folder.is_dir() {
            return Err(io::Error::new(io::ErrorKind::NotADirectory, "not a folder"));
        }
        Ok(Self {
            listener: TcpListener::bind(address)?,
            shared: Arc::new(SharedServer {
                folder,
                line,
                free: Mutex::new(Instant::now()),
                connections: AtomicUsize::new(0),
                requests: AtomicUsize::new(0),
            }),
        })
    }

    /// The address that it listens at.
    ///
    /// # Errors
    /// The system's.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Counts the requests so far, to be read while it runs.
    pub fn request_counter(&self) -> impl Fn() -> usize + Send + 'static + use<> {
        let shared = self.shared.clone();
        move || shared.requests.load(Ordering::Relaxed)
    }

    /// Answers until the listener fails.
    ///
    /// # Errors
    /// The system's, when it gives no more connections.
    pub fn run(self) -> io::Result<()> {
        loop {
            let (stream, _) = match self.listener.accept() {
                Ok(accepted) => accepted,
                // Whoever gave up before they were answered.
                Err(error) if error.kind() == io::ErrorKind::ConnectionAborted => continue,
                Err(error) => return Err(error),
            };
            let shared = self.shared.clone();
            if shared.connections.fetch_add(1, Ordering::Relaxed) >= MOST_CONNECTIONS {
                shared.connections.fetch_sub(1, Ordering::Relaxed);
                continue;
            }
            let own = shared.clone();
            let started = thread::Builder::new()
                .name("connection".into())
                .spawn(move || {
                    // Whoever hangs up is no fault of the server.
                    let _ = own.answer_all(&stream);
                    own.connections.fetch_sub(1, Ordering::Relaxed);
                });
            if started.is_err() {
                shared.connections.fetch_sub(1, Ordering::Relaxed);
            }
        }
    }
}

impl SharedServer {
    /// Answers the requests of a connection until it ends.
    fn answer_all(&self, stream: &TcpStream) -> io::Result<()> {
        stream.set_read_timeout(Some(IDLE))?;
        stream.set_write_timeout(Some(IDLE))?;
        stream.set_nodelay(true)?;
        thread::sleep(self.line.delay);
        let mut lines = BufReader::new(stream);
        while let Some(head) = read_head(&mut lines)? {
            self.requests.fetch_add(1, Ordering::Relaxed);
            thread::sleep(self.line.delay);
            match parsed(&head) {
                Ok(request) => {
                    self.answer(stream, &request)?;
                    if request.closes {
                        break;
                    }
                }
                Err(status) => {
                    self.say(stream, status, "", false)?;
                    // Closed with bytes unread, a connection is reset, and the answer may be lost.
                    stream.shutdown(Shutdown::Write)?;
                    stream.set_read_timeout(Some(LINGER))?;
                    io::copy(&mut lines.take(LARGEST_HEAD), &mut io::sink())?;
                    break;
                }
            }
        }
        Ok(())
    }

    /// Answers a request.
    fn answer(&self, stream: &TcpStream, request: &FileRequest) -> io::Result<()> {
        let is_head = request.is_head;
        if request.path == "/" {
            return self.say(stream, "200 OK", &self.list(), is_head);
        }
        let Some((mut file, length, tag)) = self.open(&request.path) else {
            return self.say(stream, "404 Not Found", "no such file\n", is_head);
        };
        let is_same = request
            .if_range
            .as_ref()
            .is_none_or(|wanted| *wanted == tag);
        let asked = request.range.filter(|_| is_same);
        let (status, range, content) = match asked.map(|asked| asked.of(length)) {
            None => ("200 OK", 0..length, String::new()),
            Some(Some(range)) => {
                let last = range.end - 1;
                let content = format!("Content-Range: bytes {}-{last}/{length}\r\n", range.start);
                ("206 Partial Content", range, content)
            }
            Some(None) => {
                let content = format!("Content-Range: bytes */{length}\r\n");
                ("416 Range Not Satisfiable", 0..0, content)
            }
        };
        let head = format!(
            "HTTP/1.1 {status}\r\nAccept-Ranges: bytes\r\nContent-Type: application/octet-stream\r\nContent-Length: {}\r\nETag: {tag}\r\n{content}\r\n",
            range.end - range.start,
        );
        self.send(stream, head.as_bytes())?;
        if is_head {
            return Ok(());
        }
        file.seek(SeekFrom::Start(range.start))?;
        let mut left = range.end - range.start;
        let mut piece = [0; PIECE];
        while left > 0 {
            let own = &mut piece[..left.min(PIECE as u64) as usize];
            file.read_exact(own)?;
            self.send(stream, own)?;
            left -= own.len() as u64;
        }
        Ok(())
    }

    /// Sends an answer of a few words.
    fn say(&self, stream: &TcpStream, status: &str, text: &str, is_head: bool) -> io::Result<()> {
        let head = format!(
            "HTTP/1.1 {status}\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: {}\r\n\r\n",
            text.len()
        );
        let text = if is_head { "" } else { text };
        self.send(stream, (head + text).as_bytes())
    }

    /// Sends bytes when the line has room for them.
    fn send(&self, mut stream: &TcpStream, bytes: &[u8]) -> io::Result<()> {
        if let Some(rate) = self.line.bytes_per_second {
            let own = Duration::from_secs_f64(bytes.len() as f64 / rate.max(1.0));
            let until = {
                let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
                *free = (*free).max(Instant::now()) + own;
                *free
            };
            thread::sleep(until.saturating_duration_since(Instant::now()));
        }
        stream.write_all(bytes)
    }

    /// Names of the tree files of the folder, a line each.
    fn list(&self) -> String {
        let entries = std::fs::read_dir(&self.folder)
            .into_iter()
            .flatten()
            .flatten();
        let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
        let mut names: Vec<String> = names.filter(|name| name.ends_with(".surfel")).collect();
        names.sort();
        names.into_iter().map(|name| name + "\n").collect()
    }

    /// A file of the folder, its length and the name of its present state.
    fn open(&self, path: &str) -> Option<(File, u64, String)> {
        let path = self.folder.join(path.trim_start_matches('/'));
        // Also where links lead.
        let path = path.canonicalize().ok()?;
        if !path.starts_with(&self.folder) {
            return None;
        }
        let file = File::open(path).ok()?;
        let facts = file.metadata().ok().filter(std::fs::Metadata::is_file)?;
        let changed = facts.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
        let tag = format!("\"{:x}-{:x}\"", facts.len(), changed.as_nanos());
        Some((file, facts.len(), tag))
    }
}

/// The head of the next request, with the empty line; `None` where the connection ends before one.
fn read_head(lines: &mut BufReader<&TcpStream>) -> io::Result<Option<Vec<u8>>> {
    let mut head = Vec::new();
    loop {
        let left = LARGEST_HEAD.saturating_sub(head.len() as u64);
        let read = lines.by_ref().take(left).read_until(b'\n', &mut head)?;
        if read == 0 {
            // Too long a head is parsed, and refused.
            return Ok((!head.is_empty()).then_some(head));
        }
        if head.ends_with(b"\r\n\r\n") || head.ends_with(b"\n\n") {
            return Ok(Some(head));
        }
    }
}

/// Reads a request's head.
///
/// # Errors
/// The status to answer with.
fn parsed(head: &[u8]) -> Result<FileRequest, &'static str> {
    const BAD: &str = "400 Bad Request";
    let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
    let mut request = httparse::Request::new(&mut headers);
    match request.parse(head) {
        Ok(status) if status.is_complete() => {}
        _ => return Err(BAD),
    }
    let mut out = FileRequest {
        is_head: request.method == Some("HEAD"),
        closes: request.version == Some(0),
        ..FileRequest::default()
    };
    if !matches!(request.method, Some("GET" | "HEAD")) {
        return Err("405 Method Not Allowed");
    }
    let path = request.path.ok_or(BAD)?;
    let path = path.split(['?', '#']).next().unwrap_or_default();
    let path = percent_encoding::percent_decode_str(path).decode_utf8();
    out.path = path.map_err(|_| BAD)?.into_owned();
    if !out.path.starts_with('/') || out.path.contains('\0') {
        return Err(BAD);
    }
    for header in request.headers.iter() {
        let Ok(value) = std::str::from_utf8(header.value) else {
            continue;
        };
        match header.name.to_ascii_lowercase().as_str() {
            "range" => out.range = AskedRange::parse(value),
            "if-range" => out.if_range = Some(value.trim().to_owned()),
            "connection" => out.closes |= value.trim().eq_ignore_ascii_case("close"),
            "content-length" if value.trim() != "0" => return Err(BAD),
            "transfer-encoding" => return Err(BAD),
            _ => {}
        }
    }
    Ok(out)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    use crate::pages::file::PagedFile;
    use crate::pages::http::HttpSource;
    use crate::pages::join::whole_model;
    use crate::pages::source::{ByteSource, MemorySource};
    use crate::pages::tests::{GeneratedShape, SMALL_PAGES, model};
    use crate::pages::write::to_bytes;
    use crate::progress::SilentProgress;

    fn started(folder: &Path, line: SlowLine) -> (SocketAddr, impl Fn() -> usize + use<>) {
        let server = FileServer::bind(folder, ([127, 0, 0, 1], 0).into(), line).unwrap();
        let (address, count) = (server.address().unwrap(), server.request_counter());
        thread::spawn(move || server.run());
        (address, count)
    }

    /// The answer to a request, as it comes.
    fn asked(address: SocketAddr, request: &str) -> String {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        String::from_utf8_lossy(&answer).into_owned()
    }

    #[test]
    fn files_of_the_folder_are_sent_by_ranges_and_nothing_else_is() {
        let outside = tempfile::tempdir().unwrap();
        let folder = outside.path().join("in side");
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(outside.path().join("secret"), "secret").unwrap();
        std::fs::write(folder.join("ten %.surfel"), "0123456789").unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(outside.path().join("secret"), folder.join("link")).unwrap();
        let (address, _) = started(&folder, SlowLine::default());
        let get = |path: &str, more: &str| {
            let request = format!("GET {path} HTTP/1.1\r\nConnection: close\r\n{more}\r\n");
            asked(address, &request)
        };
        let file = "/ten%20%25.surfel?x=1";
        for (range, status, content, body) in [
            ("", "200", "", "0123456789"),
            ("bytes=0-0", "206", "bytes 0-0/10", "0"),
            ("bytes=3-5", "206", "bytes 3-5/10", "345"),
            ("bytes=8-99", "206", "bytes 8-9/10", "89"),
            ("bytes=7-", "206", "bytes 7-9/10", "789"),
            ("bytes=-2", "206", "bytes 8-9/10", "89"),
            ("bytes=10-11", "416", "bytes */10", ""),
            // Several ranges, and what is none: the whole file.
            ("bytes=0-1,3-4", "200", "", "0123456789"),
            ("bytes=5-3", "200", "", "0123456789"),
        ] {
            let header = match range {
                "" => String::new(),
                _ => format!("Range: {range}\r\n"),
            };
            let answer = get(file, &header);
            assert!(
                answer.starts_with(&format!("HTTP/1.1 {status} ")),
                "{range}: {answer}"
            );
            assert!(
                answer.ends_with(&format!("\r\n\r\n{body}")),
                "{range}: {answer}"
            );
            let is_said = answer.contains(&format!("Content-Range: {content}\r\n"));
            assert!(content.is_empty() || is_said, "{range}: {answer}");
        }
        assert!(get("/", "").ends_with("\r\n\r\nten %.surfel\n"));
        for path in [
            "/none",
            "/../secret",
            "/%2e%2e/secret",
            "/link",
            "/..%2fsecret",
            "//etc/passwd",
        ] {
            let answer = get(path, "");
            let is_refused = answer.starts_with("HTTP/1.1 404") && !answer.contains("secret");
            assert!(is_refused, "{path}: {answer}");
        }
        // Another state of the file: all of it.
        let other = get(file, "Range: bytes=0-0\r\nIf-Range: \"old\"\r\n");
        assert!(other.starts_with("HTTP/1.1 200"), "{other}");
        for (request, status) in [
            ("POST / HTTP/1.1\r\n\r\n", "405"),
            ("nonsense\r\n\r\n", "400"),
            ("GET / HTTP/1.1\r\nContent-Length: 5\r\n\r\n", "400"),
        ] {
            let answer = asked(address, request);
            assert!(
                answer.starts_with(&format!("HTTP/1.1 {status} ")),
                "{answer}"
            );
        }
        let long = format!(
            "GET /{} HTTP/1.1\r\n\r\n",
            "a".repeat(LARGEST_HEAD as usize)
        );
        assert!(asked(address, &long).starts_with("HTTP/1.1 400"));
    }

    #[test]
    fn a_paged_file_opens_from_it_and_a_slow_line_is_slow() {
        let bytes = to_bytes(&model(GeneratedShape::Torus, 12_000, false), &SMALL_PAGES).unwrap();
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("t.surfel"), &bytes).unwrap();
        let line = SlowLine {
            delay: Duration::from_millis(20),
            bytes_per_second: Some(2e6),
        };
        let (address, count) = started(folder.path(), line);
        let start = Instant::now();
        let source = HttpSource::open(&format!("http://{address}/t.surfel")).unwrap();
        assert_eq!(source.len(), bytes.len() as u64);
        // The connection, the answer, and 64 KiB: no less.
        assert!(start.elapsed() >= Duration::from_millis(20 + 20 + 32));
        let file = PagedFile::open(Arc::new(source)).unwrap();
        file.stand_in(file.origin()).unwrap();
        assert_eq!(count(), 1);
        let own = whole_model(&file, &SilentProgress).unwrap();
        let memory = PagedFile::open(Arc::new(MemorySource::new("t", bytes))).unwrap();
        let wanted = whole_model(&memory, &SilentProgress).unwrap();
        assert_eq!(own.tree.first_leaf, wanted.tree.first_leaf);
        assert_eq!(own.vertices[..], wanted.vertices[..]);
        assert_eq!(own.triangles[..], wanted.triangles[..]);
    }
}
