//! `stability`: the folder it leaves, what it refuses.

use super::harness::{expect, names};

/// Scenes of few triangles by one method, on the CPU: tables, page and pictures are there and agree.
#[test]
fn a_folder_with_table_page_and_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let words = "stability -o out --scene edge-on,one-point,fence --method triangles,pop --splat square --device mirror";
    let run = expect(folder.path(), 0, words);
    let text = run.text();
    // triangles; pop; patches, but of the point; pop with another culling is for other scenes.
    assert!(text.contains("8 cells: "), "{text}");
    assert!(
        text.contains("fence, triangles: wires of 0.4 pixels"),
        "{text}"
    );
    let out = folder.path().join("out");
    assert_eq!(
        names(&out),
        [
            "failures-detail.png",
            "failures-limits.png",
            "failures-outline.png",
            "index.html",
            "pictures",
            "stability.csv"
        ]
    );
    assert_eq!(
        names(&out.join("pictures")),
        [
            "edge-on-patches.png",
            "edge-on-pop.png",
            "edge-on-triangles.png",
            "edge-on-truth.png",
            "fence-patches.png",
            "fence-pop.png",
            "fence-triangles.png",
            "fence-truth.png",
            "one-point-pop.png",
            "one-point-triangles.png"
        ]
    );
    let csv = std::fs::read_to_string(out.join("stability.csv")).unwrap();
    let rows: Vec<&str> = csv.trim_end().split("\r\n").collect();
    assert_eq!(rows.len(), 9, "{csv}");
    assert!(
        rows.iter()
            .any(|r| r.starts_with("fence,triangles,1,known limit,"))
    );
    let page = std::fs::read_to_string(out.join("index.html")).unwrap();
    // Eight pictures and the truth of the two scenes that are no clouds.
    assert_eq!(page.matches("<img ").count(), 10);
    assert!(!page.contains("src=\"http") && page.ends_with("</html>\n"));
}

#[test]
fn what_is_not_there_is_refused_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    for (words, reason) in [
        ("stability -o out --scene no-such-scene", "no-such-scene"),
        (
            "stability -o out --method points --splat gauss",
            "no way of drawing is left",
        ),
        (
            "stability -o out --quick --scene fence",
            "cannot be used with",
        ),
        ("stability", "--output"),
    ] {
        let run = expect(folder.path(), 2, words);
        assert!(run.err.contains(reason), "{words}: {}", run.err);
    }
    assert_eq!(names(folder.path()), [""; 0]);
    std::fs::write(folder.path().join("file"), "x").unwrap();
    let words = "stability -o file --scene empty --device mirror";
    let run = expect(folder.path(), 1, words);
    assert!(run.err.contains("cannot make the folder"), "{}", run.err);
}
