//! Questions asked of scans: what is kept of them, what is measured on them, what is written of them.

use crate::harness::surfel;
use std::fs;
use std::path::{Path, PathBuf};

/// Rows of a hundred points on a slope: x, y, z, intensity and a class from 2 to 6; those that `is_wanted`.
fn rows(is_wanted: impl Fn(usize) -> bool) -> String {
    let row = |i: usize| {
        let (x, y) = (i % 10, i / 10);
        format!("{x},{y},{},{i},{}\n", 0.25 * x as f64, 2 + i % 5)
    };
    let rows: String = (0..100).filter(|&i| is_wanted(i)).map(row).collect();
    format!("x,y,z,intensity,class\n{rows}")
}

fn written(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, text).unwrap();
    path
}

/// Runs with arguments in one text, `@` standing for the folder.
fn run(folder: &Path, arguments: &str) -> crate::harness::Run {
    let folder = format!("{}/", folder.display());
    let words = arguments.split_whitespace();
    surfel(words.map(|word| word.replace('@', &folder)))
}

#[test]
fn what_is_kept_is_counted_and_drawn_and_nothing_else() {
    let made = tempfile::tempdir().unwrap();
    let at = made.path();
    written(at, "all.csv", &rows(|_| true));
    written(at, "some.csv", &rows(|i| i % 5 == 1 && i >= 40));
    let info = run(
        at,
        "info --json @all.csv --keep class=low-vegetation --keep intensity=40..",
    );
    assert_eq!(info.code, 0, "{}", info.err);
    assert_eq!(info.json()["vertices"], 12);
    let remark = "kept 12 of 100 points: class=3 intensity=40..";
    assert!(info.err.contains(remark), "{}", info.err);
    assert!(info.json()["remarks"].to_string().contains(remark));
    // Points of a pixel know no spacing: the picture is that of a file with nothing else.
    let render = |file: &str, more: &str| {
        let shown = "--method points --threshold 3 --samples 1 --backend reference --camera @c.json --point-normals file";
        let made = run(at, &format!("render @{file} -o @a.png {shown} {more}"));
        assert_eq!(made.code, 0, "{}", made.err);
        fs::read(at.join("a.png")).unwrap()
    };
    let camera = run(
        at,
        "render @all.csv -o @a.png --save-camera @c.json --backend cpu --size 200x200",
    );
    assert_eq!(camera.code, 0, "{}", camera.err);
    let wanted = render("some.csv", "");
    assert!(render("all.csv", "--keep class=3 --keep intensity=40..") == wanted);
    assert!(render("all.csv", "") != wanted);
    // A box in the coordinates of the file; its faces belong to it.
    let info = run(at, "info --json @all.csv --clip-box 7,3,0,2,-1,2");
    assert_eq!(info.json()["vertices"], 6 * 4);
    let info = run(
        at,
        "info --json @all.csv --keep x=2..7 --keep y=..3 --keep height=..1.5",
    );
    assert_eq!(
        (&info.json()["vertices"], &info.json()["max"][2]),
        (&(5 * 4).into(), &1.5.into())
    );
}

#[test]
fn what_cannot_be_kept_is_said_by_name() {
    let made = tempfile::tempdir().unwrap();
    let at = made.path();
    written(at, "a.csv", &rows(|_| true));
    for (arguments, part) in [
        (
            "info @a.csv --keep label=3",
            "no field `label` to keep by; there is x, y, z, height, intensity, class",
        ),
        (
            "info @a.csv --keep class=9",
            "none of 100 points is kept by class=9",
        ),
        ("info @a.csv --keep class", "expected FIELD=VALUES"),
        (
            "info @a.csv --keep height=9..3",
            "the smaller end comes first",
        ),
        ("info @a.csv --clip-box 1,2,3", "six numbers are wanted"),
        (
            "info generate:square:200 --keep class=2",
            "there is x, y, z and height only",
        ),
        (
            "info generate:square:200 --keep x=5..",
            "none of 200 triangles is kept by x=5..",
        ),
        (
            "build generate:square:200 -o @a.surfel --memory 1GiB --keep x=0..",
            "need the whole model",
        ),
    ] {
        let run = run(at, arguments);
        assert!(
            run.code == 2 && run.err.contains(part),
            "{arguments}: {}",
            run.err
        );
    }
}

