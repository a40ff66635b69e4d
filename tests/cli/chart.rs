//! `chart`: files that programs can read, going on after an interruption, usage.

use super::harness::{expect, has_device, names, surfel_in};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Rows of a CSV file by the names of their columns.
fn rows(path: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

const MODEL: &str = "generate:statue:3000";
const FEW: &str = "--size 72x64 --thresholds 1,3 --fills 1,0.5 --views 2 --repeats 2 --quiet";

#[test]
fn a_chart_of_a_small_model_is_whole() {
    if !has_device() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let run = expect(
        folder.path(),
        0,
        &format!("chart {MODEL} -o out {FEW} --json --validate"),
    );
    let json = run.json();
    let out = folder.path().join("out");
    assert_eq!(
        names(&out),
        ["chart.png", "chart.svg", "index.html", "rows.csv"]
    );
    let rows = rows(&out.join("rows.csv"));
    let listed = expect(folder.path(), 0, "devices --json").json();
    let mut devices = listed.as_array().unwrap().iter().map(|d| &d["device"]);
    let device = devices.find(|d| d["name"] == *rows[0]["device"]).unwrap();
    let is_software = device["kind"] == "cpu";
    let panels = json["panels"].as_array().unwrap();
    assert_eq!(panels.len(), 2);
    for panel in panels {
        let points = panel["points"].as_array().unwrap();
        let refused = panel["refused"].as_array().unwrap();
        assert!(refused.is_empty(), "{refused:?}");
        let number = |p: &Value, key: &str| p[key].as_f64().unwrap();
        for point in points {
            let name = point["name"].as_str().unwrap();
            let own: Vec<_> = rows
                .iter()
                .filter(|r| {
                    ["method", "splat", "path"]
                        .iter()
                        .all(|k| point[*k].as_str() == Some(r[*k].as_str()))
                        && r["threshold_px"].parse() == Ok(number(point, "threshold_px"))
                        && r["fill"].parse() == Ok(panel["fill"].as_f64().unwrap())
                })
                .collect();
            assert_eq!(own.len(), 2, "{name}");
            for row in own {
                let value = |key: &str| row[key].parse::<f64>().unwrap();
                assert!(value("frame_p5_ms") <= value("frame_ms"));
                assert!(value("frame_ms") <= value("frame_p95_ms") && value("frame_ms") > 0.0);
                assert!(value("cpu_ms") <= value("frame_ms") + 1e-6, "{name}");
                assert!((0.0..=1.0).contains(&value("flip")) && value("ssim") <= 1.0);
                assert!(value("flip_object") >= value("flip"));
                assert_eq!(row["samples"], "64");
                assert!(!row["device"].is_empty() && !row["driver"].is_empty());
                let passes = row["passes_ms"].as_str();
                // What the host draws alone has none.
                assert!(!passes.is_empty() || row["path"] == "auto", "{name}");
                for pass in passes.split("; ").filter(|pass| !pass.is_empty()) {
                    let (_, ms) = pass.split_once('=').unwrap();
                    assert_eq!(ms.split('/').count(), 3, "{pass}");
                }
            }
        }
        // Triangles at the pixel centers are off by what supersampling smooths, and not by their depth.
        let triangles = &points[0];
        assert_eq!(triangles["name"], "triangles");
        assert_eq!(number(triangles, "depth_footprints"), 0.0);
        assert_eq!(number(triangles, "normal_degrees"), 0.0);
        assert!(number(triangles, "flip") > 0.0 && number(triangles, "flip") < 0.2);
        // Squares of three pixels are farther off than those of one.
        let flip = |name: &str| {
            let point = points.iter().find(|p| p["name"] == name).unwrap();
            number(point, "flip")
        };
        assert!(flip("splats square, 3 px") > flip("splats square, 1 px"));
        // Compute draws the same picture.
        for line in ["pop square", "pop gauss", "pop filtered", "splats filtered"] {
            let twin = flip(&format!("{line}, compute, 3 px"));
            // Sums in fixed point and in floats round differently: a level here and there.
            assert!(
                (flip(&format!("{line}, 3 px")) - twin).abs() < 5e-4,
                "{line}: {twin}"
            );
        }
        // And so does the host, which draws what is left to the program.
        for line in [
            "pop square",
            "pop disc",
            "pop filtered",
            "splats square",
            "splats filtered",
        ] {
            let name = format!("{line}, auto, 3 px");
            assert_eq!(
                points.iter().any(|p| p["name"] == name),
                is_software,
                "{name}"
            );
            if is_software {
                let off = (flip(&format!("{line}, 3 px")) - flip(&name)).abs();
                assert!(off < 5e-4, "{line}: {off}");
            }
        }
        let frontier = panel["frontier"].as_array().unwrap();
        assert!(!frontier.is_empty());
    }
    // Vertices as points, splats and pop with six kinds of splats and their twins, triangles; 2 distances and 2 views.
    let choices = panels[0]["points"].as_array().unwrap().len();
    assert_eq!(rows.len(), choices * 4);

    let svg = std::fs::read_to_string(out.join("chart.svg")).unwrap();
    assert_eq!(svg.matches("data-point=").count(), choices * 2);
    let page = std::fs::read_to_string(out.join("index.html")).unwrap();
    assert!(page.contains("data:image/png;base64,") && !page.contains("src=\"http"));
    let png = std::fs::read(out.join("chart.png")).unwrap();
    assert_eq!(&png[1..4], b"PNG");
}

#[test]
fn a_chart_goes_on_where_it_was_interrupted() {
    if !has_device() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let args = "--size 48x48 --thresholds 2 --fills 1 --views 2 --repeats 1 --quiet";
    let command = format!("chart {MODEL} -o out {args}");
    expect(folder.path(), 0, &command);
    let path = folder.path().join("out/rows.csv");
    let whole = std::fs::read_to_string(&path).unwrap();
    let all = rows(&path);
    // The first view as it was but for a mark; the second is cut off in the middle, so it is measured again.
    let kept = all.len() / 2 + 3;
    let mut marked: Vec<BTreeMap<String, String>> = all[..kept].to_vec();
    marked[0].insert("draw_list_bytes".into(), "987654321".into());
    marked[kept - 1].insert("draw_list_bytes".into(), "123456789".into());
    let columns: Vec<String> = whole
        .lines()
        .next()
        .unwrap()
        .split(',')
        .map(Into::into)
        .collect();
    let mut writer = csv::Writer::from_path(&path).unwrap();
    writer.write_record(&columns).unwrap();
    for row in &marked {
        writer
            .write_record(columns.iter().map(|c| &row[c]))
            .unwrap();
    }
    drop(writer);
    expect(folder.path(), 0, &command);
    let again = rows(&path);
    assert_eq!(again.len(), all.len());
    assert_eq!(again[..all.len() / 2], marked[..all.len() / 2]);
    assert!(again.iter().all(|r| r["draw_list_bytes"] != "123456789"));
    let names = |rows: &[BTreeMap<String, String>]| -> Vec<String> {
        rows.iter()
            .map(|r| format!("{} {} {} {}", r["method"], r["splat"], r["path"], r["view"]))
            .collect()
    };
    assert_eq!(names(&again), names(&all));

    // Rows of another effort do not count, and are not lost.
    let run = expect(
        folder.path(),
        0,
        &command.replace("--repeats 1", "--repeats 2"),
    );
    assert!(run.err.contains("rows.other.csv"), "{}", run.err);
    assert!(rows(&path).iter().all(|r| r["repeats"] == "2"));
    assert_eq!(rows(&folder.path().join("out/rows.other.csv")), again);
}

#[test]
fn clouds_and_the_mirror_have_charts_too() {
    let folder = tempfile::tempdir().unwrap();
    let points: String = (0..400)
        .map(|i| {
            let (a, h) = (f64::from(i) * 2.4, f64::from(i) / 200.0 - 1.0);
            let r = (1.0 - h * h).sqrt();
            let (x, z) = (r * a.cos(), r * a.sin());
            format!("{x} {h} {z} {x} {h} {z}\n")
        })
        .collect();
    let header = "ply\nformat ascii 1.0\nelement vertex 400\nproperty float x\nproperty float y\nproperty float z\n\
                  property float nx\nproperty float ny\nproperty float nz\nend_header\n";
    std::fs::write(folder.path().join("cloud.ply"), header.to_owned() + &points).unwrap();
    let run = expect(
        folder.path(),
        0,
        "chart cloud.ply -o out --quick --size 40x40 --fills 1 --repeats 1 --device mirror --json --quiet",
    );
    let json = run.json();
    let panel = &json["panels"][0];
    assert!(panel["points"].as_array().unwrap().len() >= 8, "{panel}");
    assert!(panel["points"][0]["times_faster_than_triangles"].is_null());
    assert_eq!(json["device"]["name"], "reference");

    // The same rows in another folder agree; with one that is twice as slow they do not, and it is named.
    let again = "chart cloud.ply -o again --quick --size 40x40 --fills 1 --repeats 1 --device mirror --quiet";
    let [first, second] = ["out", "again"].map(|name| folder.path().join(name).join("rows.csv"));
    std::fs::create_dir(second.parent().unwrap()).unwrap();
    std::fs::copy(&first, &second).unwrap();
    let run = expect(folder.path(), 0, &format!("{again} --against out"));
    assert!(run.text().contains("the runs agree"), "{}", run.text());
    let mut reader = csv::Reader::from_path(&first).unwrap();
    let columns = reader.headers().unwrap().clone();
    let place = |name: &str| columns.iter().position(|c| c == name).unwrap();
    let mut writer = csv::Writer::from_path(&second).unwrap();
    writer.write_record(&columns).unwrap();
    for (i, record) in reader.records().enumerate() {
        let mut fields: Vec<String> = record.unwrap().iter().map(Into::into).collect();
        if i == 3 {
            let ms = &mut fields[place("frame_ms")];
            *ms = (2.0 * ms.parse::<f64>().unwrap()).to_string();
        }
        writer.write_record(&fields).unwrap();
    }
    drop(writer);
    let run = expect(folder.path(), 1, &format!("{again} --against out"));
    let name = panel["points"][3]["name"].as_str().unwrap();
    assert!(
        run.text().contains("DIFFER") && run.text().contains(&format!("  {name}: ")),
        "{}",
        run.text()
    );
    assert!(run.err.contains("15 percent"), "{}", run.err);
}

#[test]
fn charts_refuse_what_they_cannot_measure() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    for (words, says) in [
        ("chart -o out", "MODEL"),
        ("chart generate:square:8", "--output"),
        ("chart a.ply a.ply -o out", "named twice"),
        ("chart a.ply -o out --thresholds 1,-2", "--thresholds"),
        ("chart a.ply -o out --thresholds 1 --quick", "--quick"),
        ("chart a.ply -o out --fills 0", "--fills 0"),
        ("chart a.ply -o out --views 0", "--views"),
        ("chart a.ply -o out --against out", "--against"),
        ("chart a.ply -o out --against nowhere", "nowhere"),
        ("chart nothing.ply -o out --device mirror", "nothing.ply"),
    ] {
        let run = expect(path, 2, words);
        assert!(run.err.contains(says), "{words}: {}", run.err);
        assert!(names(path).is_empty(), "{words}");
    }
    // What is no file of rows is not written over.
    std::fs::create_dir(path.join("out")).unwrap();
    std::fs::write(path.join("out/rows.csv"), "a,b\n1,2\n").unwrap();
    let run = surfel_in(
        path,
        "chart generate:square:8 -o out --quick --device mirror".split(' '),
    );
    assert_eq!(run.code, 2);
    assert!(run.err.contains("rows.csv, line 1"), "{}", run.err);
    assert_eq!(
        std::fs::read_to_string(path.join("out/rows.csv")).unwrap(),
        "a,b\n1,2\n"
    );
}

#[test]
#[cfg(unix)]
fn interrupting_a_chart_leaves_whole_views() {
    use std::io::Read;
    let folder = tempfile::tempdir().unwrap();
    let mut command = super::harness::command();
    command
        .args(
            "chart generate:statue:500 -o out --device mirror --size 32x32 --fills 1 --quick --views 360 --repeats 1 --quiet"
                .split_whitespace(),
        )
        .current_dir(folder.path())
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::piped());
    let mut child = command.spawn().unwrap();
    let path = folder.path().join("out/rows.csv");
    let start = std::time::Instant::now();
    while !path.exists() {
        assert!(start.elapsed().as_secs() < 100, "no view within 100 s");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let killed = std::process::Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(killed.success());
    let code = super::harness::wait(&mut child);
    let mut err = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut err)
        .unwrap();
    assert_eq!(code, Some(1), "{err}");
    assert!(err.contains("goes on"), "{err}");
    assert_eq!(names(&folder.path().join("out")), ["rows.csv"]);
    let rows = rows(&path);
    let of_first = rows.iter().filter(|r| r["view"] == "0").count();
    assert!(
        of_first > 10 && rows.len().is_multiple_of(of_first),
        "{}",
        rows.len()
    );
}
