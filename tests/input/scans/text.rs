//! Clouds as text, in the dialects of many programs.

use glam::{DVec3, Vec3};
use surfel::input::{Format, LoadedMesh};

use super::super::{message, read};
use super::{column, damage, histogram, remarks, scan};

fn places(loaded: &LoadedMesh) -> Vec<DVec3> {
    let mesh = &loaded.mesh;
    let places = mesh.positions.iter().map(|p| mesh.origin + p.as_dvec3());
    places.collect()
}

#[test]
fn separators_names_and_line_ends_mean_one_cloud() {
    let wanted = [DVec3::new(1.5, -2.0, 3.0), DVec3::new(4.0, 5.25, 6.0)];
    for (name, text) in [
        ("a.xyz", "1.5 -2 3\n4 5.25 6\n"),
        ("a", "1.5 -2 3\n4 5.25 6"),
        ("a.txt", "  1.5\t-2\t3\r\n\r\n4\t5.25\t6\r\n"),
        ("a.csv", "x,y,z\n1.5,-2,3\n4,5.25,6\n"),
        ("a.csv", "\"X\";\"Y\";\"Z\"\n1,5;-2,0;3\n4,0;5,25;6\n"),
        ("a.asc", "// X Y Z\n1,5 -2,0 3,0\n4,0 5,25 6,0\n"),
        ("a.txt", "# a remark\nZ Y X\n3 -2 1.5\n6 5.25 4\n"),
        ("a.pts", "2\n1.5 -2 3\n4 5.25 6\n"),
        ("a.pts", "1\n1.5 -2 3\n1\n4 5.25 6\n"),
        ("a", "1.5,-2,3\r4,5.25,6\r"),
    ] {
        let loaded = read(name, text);
        assert_eq!(places(&loaded), wanted, "{text}");
        assert_eq!(loaded.format, Format::TextPoints);
        assert!(loaded.attributes.is_empty() && loaded.mesh.colors.is_empty());
        let said = remarks(&loaded);
        assert!(said.starts_with("columns: "), "{said}");
    }
}

#[test]
fn colors_normals_and_attributes_are_found() {
    let pts = read(
        "a.pts",
        "3\n1 2 3 -2048 10 20 30\n2 2 3 2047 40 50 60\n3 2 3 0 70 80 255\n",
    );
    assert_eq!(pts.mesh.colors[2], [70, 80, 255, 255]);
    assert_eq!(
        histogram(column(&pts, "intensity")),
        [(-2048, 1), (0, 1), (2047, 1)]
    );
    assert_eq!(column(&pts, "intensity").values.bytes_a_point(), 2);
    let named = read(
        "a.csv",
        "X,Y,Z,Nx,Ny,Nz,Red,Green,Blue,Classification,GpsTime\n\
         1,2,3,0,0,2,0.5,1,0,2,390583952.3495862\n2,3,4,0,1,0,0,0,1,6,390583952.5\n",
    );
    assert_eq!(named.mesh.normals, [Vec3::Z, Vec3::Y]);
    assert_eq!(named.mesh.colors[0], [128, 255, 0, 255]);
    assert_eq!(histogram(column(&named, "class")), [(2, 1), (6, 1)]);
    assert_eq!(column(&named, "time").value(0), Some(390_583_952.349_586_2));
    // A hole in a table is no number; the point stays.
    let holed = read("a.csv", "x,y,z,i\n1,2,3,4\n5,6,7,\n");
    assert!(column(&holed, "intensity").value(1).unwrap().is_nan());
    // A position that is none is dropped with its attributes.
    let holed = read("a.csv", "x,y,z,i\n1,2,,4\n5,6,7,9\n8,8,8,7\n");
    assert_eq!(holed.mesh.positions.len(), 2);
    assert_eq!(column(&holed, "intensity").value(0), Some(9.0));
}