/// A part is written as a tree, and parts are kept of trees of both kinds.
#[test]
fn parts_of_trees_are_trees() {
    let made = tempfile::tempdir().unwrap();
    let at = made.path();
    for kind in ["--exact", ""] {
        let arguments = format!("build generate:square:20000 -o @a.surfel {kind}");
        let built = run(at, &arguments);
        assert_eq!(built.code, 0, "{}", built.err);
        let built = run(at, "build @a.surfel -o @half.surfel --keep x=0..");
        assert_eq!(built.code, 0, "{}", built.err);
        let checked = run(at, "check @half.surfel");
        assert_eq!(checked.code, 0, "{} {}", checked.text(), checked.err);
        let facts = run(at, "info --json @half.surfel").json();
        assert_eq!(
            (&facts["triangles"], &facts["is_closed"]),
            (&10_000.into(), &false.into())
        );
    }
}

/// Bytes of a cloud that carries everything: written, read again by our reader and by another.
fn las_file(folder: &Path, format: u8) -> PathBuf {
    use las::{Builder, Color, Point, Transform, Vector, Writer};
    let path = folder.join(format!("in{format}.las"));
    let mut builder = Builder::from((1, 4));
    builder.point_format = las::point::Format::new(format).unwrap();
    let axis = |offset: f64| Transform {
        scale: 0.01,
        offset,
    };
    builder.transforms = Vector {
        x: axis(500_000.0),
        y: axis(4_000_000.0),
        z: axis(0.0),
    };
    let record = |id: u16, data: &[u8]| las::Vlr {
        user_id: "LASF_Projection".to_owned(),
        record_id: id,
        data: data.to_owned(),
        ..las::Vlr::default()
    };
    if format >= 6 {
        builder.has_wkt_crs = true;
        builder.vlrs = vec![record(2112, b"PROJCS[\"a plane\"]\0")];
    } else {
        // One key: projected coordinates.
        let directory: Vec<u8> = [1_u16, 1, 0, 1, 1024, 0, 1, 1]
            .into_iter()
            .flat_map(u16::to_le_bytes)
            .collect();
        builder.vlrs = vec![record(34735, &directory), record(34737, b"a plane|\0")];
    }
    let mut writer = Writer::from_path(&path, builder.into_header().unwrap()).unwrap();
    for i in 0..1000_u16 {
        let step = f64::from(i);
        let has_color = [2, 3, 7].contains(&format);
        let mut point = Point {
            x: 500_100.0 + 0.37 * step,
            y: 4_000_200.0 - 0.11 * step,
            z: 3.0 + 0.01 * step,
            intensity: i * 60,
            return_number: 1 + (i % 3) as u8,
            number_of_returns: 3,
            user_data: (i % 200) as u8,
            point_source_id: 9 * i,
            ..Point::default()
        };
        point.classification =
            las::point::Classification::new([2, 6, 9][usize::from(i % 3)]).unwrap();
        point.color = has_color.then(|| Color::new(257 * (i % 256), 0, 65535));
        point.gps_time = (format != 2).then_some(1e5 + 0.125 * step);
        writer.write_point(point).unwrap();
    }
    writer.close().unwrap();
    path
}

