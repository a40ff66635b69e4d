//! `photos walk`, `profile --photos` and `chart --photos`: figures of a generated scene.

use super::harness::expect;
use serde_json::json;
use std::collections::HashMap;
use std::path::Path;

/// A square with three photographs of it, from left to right.
fn scene(folder: &Path) {
    let mesh = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                element face 2\nproperty list uchar int vertex_indices\nend_header\n\
                -2 -2 0\n2 -2 0\n2 2 0\n-2 2 0\n3 0 1 2\n3 0 2 3\n";
    std::fs::write(folder.join("mesh.ply"), mesh).unwrap();
    let frames = (0..3_u8).map(|k| {
        let name = format!("{k}.png");
        let color = |x: u32, y: u32| image::Rgb([40 * k + 8 * (x % 16) as u8, 5 * y as u8, 90]);
        image::RgbImage::from_fn(40, 30, color).save(folder.join(&name)).unwrap();
        let x = f64::from(k) - 1.0;
        json!({"file_path": name, "transform_matrix": [[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]})
    });
    let all = json!({"fl_x": 36.0, "w": 40, "h": 30, "frames": frames.collect::<Vec<_>>()});
    std::fs::write(folder.join("transforms.json"), all.to_string()).unwrap();
}

#[test]
fn a_walk_prints_its_ratio_and_writes_every_step() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    scene(at);
    let walk = "photos walk transforms.json --mesh mesh.ply --backend cpu --frames 5 --side 32";
    let text = expect(at, 0, walk).text();
    assert!(
        text.starts_with("4 steps") && text.contains("times"),
        "{text}"
    );
    for name in ["walk.csv", "walk.svg", "walk.png"] {
        expect(at, 0, &format!("{walk} -o {name}"));
    }
    let rows = std::fs::read_to_string(at.join("walk.csv")).unwrap();
    let rows: Vec<Vec<f64>> = (rows.lines().skip(1))
        .map(|row| row.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    assert_eq!(rows.len(), 4);
    // The camera moves, so that both change.
    assert!(
        rows.iter().all(|row| row[1] > 0.0 && row[2] > 0.0),
        "{rows:?}"
    );
    let largest = rows.iter().map(|row| row[1]).fold(0.0, f64::max);
    assert!(
        text.contains(&format!("at most {largest:.4} by view")),
        "{text} {rows:?}"
    );
    assert!(
        std::fs::read_to_string(at.join("walk.svg"))
            .unwrap()
            .contains("fixed texture")
    );
    expect(at, 2, &format!("{walk} -o walk.gif"));
    expect(
        at,
        2,
        "photos walk transforms.json --mesh mesh.ply --frames 1",
    );
}

#[cfg(feature = "viewer")]
#[test]
fn a_window_of_photographs_takes_a_scene_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    scene(at);
    for (arguments, words) in [
        ("photos mesh.ply", "of none of the formats"),
        ("photos nothing", "there is nothing of that name"),
        ("photos --mesh mesh.ply", "no scene of photographs is named"),
        ("photos transforms.json transforms.json", "one scene"),
        (
            "photos --panel on score transforms.json --mesh mesh.ply",
            "does not go with the command 'score'",
        ),
    ] {
        let said = expect(at, 2, arguments).err;
        assert!(said.contains(words), "{arguments}: {said}");
    }
    // What goes with every command may stand before one.
    expect(
        at,
        0,
        "photos --quiet walk transforms.json --mesh mesh.ply --backend cpu --frames 3 --side 32",
    );
}

#[test]
fn a_profile_has_the_time_of_photographs() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    scene(at);
    let profile = "profile mesh.ply --photos transforms.json --size 32x24 --frames 2 --backend cpu";
    let found = expect(at, 0, &format!("{profile} --json -")).json();
    assert!(found["photo_choice_ms"]["median"].as_f64().unwrap() > 0.0);
    let of = |name: &str| {
        let stages = found["cpu"].as_array().unwrap();
        let stage = stages.iter().find(|stage| stage["name"] == name).unwrap();
        stage["ms"]["median"].as_f64().unwrap()
    };
    assert!(of("look") > 0.0 && of("pack") > 0.0, "{found}");
    assert!(
        expect(at, 0, profile)
            .text()
            .contains("choice of photographs")
    );
    let plain = expect(
        at,
        0,
        "profile mesh.ply --size 32x24 --frames 2 --backend cpu --json -",
    )
    .json();
    assert!(plain.get("photo_choice_ms").is_none(), "{plain}");
}

#[test]
fn a_chart_has_time_and_error_with_photographs() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    scene(at);
    let few = "--size 40x32 --thresholds 2 --fills 1 --views 4 --repeats 1 --device cpu --quiet";
    let rows = |more: &str, out: &str| -> Vec<HashMap<String, String>> {
        expect(at, 0, &format!("chart mesh.ply -o {out} {few} {more}"));
        let mut reader = csv::Reader::from_path(at.join(out).join("rows.csv")).unwrap();
        reader.deserialize().map(Result::unwrap).collect()
    };
    let with = rows("--photos transforms.json", "with");
    let without = rows("", "without");
    let mut compared = 0;
    for (with, without) in with.iter().zip(&without) {
        assert_eq!(
            with["model"],
            format!("{} with photographs", without["model"])
        );
        let of = |row: &HashMap<String, String>, name: &str| row[name].parse::<f64>();
        if let (Ok(own), Ok(plain)) = (of(with, "flip"), of(without, "flip"))
            && own.is_finite()
        {
            // A smooth square has errors at its outline alone; photographs, on the front, have some within.
            compared += usize::from(own != plain);
            assert!(of(with, "frame_ms").unwrap() > 0.0);
        }
    }
    assert!(compared > 1, "{compared} of {}", with.len());
    let two = "chart mesh.ply generate:square:8 --photos transforms.json -o two";
    expect(at, 2, two);
}
