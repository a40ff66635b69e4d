//! The real models: counts that a separate program verified, and an independent reader.

use glam::Vec3;
use std::path::Path;
use surfel::input::{self, Error, ReadOptions, ReadWarning};
use surfel::mesh::Mesh;
use surfel::progress::SilentProgress;

use super::check;
use super::common_models::{models, ring_file, scan_file};

/// What a scan brings: borders, needles, triangles without area, corners in one place, vertices of no triangle.
#[test]
fn our_scan_is_read_with_all_that_is_wrong_with_it() {
    let loaded = input::load(&scan_file(), &ReadOptions::default(), &SilentProgress).unwrap();
    check(&loaded, usize::MAX);
    let mesh = &loaded.mesh;
    let counts = (mesh.positions.len(), mesh.triangles.len());
    assert_eq!(counts, (9720, 17_348));
    assert_eq!(loaded.counts.vertices, counts.0 as u64);
    assert_eq!(mesh.colors.len(), counts.0);
    assert!(mesh.normals.is_empty() && loaded.warnings.is_empty());
    let at = |corner: u32| mesh.positions[corner as usize];
    let (mut flat, mut needles) = (0, 0);
    let mut edges = std::collections::HashMap::new();
    let mut is_used = vec![false; counts.0];
    for &[a, b, c] in &mesh.triangles {
        let twice_area = (at(b) - at(a)).cross(at(c) - at(a)).length();
        let longest = at(a)
            .distance(at(b))
            .max(at(b).distance(at(c)))
            .max(at(c).distance(at(a)));
        flat += usize::from(twice_area == 0.0);
        needles += usize::from(twice_area > 0.0 && longest * longest > 10.0 * twice_area);
        for (p, q) in [(a, b), (b, c), (c, a)] {
            *edges.entry((p.min(q), p.max(q))).or_insert(0) += 1;
        }
        for corner in [a, b, c] {
            is_used[corner as usize] = true;
        }
    }
    let borders = edges.values().filter(|&&n| n == 1).count();
    let unused = is_used.iter().filter(|used| !**used).count();
    println!("{flat} without area, {needles} needles, {borders} edges on borders, {unused} unused");
    assert!(flat > 100 && needles > 100 && borders > 1000 && unused > 10);
}

#[test]
fn our_ring_keeps_its_polygons_and_remarks() {
    let ring = input::load(&ring_file(), &ReadOptions::default(), &SilentProgress).unwrap();
    assert_eq!((ring.counts.faces, ring.mesh.triangles.len()), (197, 480));
    assert!(
        matches!(&ring.warnings[..], [ReadWarning::MaterialFileMissing { name, .. }] if name == "ring.mtl")
    );
    assert_as_other_reader(&ring.mesh, &ring_file());
}

