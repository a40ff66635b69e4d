//! The list of files that were shown before.

use super::*;

#[test]
fn recent_files_unfold_and_open() {
    let (facts, settings, mut stage) = (facts(), Settings::default(), Stage::new());
    let files: Vec<PathBuf> = vec!["/scans/one.ply".into(), "/scans/two.obj".into()];
    let with = |recent| PanelState {
        recent,
        ..state(&settings, &facts)
    };
    let of_files = |seen: &Seen| ["Recent files", "one.ply", "two.obj"].contains(&&*seen.name);
    assert!(
        !stage.controls(&with(&[])).iter().any(of_files),
        "there are none"
    );
    let shown = with(&files);
    let folded: Vec<Seen> = stage
        .controls(&shown)
        .into_iter()
        .filter(of_files)
        .collect();
    assert_eq!(folded.len(), 1, "{folded:?}");
    stage.click(&shown, folded[0].middle);
    let found: Vec<Seen> = stage
        .controls(&shown)
        .into_iter()
        .filter(of_files)
        .collect();
    assert_eq!(found.len(), 3, "{found:?}");
    // Nodes come in no order.
    let second = found.iter().find(|seen| seen.name == "two.obj").unwrap();
    let wishes = stage.click(&shown, second.middle);
    assert_eq!(wishes, [PanelWish::Open(files[1].clone())]);
}
