//! STL, text and binary (3D Systems, "Stereolithography Interface Specification", 1989).
//!
//! Every triangle has corners of its own; the caller welds them by exact position (and color). The normal of a facet is
//! not kept: it belongs to no vertex, is often zero, and follows from the corners.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::assemble::{FileCoordinates, RawMesh};
use super::job::{ReadJob, at_line};
use super::part::{PartFate, PartFault};
use super::polygon::FaceList;
use super::sniff::{STL_HEADER, STL_TRIANGLE};
use super::text::{TextScanner, parse_f64, shown};
use super::{Error, FileCounts, FilePlace, ReadWarning};

/// Triangles per parallel piece.
const PIECE: usize = 1 << 14;

fn raw(coordinates: FileCoordinates, colors: Vec<[u8; 4]>, list: FaceList) -> RawMesh {
    let counts = FileCounts {
        vertices: coordinates.len() as u64,
        faces: list.faces,
    };
    RawMesh {
        coordinates,
        normals: Vec::new(),
        absent_normals: 0,
        colors,
        triangles: list.triangles,
        polygons: list.polygons,
        counts,
        textures: None,
    }
}

/// Reads the binary kind: 80 bytes of free text, a count, 50 bytes a triangle (normal, corners, 16 bits of color). A
/// count that contradicts the size is not believed, but a file that ends within a triangle is refused.
pub(super) fn read_binary(job: &mut ReadJob<'_>, data: &[u8]) -> Result<RawMesh, Error> {
    let promised = data
        .get(80..)
        .and_then(|rest| rest.first_chunk::<4>())
        .map(|bytes| u32::from_le_bytes(*bytes));
    let Some(promised) = promised else {
        return Err(job.truncated(
            FilePlace::Byte(data.len() as u64),
            "a binary STL file begins with 84 bytes",
        ));
    };
    let (header, body) = data.split_at(STL_HEADER);
    let needed = u64::from(promised) * STL_TRIANGLE as u64;
    let whole = (body.len() / STL_TRIANGLE) as u64;
    let rest = body.get(needed as usize..).unwrap_or_default();
    // More bytes than counted are triangles when they divide into whole ones, up to filling.
    let filling = rest.len() % STL_TRIANGLE;
    let is_filling = |byte: &u8| *byte == 0 || byte.is_ascii_whitespace();
    let are_triangles =
        rest.len() >= STL_TRIANGLE && rest[rest.len() - filling..].iter().all(is_filling);
    let count = if needed > body.len() as u64 || are_triangles {
        whole
    } else {
        u64::from(promised)
    };
    // A file that ends within a triangle was cut short; one that ends with a whole one was counted wrong.
    let is_cut = needed > body.len() as u64 && !body.len().is_multiple_of(STL_TRIANGLE);
    if is_cut || (count == 0 && promised > 0) {
        let size = body.len();
        return Err(job.truncated(
            FilePlace::Byte(data.len() as u64),
            format!("{promised} triangles need {needed} bytes after the header, there are {size}"),
        ));
    }
    if count != u64::from(promised) {
        job.warn(ReadWarning::CountContradicts {
            what: "triangles",
            promised: u64::from(promised),
            found: count,
        });
    }
    job.check_vertices(count * 3)?;
    let (body, rest) = body.split_at(count as usize * STL_TRIANGLE);
    job.warn_count(rest.len() as u64, |bytes| ReadWarning::TrailingBytes {
        bytes,
    });

    let mut corners = vec![Vec3::ZERO; count as usize * 3];
    corners
        .par_chunks_mut(PIECE * 3)
        .zip(body.par_chunks(PIECE * STL_TRIANGLE))
        .for_each(|(out, body)| {
            for (out, triangle) in out.chunks_exact_mut(3).zip(body.chunks_exact(STL_TRIANGLE)) {
                for (out, bytes) in out.iter_mut().zip(triangle[12..48].chunks_exact(12)) {
                    *out = Vec3::from_array(std::array::from_fn(|axis| {
                        f32::from_le_bytes(std::array::from_fn(|byte| bytes[4 * axis + byte]))
                    }));
                }
            }
        });
    let triangles = (0..count as u32)
        .map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner))
        .collect();
    let list = FaceList {
        triangles,
        faces: count,
        ..FaceList::default()
    };
    list_facets(job, count);
    let colors = colors_of(job, header, body, count);
    Ok(raw(FileCoordinates::Single(corners), colors, list))
}

fn list_facets(job: &mut ReadJob<'_>, count: u64) {
    let inventory = &mut job.inventory;
    inventory.add("facets", count, PartFate::Used, "");
    let computed = "computed from the corners";
    inventory.add("normals of facets", count, PartFate::Unneeded, computed);
}

