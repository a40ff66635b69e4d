//! Cross sections: tables and pictures of what lies along a line.

use crate::common_models::real_file;
use crate::harness::{command_after, run_with, surfel};
use std::f64::consts::PI;
use std::fs;
use std::path::Path;

/// Runs `cross-section` with arguments in one text, `@` standing for the folder.
fn run(folder: &Path, arguments: &str) -> crate::harness::Run {
    let folder = format!("{}/", folder.display());
    let words = arguments.split_whitespace();
    let words = words.map(|word| word.replace('@', &folder));
    surfel(["cross-section".to_owned()].into_iter().chain(words))
}

/// Names of columns, and rows of cells.
fn table(text: &str) -> (Vec<String>, Vec<Vec<String>>) {
    let cells = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let mut rows = text.lines().map(cells);
    (rows.next().unwrap(), rows.collect())
}

fn numbers(row: &[String]) -> Vec<f64> {
    row.iter().map(|cell| cell.parse().unwrap()).collect()
}

/// A hundred points of a slope far from zero: x, y, z, intensity and class.
fn slope(folder: &Path) {
    let row = |i: u32| {
        let (x, y) = (i % 10, i / 10);
        let z = 0.25 * f64::from(x);
        format!(
            "{}.5,{}.25,{z},{i},{}\n",
            500_000 + x,
            4_000_000 + y,
            2 + i % 5
        )
    };
    let rows: String = (0..100).map(row).collect();
    fs::write(
        folder.join("slope.csv"),
        format!("x,y,z,intensity,class\n{rows}"),
    )
    .unwrap();
}

#[test]
fn points_of_a_slope_are_where_the_line_says() {
    let made = tempfile::tempdir().unwrap();
    let at = made.path();
    slope(at);
    let of = |more: &str| {
        let run = run(at, &format!("@slope.csv --csv - {more}"));
        assert_eq!(run.code, 0, "{}", run.err);
        (table(&run.text()), run.err)
    };
    // From the east to the west: left is the south.
    let line = "--line 500009.5,4000003.25,500001.5,4000003.25 --width 2";
    let ((head, rows), err) = of(line);
    let wanted = [
        "distance",
        "offset",
        "height",
        "x",
        "y",
        "z",
        "intensity",
        "class",
    ];
    assert_eq!(head, wanted);
    assert!(
        err.contains("27 of 100 points within 1 of the line of 8.000"),
        "{err}"
    );
    assert_eq!(rows.len(), 9 * 3);
    let mut last = f64::NEG_INFINITY;
    for row in &rows {
        let cells = numbers(row);
        let [distance, offset, height, x, y, z, intensity, class] = cells[..] else {
            panic!("{row:?}")
        };
        assert!(
            (500_009.5 - x - distance).abs() < 1e-9 && (4_000_003.25 - y - offset).abs() < 1e-9
        );
        let (column, line) = (x - 500_000.5, y - 4_000_000.25);
        assert_eq!((height, z), (0.25 * column, height), "{row:?}");
        assert_eq!(intensity, column + 10.0 * line);
        assert_eq!(class, 2.0 + intensity % 5.0);
        assert!(distance >= last, "{row:?}");
        last = distance;
    }
    // Across: the distance is that along the line, and heights of its ends do not matter.
    let ((_, rows), _) = of("--line 500000.5,4000000.25,77,500003.5,4000004.25,-1e6 --width 0.01");
    let found: Vec<[f64; 2]> = rows
        .iter()
        .map(|row| [numbers(row)[0], numbers(row)[5]])
        .collect();
    assert_eq!(found, [[0.0, 0.0], [5.0, 0.75]]);
    // What is kept, and in what file: y is up when that is asked for.
    let ((_, rows), _) = of(&format!("{line} --keep class=2,4 --keep height=..1"));
    assert!(
        rows.iter()
            .all(|row| numbers(row)[2] <= 1.0 && [2.0, 4.0].contains(&numbers(row)[7]))
    );
    assert_eq!(rows.len(), 3);
    let ((_, rows), _) = of("--line 500000.5,0,500009.5,0 --width 0.2 --up y");
    assert_eq!(rows.len(), 10);
    assert!(
        rows.iter()
            .all(|row| row[2] == row[4] && row[1].parse::<f64>() == Ok(0.0))
    );
}

