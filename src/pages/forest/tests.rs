#![allow(clippy::unwrap_used, reason = "a test may panic")]

use super::*;
use crate::mesh::Mesh;
use crate::pages::check::check;
use crate::pages::join::whole_model;
use crate::pages::source::{ByteSource, FileSource, MemorySource};
use crate::pages::tests::{GeneratedShape, SMALL_PAGES, model};
use crate::pages::write::to_bytes as tile_bytes;
use crate::progress::SilentProgress;
use crate::tree::{BuildOptions, build};
use glam::Vec3;
use std::io;
use std::sync::Arc;

/// Tiles of a folder, and the forest over them.
struct TileScene {
    folder: tempfile::TempDir,
    members: Vec<ForestMember>,
    tiles: Vec<Model>,
}

impl TileScene {
    /// Tiles in a row, each a shape of so many triangles far from the zero; every second one has a zero of its own.
    fn new(counts: &[u64], is_cloud: bool) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("tiles")).unwrap();
        let tiles: Vec<Model> = (counts.iter().zip(0..))
            .map(|(&count, index)| {
                let mut tile = model(GeneratedShape::Statue, count, is_cloud);
                tile.origin = DVec3::new(4.0e5 + 3.0 * f64::from(index), 5.0e6, 100.0);
                tile
            })
            .collect();
        let mut scene = Self {
            folder,
            members: Vec::new(),
            tiles,
        };
        for (index, tile) in scene.tiles.iter().enumerate() {
            let path = scene.folder.path().join(format!("tiles/{index}.surfel"));
            std::fs::write(&path, tile_bytes(tile, &SMALL_PAGES).unwrap()).unwrap();
            let file = PagedFile::open(Arc::new(FileSource::open(&path).unwrap())).unwrap();
            let path = path_from(scene.folder.path(), &path).unwrap();
            scene.members.push(ForestMember { path, file });
        }
        scene
    }

    fn path(&self) -> std::path::PathBuf {
        self.folder.path().join("all.surfel")
    }

    fn forest(&self) -> PagedFile {
        write(&self.members, &self.path(), &SilentProgress).unwrap();
        PagedFile::open(Arc::new(FileSource::open(&self.path()).unwrap())).unwrap()
    }
}

/// All leaf pages below a forest's first page, in world space.
fn leaf_pages(file: &PagedFile) -> Result<Vec<DecodedPage>, PageError> {
    let options = DecodeOptions {
        moments: false,
        model_origin: Some(file.origin()),
    };
    let (mut pages, mut wanted) = (Vec::new(), vec![file.root().unwrap()]);
    let mut last = None;
    while !wanted.is_empty() {
        let read = file.read_neighbors(&wanted, options);
        let before = std::mem::take(&mut wanted);
        for (entry, page) in before.iter().zip(read) {
            // No two pages have one number.
            assert!(last < Some(entry.id) || before.len() > 1);
            last = last.max(Some(entry.id));
            let page = page?;
            match &page.children {
                Some(below) => wanted.extend(&below.entries),
                None => pages.push(page),
            }
        }
    }
    Ok(pages)
}

/// Corners of the triangles, or points, of models in world space: each coordinate by itself, sorted. What moves every place by
/// little moves every entry by as little.
fn places<'a>(models: impl Iterator<Item = &'a Model>) -> [Vec<f64>; 3] {
    let mut all = [Vec::new(), Vec::new(), Vec::new()];
    for model in models {
        let flat: Vec<u32> = model.triangles.iter().flatten().copied().collect();
        let own: Vec<u32> = match flat.is_empty() {
            true => (0..model.vertices.len() as u32).collect(),
            false => flat,
        };
        for &index in &own {
            let place = model.origin + model.vertices[index as usize].position.as_dvec3();
            for (axis, all) in all.iter_mut().enumerate() {
                all.push(place[axis]);
            }
        }
    }
    for axis in &mut all {
        axis.sort_unstable_by(f64::total_cmp);
    }
    all
}