/// The colors of the corners, by the two conventions of the 16 bits after a triangle; empty where there are none.
///
/// VisCAM and SolidView: bit 15 says that there is a color, of 5 bits each, blue in the lowest. Materialise Magics: the
/// header has `COLOR=` and four bytes, the color of the part; bit 15 says that a triangle has it, otherwise its own color
/// has red in the lowest bits.
fn colors_of(job: &mut ReadJob<'_>, header: &[u8], body: &[u8], count: u64) -> Vec<[u8; 4]> {
    const HAS_COLOR: u16 = 1 << 15;
    let part = header
        .windows(6)
        .position(|window| window == b"COLOR=")
        .and_then(|at| header.get(at + 6..80)?.first_chunk::<4>())
        .map(|&[red, green, blue, _]| [red, green, blue, 255]);
    let word = |triangle: &[u8]| u16::from_le_bytes([triangle[48], triangle[49]]);
    let any = |pattern: u16| {
        body.par_chunks(PIECE * STL_TRIANGLE).any(|piece| {
            let mut words = piece.chunks_exact(STL_TRIANGLE).map(word);
            words.any(|word| word & pattern != 0)
        })
    };
    let what = "16 bits after each triangle";
    if part.is_none() && !any(HAS_COLOR) {
        if any(u16::MAX) {
            job.inventory
                .add(what, count, PartFate::Unneeded, "none of them is a color");
        }
        return Vec::new();
    }
    let convention = match part {
        Some(_) => "colors as Magics writes them",
        None => "colors as VisCAM and SolidView write them",
    };
    job.inventory.add(what, count, PartFate::Used, convention);
    let level = |word: u16, shift: u32| {
        let five = (word >> shift & 31) as u8;
        five << 3 | five >> 2
    };
    // Writers that only know the color of the part leave all words zero.
    let are_zero = part.is_some() && !any(u16::MAX);
    let color = |word: u16| {
        let word = if are_zero { HAS_COLOR } else { word };
        let [low, middle, high] = [0, 5, 10].map(|shift| level(word, shift));
        match (part, word & HAS_COLOR != 0) {
            (None, true) => [high, middle, low, 255],
            (None, false) => [255; 4],
            (Some(part), true) => part,
            (Some(_), false) => [low, middle, high, 255],
        }
    };
    let colors: Vec<[u8; 4]> = body
        .par_chunks_exact(STL_TRIANGLE)
        .with_min_len(PIECE)
        .flat_map_iter(|triangle| [color(word(triangle)); 3])
        .collect();
    if colors.par_iter().all(|&color| color == [255; 4]) {
        Vec::new()
    } else {
        colors
    }
}

/// Reads the text kind. Several solids in one file are one mesh; a loop may have more than three corners. Normals and end
/// marks decide nothing: what is wrong with them is a remark.
pub(super) fn read_ascii(job: &mut ReadJob<'_>, data: &[u8]) -> Result<RawMesh, Error> {
    let mut scanner = TextScanner::new(data, 0);
    let mut corners: Vec<DVec3> = Vec::new();
    let mut list = FaceList::default();
    // Where the open loop began, and whether a solid is open.
    let mut loop_start = None;
    let mut in_solid = false;
    let mut solids = 0;
    while let Some((word, at)) = scanner.word() {
        let place = || at_line(data, at);
        let is = |keyword: &[u8]| word.eq_ignore_ascii_case(keyword);
        if is(b"vertex") {
            if loop_start.is_none() {
                return Err(job.syntax(place(), "a vertex stands outside of `outer loop`"));
            }
            corners.push(three_numbers(job, &mut scanner)?);
        } else if loop_start.is_some() && !is_end_mark(word) {
            return Err(job.syntax(place(), format!("`{}` before `endloop`", shown(word))));
        } else if is(b"facet") {
            facet_normal(job, &mut scanner);
        } else if is(b"outer") {
            expect(job, &mut scanner, b"loop")?;
            loop_start = Some(corners.len());
        } else if is(b"solid") {
            // The name may hold anything, keywords too.
            skip_name(&mut scanner);
            in_solid = true;
            solids += 1;
        } else if is_end_mark(word) {
            let end = EndMark::of(word, &mut scanner, loop_start.is_some());
            if !end.is_exact {
                job.fault(PartFault::END_MARK, data, at);
            }
            if loop_start.is_some() && end.what != ModelEnd::Loop {
                let reason = format!("`{}` before `endloop`", shown(word));
                return Err(job.syntax(place(), reason));
            }
            match end.what {
                ModelEnd::Loop => {
                    let Some(start) = loop_start.take() else {
                        return Err(job.syntax(place(), "`endloop` without `outer loop`"));
                    };
                    job.check_vertices(corners.len() as u64)?;
                    close_loop(&mut corners, start, &mut list);
                }
                ModelEnd::Facet => {}
                ModelEnd::Solid => {
                    skip_name(&mut scanner);
                    in_solid = false;
                }
            }
        } else {
            // Colors and other additions.
            job.fault(PartFault::LINE, data, at);
            skip_name(&mut scanner);
        }
        job.reach(scanner.at)?;
    }
    if loop_start.is_some() {
        return Err(job.truncated(at_line(data, data.len()), "`endloop` is missing"));
    }
    if in_solid {
        job.fault(PartFault::NO_END, data, data.len());
    }
    list.warn(job);
    job.inventory
        .add("solid", solids, PartFate::Used, "all are one mesh");
    list_facets(job, list.faces);
    Ok(raw(FileCoordinates::Double(corners), Vec::new(), list))
}