#[test]
fn what_is_kept_is_exported_exactly() {
    let made = tempfile::tempdir().unwrap();
    let at = made.path();
    for format in [1, 2, 3, 6, 7] {
        let source = las_file(at, format);
        let points = |path: &Path| -> Vec<las::Point> {
            let mut reader = las::Reader::from_path(path).unwrap();
            let data = reader.read_all().unwrap();
            data.points().map(|point| point.unwrap()).collect()
        };
        let is_kept =
            |point: &&las::Point| u8::from(point.classification) == 6 && point.intensity >= 6000;
        let wanted: Vec<las::Point> = points(&source).iter().filter(is_kept).cloned().collect();
        for ending in ["las", "laz"] {
            let made = run(
                at,
                &format!(
                    "export @in{format}.las --keep class=6 --keep intensity=6000.. -o @out.{ending}"
                ),
            );
            assert_eq!(made.code, 0, "{}", made.err);
            assert!(made.err.contains("300 of 1,000 points"), "{}", made.err);
            let found = points(&at.join(format!("out.{ending}")));
            assert_eq!(found, wanted, "format {format} as {ending}");
            let system = |path: &Path| {
                let reader = las::Reader::from_path(path).unwrap();
                let header = reader.header();
                let own = |vlr: &&las::Vlr| vlr.user_id == "LASF_Projection";
                let records = header.vlrs().iter().filter(own);
                let records: Vec<_> = records
                    .map(|vlr| (vlr.record_id, vlr.data.clone()))
                    .collect();
                assert_eq!(header.has_wkt_crs(), format >= 6);
                records
            };
            let own = system(&at.join(format!("out.{ending}")));
            assert!(!own.is_empty() && own == system(&source), "{own:?}");
            assert!(!made.err.contains("coordinate system"), "{}", made.err);
        }
        // Text of the same numbers, by our reader: nothing is lost on the way back.
        let info = run(at, "info --json @out.laz");
        assert_eq!(info.code, 0, "{}", info.err);
        assert_eq!(info.json()["vertices"], 300);
    }
    // PLY has the coordinates as doubles, and every attribute by name.
    let made = run(
        at,
        "export @in3.las --keep class=6 --spacing 10 -o @out.ply",
    );
    assert_eq!(made.code, 0, "{}", made.err);
    let bytes = fs::read(at.join("out.ply")).unwrap();
    let end = bytes
        .windows(11)
        .position(|w| w == b"end_header\n")
        .unwrap()
        + 11;
    let head = String::from_utf8_lossy(&bytes[..end]).into_owned();
    for part in [
        "double x",
        "uchar red",
        "ushort intensity",
        "uchar class",
        "double time",
    ] {
        assert!(head.contains(&format!("property {part}\n")), "{head}");
    }
    // The first point of class 6 is number 1.
    let first = [500_100.37, 4_000_199.89, 3.01];
    for (axis, wanted) in first.into_iter().enumerate() {
        let value = f64::from_le_bytes(bytes[end + 8 * axis..][..8].try_into().unwrap());
        assert!((value - wanted).abs() < 1e-9, "{value} {wanted}");
    }
    // A line of 370 by 110, of which every cell of 10 has a point.
    let count = head.split("element vertex ").nth(1).unwrap();
    let count: usize = count.lines().next().unwrap().parse().unwrap();
    assert!((37..=56).contains(&count), "{count}");
    for (arguments, code, part) in [
        (
            "export @in3.las -o @out.obj",
            2,
            "ending must be ply, las or laz",
        ),
        ("export @in3.las -o @in3.las", 2, "written over"),
        ("export generate:square:8 -o @a.las", 2, "generate:square:8"),
        (
            "export @in3.las --keep class=40 -o @a.las",
            2,
            "none of 1000 points",
        ),
        ("export @in3.las -o @none/a.las", 1, "does not exist"),
        ("export @in3.las --spacing 0 -o @a.las", 2, "a size above 0"),
    ] {
        let run = run(at, arguments);
        assert!(
            run.code == code && run.err.contains(part),
            "{arguments}: {}",
            run.err
        );
    }
}