#[test]
fn real_models_have_their_verified_counts() {
    let Some(folder) = models() else { return };
    // Vertices and triangles of the models' own table; STL files state triangles and distinct corners.
    for (name, vertices, triangles) in [
        ("thesis/horse.ply", 48_485, 96_966),
        ("thesis/dragon_vrip.ply.gz", 437_645, 871_414),
        ("thesis/dragon_vrip_res2.ply.gz", 100_250, 202_520),
        ("thesis/dragon_vrip_res3.ply.gz", 22_998, 47_794),
        ("thesis/dragon_vrip_res4.ply.gz", 5_205, 11_102),
        ("thesis/bunny_34835.obj.gz", 34_835, 69_666),
        ("thesis/porsche.obj", 4_099, 7_322),
        ("meshes/bun_zipper.ply.gz", 35_947, 69_451),
        ("meshes/rocker-arm.obj", 10_044, 20_088),
        ("meshes/beetle-alt.obj", 19_887, 38_656),
        ("meshes/ankylosaurus_mesh.ply.gz", 34_820, 69_636),
        ("meshes/mannequin.ply", 11_335, 22_653),
        ("meshes/casting.off", 5_096, 10_224),
        ("meshes/fandisk.obj", 6_475, 12_946),
        ("sharp/conrod.stl", 3_223, 6_442),
        ("sharp/1002_tray_bottom.STL", 2_216, 4_520),
        ("sharp/counter.unitsmm.STL", 41_837, 83_750),
        ("sharp/cycloidal.ply", 21_384, 43_368),
        ("sharp/featuretype.STL", 2_010, 3_476),
        ("sharp/round.stl", 560, 1_120),
        ("sharp/anchor_dense.off", 3_793, 7_598),
        ("sharp/joint.off", 221, 446),
        ("sharp/boeing.off", 2_741, 2_564),
        // Four of its faces name their first corner again.
        ("sharp/office_chair.obj", 3_476, 6_889),
        ("sharp/house/house.obj", 7_970, 11_262),
        ("sharp/domik/domik.obj", 2_986, 5_783),
        ("sharp/building.off", 9_708, 19_021),
        ("scans/building_points.ply.gz", 100_000, 0),
        ("scans/lato000.ply", 44_461, 86_766),
        (
            "textured/YcbBanana/textured_simple_reoriented.obj",
            7_866,
            15_728,
        ),
        ("photos/sceaux/scene_mesh_refine.ply", 87_685, 174_899),
        ("photos/sceaux/scene_mesh.ply", 7_378, 14_709),
        ("photos/sceaux/Sparse.ply", 12_683, 0),
    ] {
        let loaded =
            input::load(&folder.join(name), &ReadOptions::default(), &SilentProgress).unwrap();
        let mesh = &loaded.mesh;
        let is_stl = name.to_ascii_lowercase().ends_with(".stl");
        let is_obj = name.contains(".obj");
        assert_eq!(mesh.triangles.len(), triangles, "{name}");
        if is_stl {
            assert_eq!(
                (mesh.positions.len(), loaded.counts.faces),
                (vertices, triangles as u64),
                "{name}"
            );
        } else {
            assert_eq!(loaded.counts.vertices, vertices as u64, "{name}");
            // OBJ vertices are doubled where normals or colors meet, after those of the file.
            assert!(
                if is_obj {
                    mesh.positions.len() >= vertices
                } else {
                    mesh.positions.len() == vertices
                },
                "{name}"
            );
        }
        check(&loaded, usize::MAX);
        assert_eq!(mesh.is_cloud(), triangles == 0, "{name}");
        let has_normals = [
            "horse",
            "porsche",
            "ankylosaurus",
            "mannequin",
            "house",
            "domik",
            "building_p",
            "Banana",
        ];
        assert_eq!(
            !mesh.normals.is_empty(),
            has_normals.iter().any(|part| name.contains(part)),
            "{name}"
        );
        let has_colors = [
            "ankylosaurus",
            "mannequin",
            "cycloidal",
            "Sparse",
            "house",
            "domik",
            "Banana",
        ];
        assert_eq!(
            !mesh.colors.is_empty(),
            has_colors.iter().any(|part| name.contains(part)),
            "{name}"
        );
        println!(
            "{name}: {} vertices, {:?}",
            mesh.positions.len(),
            loaded.warnings
        );
    }
}

/// An independent reader agrees on every corner.
fn assert_as_other_reader(mesh: &Mesh, path: &Path) {
    let plain = tobj::LoadOptions {
        triangulate: true,
        single_index: false,
        ..Default::default()
    };
    let (models, _) = tobj::load_obj(path, &plain).unwrap();
    let mut theirs: Vec<[Vec3; 2]> = Vec::new();
    for model in &models {
        let at = |from: &[f32], index: u32| Vec3::from_slice(&from[3 * index as usize..]);
        let corners = model.mesh.indices.iter().zip(&model.mesh.normal_indices);
        theirs.extend(corners.map(|(&p, &n)| {
            [
                at(&model.mesh.positions, p),
                at(&model.mesh.normals, n).normalize(),
            ]
        }));
    }
    let ours = mesh
        .triangles
        .iter()
        .flatten()
        .map(|&c| [mesh.positions[c as usize], mesh.normals[c as usize]]);
    assert_eq!(mesh.triangles.len() * 3, theirs.len());
    let is_equal = |a: &[Vec3; 2], b: &[Vec3; 2]| a[0] == b[0] && a[1].distance(b[1]) < 1e-6;
    // Faces that are a little concave are fans there, and have the same corners.
    let differing: Vec<[Vec3; 2]> = ours
        .zip(&theirs)
        .filter(|(ours, theirs)| !is_equal(ours, theirs))
        .map(|(ours, _)| ours)
        .collect();
    assert!(differing.len() * 5 < theirs.len(), "{}", differing.len());
    for corner in &differing {
        assert!(theirs.iter().any(|other| is_equal(corner, other)));
    }
}

#[test]
fn real_models_keep_their_polygons_and_remarks() {
    let Some(folder) = models() else { return };
    let load = |name: &str| {
        input::load(&folder.join(name), &ReadOptions::default(), &SilentProgress).unwrap()
    };
    let porsche = load("thesis/porsche.obj");
    assert_eq!(porsche.counts.faces, 4_740);
    assert!(
        matches!(&porsche.warnings[..], [ReadWarning::MaterialFileMissing { name, .. }] if name == "porsche.mtl")
    );
    assert_as_other_reader(&porsche.mesh, &folder.join("thesis/porsche.obj"));

    let tree = folder.join("qsplat/horse.qs");
    let error = input::load(&tree, &ReadOptions::default(), &SilentProgress).unwrap_err();
    assert!(
        matches!(
            error,
            Error::UnreadFormat {
                format: "a QSplat tree",
                ..
            }
        ),
        "{error}"
    );
}