#[test]
fn several_models_are_told_apart() {
    let made = tempfile::tempdir().unwrap();
    let at = made.path();
    slope(at);
    fs::write(at.join("b.csv"), "x,y,z,gain\n500003,4000003.25,7,0.1\n").unwrap();
    let arguments =
        "@slope.csv @b.csv --line 500000,4000003.25,500009,4000003.25 --width 0.1 --csv @t.csv";
    let made = run(at, arguments);
    assert_eq!(made.code, 0, "{}", made.err);
    let (head, rows) = table(&fs::read_to_string(at.join("t.csv")).unwrap());
    assert_eq!(
        (head[0].as_str(), &head[7..]),
        (
            "model",
            &["intensity", "class", "gain"].map(str::to_owned)[..]
        )
    );
    assert_eq!(rows.len(), 9 + 1);
    let last = rows.last().unwrap();
    assert!(
        last[0].ends_with("b.csv") && last[7..] == ["", "", "0.1"],
        "{last:?}"
    );
    assert!(rows[0][0].ends_with("slope.csv") && rows[0][9].is_empty());
}

/// Lengths of polylines, and whether each is closed.
fn polylines(rows: &[Vec<String>]) -> Vec<(f64, bool)> {
    let mut found: Vec<Vec<Vec<f64>>> = Vec::new();
    for row in rows {
        let cells = numbers(row);
        if cells[0] as usize > found.len() {
            found.push(Vec::new());
        }
        found.last_mut().unwrap().push(cells[4..7].to_vec());
    }
    let apart = |a: &[f64], b: &[f64]| {
        let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f64>().sqrt()
    };
    let length = |places: &Vec<Vec<f64>>| places.windows(2).map(|p| apart(&p[0], &p[1])).sum();
    found
        .iter()
        .map(|p| (length(p), p.first() == p.last()))
        .collect()
}

const CUBE: &str = "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n\
    f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

#[test]
fn surfaces_give_the_lines_that_cut_them() {
    let made = tempfile::tempdir().unwrap();
    let at = made.path();
    fs::write(at.join("cube.obj"), CUBE).unwrap();
    let of = |arguments: &str| {
        let run = run(at, &format!("{arguments} --csv - --width 0.5"));
        assert_eq!(run.code, 0, "{}", run.err);
        let (head, rows) = table(&run.text());
        assert_eq!(
            head,
            ["polyline", "distance", "offset", "height", "x", "y", "z"]
        );
        for row in &rows {
            assert_eq!(numbers(row)[2], 0.0, "{row:?}");
        }
        rows
    };
    let near = |found: &[(f64, bool)], wanted: &[(f64, bool)]| {
        let pairs = || found.iter().zip(wanted);
        let is_near = found.len() == wanted.len()
            && pairs().all(|(a, b)| (a.0 - b.0).abs() < 1e-4 && a.1 == b.1);
        assert!(is_near, "{found:?} {wanted:?}");
    };
    // A square of 2, its diagonal, through corners of the cube, and the half that the line reaches.
    near(
        &polylines(&of("@cube.obj --up z --line -3,0.25,3,0.25")),
        &[(8.0, true)],
    );
    let diagonal = 4.0 + 4.0 * 2f64.sqrt();
    near(
        &polylines(&of("@cube.obj --up z --line -3,-3,3,3")),
        &[(diagonal, true)],
    );
    near(
        &polylines(&of("@cube.obj --up z --line 0.5,0.25,3,0.25")),
        &[(3.0, false)],
    );
    near(
        &polylines(&of("@cube.obj --up y --line -0.5,0.25,0.5,0.25")),
        &[(1.0, false), (1.0, false)],
    );
    // Distances are those from the start.
    let rows = of("@cube.obj --up z --line -3,0.25,3,0.25");
    let distances = rows.iter().map(|row| numbers(row)[1]);
    let ends = distances.fold([9.0, 0.0], |[a, b]: [f64; 2], d| [a.min(d), b.max(d)]);
    assert_eq!(ends, [2.0, 4.0]);
    // A circle through the middle of a sphere, and a smaller one beside it.
    let circles = |y: f64| {
        polylines(&of(&format!(
            "generate:sphere:80000 --up z --line -9,{y},9,{y}"
        )))
    };
    for y in [0.0, 0.6] {
        let [(length, true)] = circles(y)[..] else {
            panic!("{:?}", circles(y))
        };
        let wanted = 2.0 * PI * (1.0 - y * y).sqrt();
        assert!(
            (length / wanted - 1.0).abs() < 1e-3,
            "{y}: {length} {wanted}"
        );
    }
}