#[test]
fn points_without_normals_are_given_those_of_planes_through_their_neighbors() {
    let made = tempfile::tempdir().unwrap();
    let at = made.path();
    written(at, "all.csv", &rows(|_| true));
    let normals = |arguments: &str| {
        let info = run(at, &format!("info --json {arguments}"));
        assert_eq!(info.code, 0, "{}", info.err);
        let facts = info.json();
        let count = facts["with_normals"].as_u64().unwrap();
        (count, facts["has_estimated_normals"].as_bool().unwrap())
    };
    assert_eq!(normals("@all.csv"), (100, true));
    assert_eq!(normals("@all.csv --point-normals file"), (0, false));
    let info = run(at, "info @all.csv").text();
    assert!(info.contains("normals of 100 points estimated"), "{info}");
    // A tree file keeps them, of every kind.
    for kind in ["--exact", "", "--memory 256MiB"] {
        let build = run(at, &format!("build @all.csv -o @t.surfel -q {kind}"));
        assert_eq!(build.code, 0, "{}", build.err);
        let drawn = |name: &str| {
            let made = run(
                at,
                &format!(
                    "render @{name} --color-by normal --backend cpu --samples 1 --size 60x60 -o @n.png"
                ),
            );
            assert_eq!(made.code, 0, "{}", made.err);
            image::open(at.join("n.png")).unwrap().into_rgb8()
        };
        let (of_file, of_tree) = (drawn("all.csv"), drawn("t.surfel"));
        let pairs = || of_file.pixels().zip(of_tree.pixels());
        let far = pairs()
            .filter(|(a, b)| (0..3).any(|c| a[c].abs_diff(b[c]) > 6))
            .count();
        // The slope has one normal, and pages round it to a degree; their squares are a little larger.
        assert!(far * 10 < pairs().count(), "{kind}: {far}");
        let slope = of_tree.get_pixel(30, 30);
        assert!(slope[2] > 200 && slope[0] != slope[2], "{kind}: {slope:?}");
    }
}

/// The legend has the colors of the points, and stands in the picture only where it is asked for.
#[test]
fn legends_show_what_colors_mean() {
    let made = tempfile::tempdir().unwrap();
    let at = made.path();
    written(at, "all.csv", &rows(|_| true));
    let drawn = |more: &str| {
        let look = "--samples 1 --backend cpu --background black --size 300x300 --orbit 0,0,0.1";
        let made = run(at, &format!("render @all.csv -o @a.png {look} {more}"));
        assert_eq!(made.code, 0, "{}", made.err);
        image::open(at.join("a.png")).unwrap().into_rgb8()
    };
    let by_class = drawn("--color-by class --legend");
    // The second row: class 3, low vegetation.
    assert_eq!(by_class.get_pixel(22, 54).0, [190, 220, 110]);
    assert_eq!(drawn("--color-by class").get_pixel(22, 54).0, [0; 3]);
    let by_height = drawn("--color-by height --legend");
    let [low, high] = [150, 34].map(|y| by_height.get_pixel(22, y).0);
    assert!(
        low[2] > low[1] && high[0] > 200 && high[2] < 100,
        "{low:?} {high:?}"
    );
    let refused = run(at, "render @all.csv -o @a.png --legend");
    assert!(
        refused.code == 2 && refused.err.contains("--color-by"),
        "{}",
        refused.err
    );
}

/// Tiles beside each other are colored over the range of both, and a surface among them keeps its colors.
#[test]
fn tiles_share_the_range_of_all() {
    let made = tempfile::tempdir().unwrap();
    let at = made.path();
    for (name, left) in [("a.csv", 0), ("b.csv", 20)] {
        let row = |i: i32| format!("{},{},0,{}\n", left + i % 20, i / 20, 10 * (left + i % 20));
        let rows: String = (0..400).map(row).collect();
        written(at, name, &format!("x,y,z,intensity\n{rows}"));
    }
    let shown = |order: &str| {
        let arguments = format!(
            "render {order} --color-by intensity --backend cpu --samples 1 --size 90x60 -o @p.png"
        );
        let made = run(at, &arguments);
        assert_eq!(made.code, 0, "{}", made.err);
        let picture = image::open(at.join("p.png")).unwrap().into_rgb8();
        (made.err, picture)
    };
    let (said, both) = shown("@a.csv @b.csv");
    assert!(
        said.contains("all models are colored from 0 to 390"),
        "{said}"
    );
    // Which tile is the first is no matter.
    assert!(shown("@b.csv @a.csv").1 == both);
    let (said, _) = shown("@a.csv generate:square:200");
    assert!(
        said.contains("generate:square:200: warning: it has no intensity and keeps its colors"),
        "{said}"
    );
}