/// Makes a face of the vertices from `start`.
fn close_loop(corners: &mut Vec<DVec3>, start: usize, list: &mut FaceList) {
    if corners.len() - start > 3 && corners.last() == corners.get(start) {
        corners.pop();
        list.closed += 1;
    }
    let (first, end) = (start as u32, corners.len() as u32);
    if end - first < 3 {
        list.small += 1;
        corners.truncate(start);
    }
    list.polygons
        .push(list.triangles.len(), corners.len() - start);
    let fan = (first + 2..end).map(|last| [first, last - 1, last]);
    list.triangles.extend(fan);
    list.faces += 1;
}

fn is_end_mark(word: &[u8]) -> bool {
    word.get(..3)
        .is_some_and(|start| start.eq_ignore_ascii_case(b"end"))
}

/// What an end mark ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ModelEnd {
    Loop,
    Facet,
    Solid,
}

/// A word that begins with `end`, in one word or two.
struct EndMark {
    what: ModelEnd,
    /// Spelt as the format wants it.
    is_exact: bool,
}

impl EndMark {
    fn of(word: &[u8], scanner: &mut TextScanner<'_>, in_loop: bool) -> Self {
        const MARKS: [(&[u8], ModelEnd); 3] = [
            (b"loop", ModelEnd::Loop),
            (b"facet", ModelEnd::Facet),
            (b"solid", ModelEnd::Solid),
        ];
        let named = |name: &[u8]| {
            let mark = MARKS.iter().find(|mark| name.eq_ignore_ascii_case(mark.0));
            mark.map(|mark| mark.1)
        };
        if let Some(what) = named(&word[3..]) {
            return Self {
                what,
                is_exact: true,
            };
        }
        let after_word = scanner.clone();
        let next = scanner.word().and_then(|(next, _)| named(next));
        let what = match next {
            Some(what) if word.len() == 3 => what,
            _ => {
                *scanner = after_word;
                if in_loop {
                    ModelEnd::Loop
                } else {
                    ModelEnd::Facet
                }
            }
        };
        Self {
            what,
            is_exact: false,
        }
    }
}

/// Passes the normal of a facet, which is not used: up to three words of numbers.
fn facet_normal(job: &mut ReadJob<'_>, scanner: &mut TextScanner<'_>) {
    let start = scanner.at;
    let mut numbers = 0;
    let mut is_good = scanner
        .word()
        .is_some_and(|(word, _)| word.eq_ignore_ascii_case(b"normal"));
    if !is_good {
        scanner.at = start;
    }
    // At most a few words: what is no normal is not passed.
    for _ in 0..4 {
        let before = scanner.at;
        let Some((word, _)) = scanner.word() else {
            break;
        };
        if [&b"outer"[..], b"vertex", b"endfacet", b"facet"]
            .iter()
            .any(|keyword| word.eq_ignore_ascii_case(keyword))
        {
            scanner.at = before;
            break;
        }
        is_good &= parse_f64(word).is_some();
        numbers += 1;
    }
    if !(is_good && numbers == 3) {
        job.fault(PartFault::NORMAL, scanner.data, start);
    }
}

/// Skips the rest of the line, unless the line has ended with the word just read.
fn skip_name(scanner: &mut TextScanner<'_>) {
    scanner.line();
}

fn expect(
    job: &ReadJob<'_>,
    scanner: &mut TextScanner<'_>,
    keyword: &'static [u8],
) -> Result<(), Error> {
    let name = String::from_utf8_lossy(keyword);
    match scanner.word() {
        Some((word, _)) if word.eq_ignore_ascii_case(keyword) => Ok(()),
        Some((word, at)) => Err(job.syntax(
            at_line(scanner.data, at),
            format!("`{}` where `{name}` should stand", shown(word)),
        )),
        None => Err(job.truncated(
            at_line(scanner.data, scanner.data.len()),
            format!("`{name}` is missing"),
        )),
    }
}

fn three_numbers(job: &ReadJob<'_>, scanner: &mut TextScanner<'_>) -> Result<DVec3, Error> {
    let mut numbers = [0.0; 3];
    for number in &mut numbers {
        let Some((word, at)) = scanner.word() else {
            return Err(job.truncated(
                at_line(scanner.data, scanner.data.len()),
                "a number is missing",
            ));
        };
        *number = parse_f64(word)
            .ok_or_else(|| job.number(at_line(scanner.data, at), word, "a number"))?;
    }
    Ok(DVec3::from_array(numbers))
}