/// The picture has one unit on both axes: the section of a cube is a square, and three times as high where that is asked for.
#[test]
fn pictures_have_the_scale_that_they_say() {
    let made = tempfile::tempdir().unwrap();
    let at = made.path();
    fs::write(at.join("cube.obj"), CUBE).unwrap();
    let extent = |more: &str| {
        let arguments =
            "@cube.obj --up z --line -3,0.25,3,0.25 --width 0.01 --background black --backend cpu";
        let made = run(at, &format!("{arguments} -o @a.png {more}"));
        assert_eq!(made.code, 0, "{}", made.err);
        let picture = image::open(at.join("a.png")).unwrap().into_rgb8();
        let is_line = |p: &image::Rgb<u8>| p[0] > 200 && p[1] > 150 && p[2] < 100;
        let found = picture.enumerate_pixels().filter(|(_, _, p)| is_line(p));
        let none = [u32::MAX, u32::MAX, 0, 0];
        let [x0, y0, x1, y1] = found.fold(none, |[a, b, c, d], (x, y, _)| {
            [a.min(x), b.min(y), c.max(x), d.max(y)]
        });
        (picture.dimensions(), [x1 - x0, y1 - y0], [x0, y1])
    };
    // 72 and 20 pixels are margins: 508 for 6 units.
    let (size, [wide, high], [left, _]) = extent("--size 600x300");
    assert_eq!(size, (600, 300));
    let wanted = 508.0 * 2.0 / 6.0;
    assert!(
        (f64::from(wide) - wanted).abs() <= 3.0 && wide.abs_diff(high) <= 1,
        "{wide} {high}"
    );
    assert!((f64::from(left) - (72.0 + wanted)).abs() <= 2.0, "{left}");
    let (size, [wide, high], _) = extent("--exaggerate 3");
    assert!(
        size.0 == 1200 && (3 * wide).abs_diff(high) <= 4,
        "{size:?} {wide} {high}"
    );
}

/// Pixels of points are where their distances and heights say, and only those in the slab are drawn.
#[test]
fn pictures_show_the_points_of_the_slab_alone() {
    let made = tempfile::tempdir().unwrap();
    let at = made.path();
    let rows = "x,y,z\n0,0,0\n10,0,5\n4,0.5,5\n6,3,2\n6,-3,2\n";
    fs::write(at.join("a.csv"), rows).unwrap();
    let made = run(
        at,
        "@a.csv --line 0,0,10,0 --width 2 -o @a.png --size 600x400 --background black --backend reference",
    );
    assert_eq!(made.code, 0, "{}", made.err);
    let picture = image::open(at.join("a.png")).unwrap().into_rgb8();
    let unit = (600.0 - 92.0) / 10.0;
    // Their middle is that of the 344 pixels between the margins.
    let pixel = |x: f64, z: f64| [(72.0 + x * unit) as u32, (192.0 - (z - 2.5) * unit) as u32];
    let is_lit = |[x, y]: [u32; 2]| picture.get_pixel(x, y).0.iter().any(|&c| c > 60);
    for (x, z, is_there) in [
        (4.0, 5.0, true),
        (10.0, 5.0, true),
        (6.0, 2.0, false),
        (4.0, 2.0, false),
    ] {
        assert_eq!(is_lit(pixel(x, z)), is_there, "{x} {z}");
    }
}

