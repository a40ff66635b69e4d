#![allow(clippy::unwrap_used, reason = "a test may panic")]

use super::*;

#[test]
fn an_address_beside_another_stays_on_its_server() {
    let beside = |path| address_beside("http://h:80/a/b/all.surfel?v=1", path);
    for (path, address) in [
        ("t.surfel", Some("http://h:80/a/b/t.surfel")),
        ("../t 1/ä.surfel", Some("http://h:80/a/t%201/%C3%A4.surfel")),
        ("../../t.surfel", Some("http://h:80/t.surfel")),
        ("../../../t.surfel", None),
    ] {
        assert_eq!(beside(path).as_deref(), address, "{path}");
    }
    assert_eq!(address_beside("http://h", "t"), None);
}

use crate::pages::check::check;
use crate::pages::file::PagedFile;
use crate::pages::tests::{GeneratedShape, SMALL_PAGES, model};
use crate::pages::write::to_bytes;
use crate::progress::SilentProgress;
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
    let report = check(&file, &SilentProgress);
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