#[test]
fn a_forest_has_all_that_its_files_have_where_they_have_it() {
    for (counts, is_cloud) in [
        (&[900, 40, 3000, 700, 800][..], false),
        (&[900, 5000], true),
        (&[1200], false),
        (&[700; 23], false),
    ] {
        let scene = TileScene::new(counts, is_cloud);
        let forest = scene.forest();
        let report = check(&forest, &SilentProgress);
        assert!(report.is_clean(), "{counts:?}: {:?}", report.violations);
        let leaves: u64 = scene
            .tiles
            .iter()
            .map(|tile| tile.tree.leaves.len() as u64)
            .sum();
        assert_eq!(
            (report.leaves, forest.header().leaf_count),
            (leaves, leaves)
        );
        assert_eq!(forest.member_names().len(), counts.len());
        assert_eq!(forest.page_count(), report.pages);
        let of_tiles: u64 = scene.members.iter().map(|own| own.file.total_bytes()).sum();
        assert_eq!(forest.total_bytes(), forest.header().file_length + of_tiles);
        let pages = leaf_pages(&forest).unwrap();
        let alone: Vec<Model> = (scene.members.iter())
            .map(|own| whole_model(&own.file, &SilentProgress).unwrap())
            .collect();
        let found = places(pages.iter().map(|page| &page.model));
        let expected = places(alone.iter());
        for (found, expected) in found.iter().zip(&expected) {
            assert_eq!(found.len(), expected.len());
            let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
            // Single precision at 70 units from the middle.
            assert!(off.fold(0.0, f64::max) < 1e-5, "{counts:?}");
        }
        // The box has all of it.
        let (low, high) = (forest.header().min, forest.header().max);
        for page in &pages {
            let inside = |vertex: &crate::abi::Vertex| {
                let (low, high) = (Vec3::from(low) - 0.01, Vec3::from(high) + 0.01);
                vertex.position.cmpge(low).all() && vertex.position.cmple(high).all()
            };
            assert!(page.model.vertices.iter().all(inside));
        }
    }
}

#[test]
fn the_order_of_the_files_does_not_matter() {
    let mut scene = TileScene::new(&[300, 400, 500, 600, 700, 350], false);
    let bytes = to_bytes(&scene.members, &SilentProgress).unwrap();
    scene.members.reverse();
    scene.members.swap(1, 3);
    assert!(to_bytes(&scene.members, &SilentProgress).unwrap() == bytes);
}

#[test]
fn a_single_triangle_can_be_a_file() {
    let mut scene = TileScene::new(&[500], false);
    let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let mesh = Mesh {
        positions: vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0)],
        colors: vec![[9, 9, 9, 255]; 3],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    let tile = build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
    let bytes = tile_bytes(&tile, &SMALL_PAGES).unwrap();
    let path = scene.folder.path().join("one.surfel");
    std::fs::write(&path, &bytes).unwrap();
    let file = PagedFile::open(Arc::new(MemorySource::new("one", bytes))).unwrap();
    scene.members.push(ForestMember {
        path: "one.surfel".to_owned(),
        file,
    });
    let report = check(&scene.forest(), &SilentProgress);
    assert!(report.is_clean(), "{:?}", report.violations);
}

#[test]
fn what_makes_no_forest_is_refused_by_name() {
    let scene = TileScene::new(&[400, 500], false);
    let cloud = TileScene::new(&[400], true);
    let mixed = [scene.members[0].clone(), cloud.members[0].clone()];
    let refused =
        |members: &[ForestMember]| to_bytes(members, &SilentProgress).unwrap_err().to_string();
    assert!(
        refused(&mixed).contains("points with colors"),
        "{}",
        refused(&mixed)
    );
    let forest = ForestMember {
        path: "all.surfel".to_owned(),
        file: scene.forest(),
    };
    assert!(refused(std::slice::from_ref(&forest)).contains("joins files itself"));
    // Nor is it a whole model.
    let message = whole_model(&forest.file, &SilentProgress)
        .unwrap_err()
        .to_string();
    assert!(message.contains("2 files"), "{message}");
}