#[test]
fn tables_go_to_pipes_and_devices_and_what_cannot_be_is_said() {
    let made = tempfile::tempdir().unwrap();
    let at = made.path();
    slope(at);
    let line = "--line 500000.5,4000003.25,500009.5,4000003.25 --width 2";
    let ok = run(at, &format!("@slope.csv {line} --csv /dev/null -q"));
    assert!(
        ok.code == 0 && !ok.err.contains("points within"),
        "{}",
        ok.err
    );
    let png = run(
        at,
        &format!("@slope.csv {line} -o - --backend cpu --color-by intensity"),
    );
    assert!(
        png.code == 0 && png.out.starts_with(b"\x89PNG"),
        "{}",
        png.err
    );
    // A reader that goes away is no failure.
    let mut closed = command_after("exec >&-");
    closed.args([
        "cross-section",
        "generate:sphere:200000",
        "--line",
        "-9,0,9,0",
    ]);
    closed.args(["--width", "1", "--csv", "-"]);
    let closed = run_with(closed, None);
    assert!(closed.code <= 1, "{}", closed.err);
    for (arguments, code, part) in [
        (
            "@slope.csv --line 0,0,1,1 --width 2 --csv -",
            2,
            "slope.csv reaches from 500000.50,4000000.25",
        ),
        (
            "@slope.csv --line 5,5,5,5 --width 2 --csv -",
            2,
            "two places are wanted",
        ),
        (
            "@slope.csv --line 5,5,5 --width 2 --csv -",
            2,
            "four numbers are wanted",
        ),
        (
            "@slope.csv --line 0,0,nan,1 --width 2 --csv -",
            2,
            "four numbers are wanted",
        ),
        (
            "@slope.csv --line 0,0,1,1 --width 0 --csv -",
            2,
            "a number above 0",
        ),
        ("@slope.csv --line 0,0,1,1 --width 1", 2, "nothing to write"),
        (
            "@slope.csv --line 0,0,1,1 --width 1 -o @a.exr",
            2,
            "ending must be png",
        ),
        (
            "@slope.csv --line 0,0,1,1 --width 1 --csv @slope.csv",
            2,
            "written over",
        ),
        (
            "@slope.csv --line 0,0,1,1 --width 1 --csv @none/a.csv",
            1,
            "does not exist",
        ),
        (
            "@slope.csv --line 0,0,1,1 --width 1 --csv - -o -",
            2,
            "takes one file",
        ),
        (
            "@slope.csv --line 0,0,1,1 --width 1 --csv - --keep label=1",
            2,
            "no field `label`",
        ),
    ] {
        let run = run(at, arguments);
        assert!(
            run.code == code && run.err.contains(part),
            "{arguments}: {}",
            run.err
        );
    }
    let left = crate::harness::names(at);
    assert_eq!(left, ["slope.csv"]);
}

/// Points of a survey: those that another reader finds in the slab, with their numbers, to the step of the file.
#[test]
fn a_survey_has_the_points_that_another_reader_finds() {
    let Some(path) = real_file("scans/autzen_trim.laz") else {
        return;
    };
    let made = tempfile::tempdir().unwrap();
    let at = made.path();
    let mut reader = las::Reader::from_path(&path).unwrap();
    let bounds = reader.header().bounds();
    let data = reader.read_all().unwrap();
    let points = data.points().map(|point| point.unwrap());
    let ends = [
        [bounds.min.x + 10.0, bounds.min.y + 20.0],
        [bounds.max.x - 5.0, bounds.max.y - 30.0],
    ];
    let way = [ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]];
    let length = way[0].hypot(way[1]);
    let width = 12.0;
    // Hundredths of units are whole numbers.
    let key = |x: f64, y: f64, z: f64, more: [f64; 4]| {
        let place = [x, y, z].map(|v| (v * 100.0).round() as i64);
        (place, more.map(|v| (v * 1000.0).round() as i64))
    };
    let mut wanted: Vec<_> = points
        .filter(|p| {
            let (x, y) = (p.x - ends[0][0], p.y - ends[0][1]);
            let along = (x * way[0] + y * way[1]) / length;
            let across = (way[0] * y - way[1] * x) / length;
            (0.0..=length).contains(&along) && across.abs() <= width / 2.0
        })
        .map(|p| {
            let class = f64::from(u8::from(p.classification));
            let more = [
                f64::from(p.intensity),
                class,
                f64::from(p.return_number),
                p.gps_time.unwrap_or(0.0),
            ];
            key(p.x, p.y, p.z, more)
        })
        .collect();
    let line = format!(
        "--line {},{},{},{}",
        ends[0][0], ends[0][1], ends[1][0], ends[1][1]
    );
    let made = run(
        at,
        &format!("{} {line} --width {width} --csv @t.csv", path.display()),
    );
    assert_eq!(made.code, 0, "{}", made.err);
    let (head, rows) = table(&fs::read_to_string(at.join("t.csv")).unwrap());
    let column = |name: &str| head.iter().position(|own| own == name).unwrap();
    let columns = ["intensity", "class", "return", "time"].map(column);
    let place = ["x", "y", "z"].map(column);
    let mut found: Vec<_> = rows
        .iter()
        .map(|row| {
            let [x, y, z] = place.map(|at| {
                assert_eq!(row[at].split('.').nth(1).unwrap().len(), 2, "{}", row[at]);
                row[at].parse().unwrap()
            });
            key(x, y, z, columns.map(|at| row[at].parse().unwrap()))
        })
        .collect();
    wanted.sort_unstable();
    found.sort_unstable();
    assert!(wanted.len() > 500, "{}", wanted.len());
    assert!(wanted == found, "{} {}", wanted.len(), found.len());
}
