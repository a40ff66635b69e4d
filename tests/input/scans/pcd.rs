//! PCD in its three encodings.

use glam::{DVec3, Vec3};
use surfel::input::{Format, LoadedMesh};

use super::super::{message, read};
use super::{column, damage, histogram, remarks, scan};

const HEAD: &str = "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb normal_x normal_y normal_z label _ h\n\
                    SIZE 4 4 4 4 4 4 4 2 1 4\nTYPE F F F F F F F U U F\nCOUNT 1 1 1 1 1 1 1 1 2 3\nWIDTH 2\nHEIGHT 2\n\
                    VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\n";

/// The four points of the tests; the third is a hole.
fn rows() -> Vec<Vec<u8>> {
    let row = |x: f32, label: u16| {
        let color = f32::from_bits(0xff0a_141e);
        let mut row = Vec::new();
        for value in [x, 2.0 * x, 3.0, color, 0.0, 0.0, 2.0] {
            row.extend(value.to_le_bytes());
        }
        row.extend(label.to_le_bytes());
        row.extend([9, 9]);
        for value in [x, 7.0, 8.5_f32] {
            row.extend(value.to_le_bytes());
        }
        row
    };
    vec![row(1.0, 5), row(2.0, 6), row(f32::NAN, 7), row(4.0, 5)]
}

fn binary() -> Vec<u8> {
    [format!("{HEAD}DATA binary\n").into_bytes(), rows().concat()].concat()
}

/// Field after field, packed as runs of bytes as they are.
fn packed() -> Vec<u8> {
    let rows = rows();
    let mut fields = Vec::new();
    let mut at = 0;
    for size in [4, 4, 4, 4, 4, 4, 4, 2, 2, 12] {
        rows.iter()
            .for_each(|row| fields.extend(&row[at..at + size]));
        at += size;
    }
    let mut lzf = Vec::new();
    for run in fields.chunks(32) {
        lzf.push(run.len() as u8 - 1);
        lzf.extend(run);
    }
    let mut out = format!("{HEAD}DATA binary_compressed\n").into_bytes();
    out.extend((lzf.len() as u32).to_le_bytes());
    out.extend((fields.len() as u32).to_le_bytes());
    out.extend(lzf);
    out
}

fn text() -> Vec<u8> {
    let color = f32::from_bits(0x0a_141e);
    let row = |x: &str, label: u16| format!("{x} {x} 3 {color:e} 0 0 2 {label} 9 9 {x} 7 8.5\n");
    let rows = [row("1", 5), row("2", 6), row("nan", 7), row("4", 5)];
    format!("{HEAD}DATA ascii\n{}", rows.concat()).into_bytes()
}

fn check_four(loaded: &LoadedMesh) {
    assert_eq!(loaded.format, Format::Pcd);
    assert_eq!(loaded.counts.vertices, 4);
    assert_eq!(loaded.mesh.positions.len(), 3);
    assert_eq!(loaded.mesh.positions[2].x, 4.0);
    assert_eq!(loaded.mesh.normals, [Vec3::Z; 3]);
    assert_eq!(loaded.mesh.colors, [[10, 20, 30, 255]; 3]);
    assert_eq!(histogram(column(loaded, "label")), [(5, 2), (6, 1)]);
    assert_eq!(column(loaded, "h_0").value(1), Some(2.0));
    assert_eq!(column(loaded, "h_2").value(0), Some(8.5));
    let said = remarks(loaded);
    assert_eq!(said, "1 points without a measurement left out");
}

#[test]
fn three_encodings_are_one_cloud() {
    for bytes in [text(), binary(), packed()] {
        check_four(&read("a.pcd", &bytes));
    }
}

#[test]
fn the_viewpoint_moves_and_turns() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let text = String::from_utf8(text()).unwrap();
    let text = text.replace(
        "VIEWPOINT 0 0 0 1 0 0 0",
        &format!("VIEWPOINT 100 200 300 {half} 0 0 {half}"),
    );
    let loaded = read("a.pcd", text);
    let mesh = &loaded.mesh;
    let place = mesh.origin + mesh.positions[1].as_dvec3();
    // A quarter turn about z.
    assert!(
        place.distance(DVec3::new(98.0, 202.0, 303.0)) < 1e-4,
        "{place}"
    );
    let scanner = mesh.scanners.of_point(1);
    assert_eq!(scanner, Some(DVec3::new(100.0, 200.0, 300.0)));
    assert!(!read("a.pcd", binary()).mesh.scanners.is_any_known());
}

#[test]
fn what_is_wrong_is_named() {
    let text = String::from_utf8(text()).unwrap();
    let says = |from: &str, to: &str, words: &str| {
        let message = message("a.pcd", text.replace(from, to));
        assert!(message.contains(words), "{message}");
    };
    says("FIELDS x", "FIELDS w", "no fields x, y and z");
    says(
        "SIZE 4",
        "SIZE 3",
        "`3` is not a size of 1, 2, 4 or 8 bytes",
    );
    says("TYPE F", "TYPE Q", "`Q` is not a type F, U or I");
    says(
        "COUNT 1",
        "COUNT 99999",
        "`99999` is not a count of values up to 4096",
    );
    says("DATA ascii", "DATA zip", "DATA `zip` is not known");
    says("POINTS 4", "POINTS 0", "the header names no points");
    says("2 2 3 ", "2 two 3 ", "line 13: `two` is not a number");
    says(
        "2 2 3 ",
        "",
        "line 13: a point has 10 numbers instead of 13",
    );
    let cut = binary();
    let cut = read("a.pcd", &cut[..cut.len() - 1]);
    assert!(remarks(&cut).contains("the header says 4 points, the file holds 3"));
    let mut lies = packed();
    let at = lies.len() - packed().len() + HEAD.len() + "DATA binary_compressed\n".len();
    lies[at + 4..at + 8].fill(0xff);
    assert!(message("a.pcd", lies).contains("said to unpack to 4294967295 bytes"));
}

#[test]
fn damage_is_read_or_refused() {
    for bytes in [text(), binary(), packed()] {
        let read = damage("a.pcd", &bytes, 2000);
        assert!((100..2000).contains(&read), "{read}");
    }
}

/// Counts of the models' own table (README of the folder).
#[test]
fn real_clouds_have_their_verified_counts() {
    let (Some((_, small)), Some((_, milk))) = (
        scan("colored_cloud.pcd"),
        scan("milk_cartoon_all_small_clorox.pcd"),
    ) else {
        return;
    };
    assert_eq!(small.mesh.positions.len(), 1000);
    assert_eq!(
        (small.mesh.normals.len(), small.mesh.colors.len()),
        (1000, 1000)
    );
    assert!(small.attributes.find("curvature").is_some());
    assert_eq!(milk.counts.vertices, 640 * 480);
    assert_eq!(milk.mesh.positions.len(), 241_407);
    assert_eq!(milk.mesh.colors.len(), 241_407);
    let said = remarks(&milk);
    assert!(
        said.contains("65793 points without a measurement left out"),
        "{said}"
    );
}