#[test]
fn a_file_that_is_missing_or_another_is_named_and_leaves_the_rest() {
    let scene = TileScene::new(&[400, 500, 600, 700, 800], false);
    let _ = scene.forest();
    let open = || PagedFile::open(Arc::new(FileSource::open(&scene.path()).unwrap())).unwrap();
    let tile = scene.folder.path().join("tiles/3.surfel");
    let whole = std::fs::read(&tile).unwrap();
    let root = |file: &PagedFile| {
        let options = DecodeOptions::default();
        file.read_page(&file.root().unwrap(), options).unwrap()
    };
    std::fs::remove_file(&tile).unwrap();
    let forest = open();
    let mut failures = 0;
    // Below the first page is one more level of pages: five files make two levels of nodes.
    let entries = root(&forest).children.unwrap().entries;
    assert_eq!(entries.len(), 5);
    for page in forest.read_neighbors(&entries, DecodeOptions::default()) {
        if let Err(error) = page {
            failures += 1;
            let message = error.to_string();
            assert!(message.contains("3.surfel"), "{message}");
        }
    }
    assert_eq!(failures, 1);
    let report = check(&forest, &SilentProgress);
    assert!(
        report.count > 0
            && report
                .violations
                .iter()
                .any(|line| line.contains("3.surfel"))
    );
    // It comes back: what failed is tried again.
    std::fs::write(&tile, &whole).unwrap();
    assert!(check(&forest, &SilentProgress).is_clean());
    // Another tile in its place is not taken for it.
    let other = tile_bytes(&scene.tiles[1], &SMALL_PAGES).unwrap();
    std::fs::write(&tile, other).unwrap();
    let message = leaf_pages(&open()).unwrap_err().to_string();
    assert!(
        message.contains("another than the one that was joined"),
        "{message}"
    );
}

#[test]
fn damage_is_found_and_asks_for_no_memory() {
    let scene = TileScene::new(&[400, 500, 600], false);
    let bytes = to_bytes(&scene.members, &SilentProgress).unwrap();
    let end = scene.forest().header().root.offset;
    let end = end.min(bytes.len() as u64) as usize;
    let open = |bytes: Vec<u8>| PagedFile::open(Arc::new(MemorySource::new("f", bytes)));
    assert!(open(bytes.clone()).is_ok());
    for at in (0..end).step_by(3) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1 << (at % 8);
        assert!(open(damaged).is_err(), "byte {at}");
    }
    for length in (0..bytes.len()).step_by(7) {
        assert!(open(bytes[..length].to_vec()).is_err(), "{length} bytes");
    }
    // Members cannot be found: there is no folder.
    let file = open(bytes).unwrap();
    let message = leaf_pages(&file).unwrap_err().to_string();
    assert!(message.contains("in no folder"), "{message}");
}

#[test]
fn paths_lead_from_the_forest_to_its_files() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a/b", "a/c"] {
        std::fs::create_dir_all(folder.path().join(name)).unwrap();
    }
    for name in ["a/b/1.surfel", "2.surfel"] {
        std::fs::write(folder.path().join(name), "x").unwrap();
    }
    let path = |from: &str, to: &str| -> io::Result<String> {
        path_from(&folder.path().join(from), &folder.path().join(to))
    };
    assert_eq!(path("a", "a/b/1.surfel").unwrap(), "b/1.surfel");
    assert_eq!(path("a/c", "a/b/1.surfel").unwrap(), "../b/1.surfel");
    assert_eq!(path("a/c", "2.surfel").unwrap(), "../../2.surfel");
    assert!(path("a", "none").is_err());
    let source = FileSource::open(&folder.path().join("2.surfel")).unwrap();
    assert_eq!(source.beside("a/b/1.surfel").unwrap().len(), 1);
    assert!(source.beside("b/1.surfel").is_err());
}

#[cfg(feature = "remote")]
#[test]
fn a_forest_on_a_server_opens_its_files_there() {
    use crate::pages::http::HttpSource;
    use crate::pages::serve::{FileServer, SlowLine};
    use std::net::{Ipv4Addr, SocketAddr};
    let scene = TileScene::new(&[400, 500, 600], false);
    let local = scene.forest();
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let line = SlowLine {
        delay: std::time::Duration::ZERO,
        bytes_per_second: None,
    };
    let server = FileServer::bind(scene.folder.path(), address, line).unwrap();
    let url = format!("http://{}/all.surfel", server.address().unwrap());
    std::thread::spawn(move || server.run());
    let remote = PagedFile::open(Arc::new(HttpSource::open(&url).unwrap())).unwrap();
    let places_of = |file| places(leaf_pages(file).unwrap().iter().map(|page| &page.model));
    assert!(places_of(&remote) == places_of(&local));
    // Nothing outside of the folder that is served.
    let other = HttpSource::open(&url).unwrap().beside("../../etc/passwd");
    assert!(other.unwrap_err().to_string().contains("outside"));
}