#[test]
fn scans_of_ptx_stand_where_their_heads_say() {
    let head = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
    let turned = "0 1 0 0\n-1 0 0 0\n0 0 1 0\n1000000 2000000 30 1\n";
    let text = format!(
        "2\n2\n{head}1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 0.5\n0 0 0 0.5\n4 5 6 0.25\n7 8 9 1\n\
         1\n2\n{head}{turned}1 2 3 0.5\n4 5 6 0.5\n"
    );
    let loaded = read("a.ptx", &text);
    assert_eq!(loaded.format, Format::Ptx);
    let all = places(&loaded);
    let wanted = [
        DVec3::new(1.0, 2.0, 3.0),
        DVec3::new(4.0, 5.0, 6.0),
        DVec3::new(7.0, 8.0, 9.0),
        // A quarter turn: x becomes y, y becomes -x.
        DVec3::new(999_998.0, 2_000_001.0, 33.0),
        DVec3::new(999_995.0, 2_000_004.0, 36.0),
    ];
    for (place, wanted) in all.iter().zip(wanted) {
        assert!(place.distance(wanted) < 0.2, "{place}, {wanted}");
    }
    assert_eq!(all.len(), 5);
    let scanners = [2, 3].map(|point| loaded.mesh.scanners.of_point(point));
    let second = DVec3::new(1e6, 2e6, 30.0);
    assert_eq!(scanners, [Some(DVec3::ZERO), Some(second)]);
    // Where coordinates are those of the world, the head says where the scanner stood.
    let placed = read("a.ptx", text.replacen("0 0 0\n", "5 6 7\n", 1));
    let first = placed.mesh.scanners.of_point(2);
    assert_eq!(first, Some(DVec3::new(5.0, 6.0, 7.0)));
    let said = remarks(&loaded);
    assert!(
        said.contains("1 points without a measurement left out"),
        "{said}"
    );
    assert!(
        said.contains("2 scans are drawn as one cloud, 1 of them moved"),
        "{said}"
    );
    assert_eq!(column(&loaded, "intensity").value(1), Some(0.25));
    let cut = read("a.ptx", &text[..text.len() - 8]);
    assert!(remarks(&cut).contains("says 2 points of a scan, the file holds 1"));
}

#[test]
fn lines_that_are_no_points_are_counted_and_placed() {
    let text = "1 2 3\n4 5 6\nnothing\n7 8 9\n1 2\n";
    let loaded = read("a.xyz", text);
    assert_eq!(loaded.mesh.positions.len(), 3);
    let said = remarks(&loaded);
    assert!(
        said.contains("2 lines are no points, the first on line 3"),
        "{said}"
    );
    let text = message("a.txt", "1 2 3\na\nb\nc\n");
    assert!(text.contains("line 2: 3 lines are no points"), "{text}");
    assert!(message("a.txt", "hello, world\n").contains("no line of three numbers"));
    assert!(message("a.csv", "1;2\n3;4\n").contains("no line of three numbers"));
}

#[test]
fn pieces_are_joined_in_order() {
    let line = |i: u32| format!("{i} {} 0.5 {} {} 7\n", i % 1000, i % 256, i / 256 % 256);
    let text: String = (0..400_000).map(line).collect();
    assert!(text.len() > 5 << 20);
    let loaded = read("a.xyz", text);
    let mesh = &loaded.mesh;
    assert_eq!(mesh.positions.len(), 400_000);
    for (i, (p, c)) in mesh.positions.iter().zip(&mesh.colors).enumerate() {
        assert_eq!((p.x, p.y), (i as f32, (i % 1000) as f32));
        assert_eq!(*c, [(i % 256) as u8, (i / 256 % 256) as u8, 7, 255]);
    }
}

#[test]
fn damage_is_read_or_refused() {
    let ptx = "2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 0.5\n0 0 0 0.5\n4 5 6 0.25\n7 8 9 1\n";
    for (name, text) in [
        ("a.ptx", ptx),
        ("a.pts", "2\n1.5 -2 3 7 1 2 3\n4 5.25 6 8 4 5 6\n"),
        ("a.csv", "x;y;z;i\n1,5;-2;3;1\n4;5,25;6;2\n"),
    ] {
        assert!(damage(name, text.as_bytes(), 2000) > 100, "{name}");
    }
}

/// Counts of the models' own table (README of the folder).
#[test]
fn real_texts_have_their_verified_counts() {
    let (Some((_, kitten)), Some((_, tree))) = (scan("kitten.xyz"), scan("Paris_Luxembourg_1.xyz"))
    else {
        return;
    };
    assert_eq!(kitten.mesh.positions.len(), 5210);
    assert_eq!(kitten.mesh.normals.len(), 5210);
    assert_eq!(tree.mesh.positions.len(), 33_411);
    assert!(tree.mesh.normals.is_empty() && tree.mesh.colors.is_empty());
    let first = tree.mesh.origin + tree.mesh.positions[0].as_dvec3();
    assert!(
        first.distance(DVec3::new(
            45.214_340_209_960_94,
            -553.399_108_886_718_8,
            52.957_847_595_214_84
        )) < 1e-5
    );
}
