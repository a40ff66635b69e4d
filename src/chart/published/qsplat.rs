//! Rusinkiewicz and Levoy, *QSplat: A Multiresolution Point Rendering System for Large Meshes* (2000).
//!
//! The table of the paper (figure 6: speed, size and preprocessing a model) is a picture whose numbers are not in the
//! text at hand; what is compared here is what the text says.

use super::qsplat_codes::CodeFindings;
use super::{PublishedCell, PublishedSubject, PublishedTable, count, measure};
use crate::chart::ChartError;
use crate::chart::run::orbit;
use crate::pages::write::{PagedOptions, to_bytes};
use crate::progress::Progress;
use crate::render::engine::Backend;
use crate::render::{Blend, Method, Path, Settings, SplatKind};

/// What the text says, beside a model of ours drawn as splats in a window of 500 x 500 pixels.
///
/// # Errors
/// When a frame cannot be drawn, or `progress` is cancelled.
pub fn tables(
    backend: &Backend,
    subject: &PublishedSubject<'_>,
    repeats: u32,
    progress: &dyn Progress,
) -> Result<Vec<PublishedTable>, ChartError> {
    let model = subject.model;
    let view = orbit(model, (500, 500), 1.0, 0, 4)?;
    let splats = |splat, blend, threshold_px| PublishedCell {
        view,
        settings: Settings {
            method: Method::Splats,
            splat,
            blend,
            threshold_px,
            path: Path::Raster,
            ..Settings::default()
        },
    };
    let cells = [
        splats(SplatKind::Square, None, 1.0),
        splats(SplatKind::Square, None, 3.0),
        splats(SplatKind::Square, None, 20.0),
        splats(SplatKind::Disc, None, 20.0),
        splats(SplatKind::Gauss, Some(Blend::TwoPass), 20.0),
    ];
    let measured = measure(backend, model, &cells, repeats, progress)?;
    let leaves = model.tree.leaves.len() as f64;
    let mut table = PublishedTable::new(
        format!("QSplat: {} ({} leaves)", subject.name, count(leaves as u64)),
        &["", "section", "QSplat", "surfel", "remark"],
    );
    let mut row = |what: &str, section: &str, theirs: &str, ours: String, remark: &str| {
        let cells = [what, section, theirs, &ours, remark];
        table.row(cells.map(str::to_owned).to_vec());
    };
    row(
        "nodes over leaves",
        "3.2",
        "1.4",
        format!("{:.3}", subject.nodes() as f64 / leaves.max(1.0)),
        "its branching 3.5; ours 4 but for the last level",
    );
    if let Some(found) = CodeFindings::of(model, &view) {
        code_rows(&found, &mut row);
    }
    let paged = to_bytes(model, &PagedOptions::default())?.len() as f64;
    row(
        "bytes a leaf, this program's paged files",
        "3.2",
        "6 (9 with color)",
        format!("{:.1}", paged / leaves.max(1.0)),
        "of a surface with its triangles",
    );
    let build = if subject.build_s > 0.0 {
        format!("{:.0}", model.vertices.len() as f64 / subject.build_s)
    } else {
        "-".into()
    };
    row(
        "preprocessing, vertices a second",
        "4.2",
        "40000 (200 k in 5 s)",
        build,
        "58000 for its bunny (35 k in 0.6 s); machines of 2000",
    );
    for (i, threshold) in [1, 3].into_iter().enumerate() {
        let (ms, counts) = measured[i];
        row(
            &format!("splats a frame, threshold {threshold}"),
            "4.1",
            "50 k to 70 k (laptop), 200 k to 300 k (Onyx2)",
            count(counts.splats),
            "its thresholds follow the frame rate and are not printed",
        );
        row(
            &format!("million splats a second, threshold {threshold}"),
            "4.1",
            "0.25 to 0.4 (laptop, software), 1.5 to 2.5 (Onyx2)",
            format!("{:.2}", counts.splats as f64 / ms / 1e3),
            "",
        );
    }
    let square = measured[2].0;
    row(
        "disc over square, time at 20 px",
        "fig. 3",
        "2",
        format!("{:.2}", measured[3].0 / square),
        "cost of a kernel at equal threshold; depends on the device",
    );
    row(
        "Gaussian over square, time at 20 px",
        "fig. 3",
        "4",
        format!("{:.2}", measured[4].0 / square),
        "its Gaussians are blended in one pass over sorted splats, ours in two",
    );
    row(
        "figure 6: speed, size, preprocessing a model",
        "4",
        "-",
        "-".into(),
        "a picture in the source; its numbers are not in the text",
    );
    row(
        "St. Matthew, 127 M samples",
        "fig. 1",
        "-",
        "-".into(),
        "the model is not public",
    );
    Ok(vec![table])
}

/// A row of the table: what, section, theirs, ours, remark.
type RowWriter<'a> = dyn FnMut(&str, &str, &str, String, &str) + 'a;

/// Rows of the codes of spheres and cones.
fn code_rows(found: &CodeFindings, row: &mut RowWriter<'_>) {
    let [plain, colored] = found.bytes_a_leaf;
    row(
        "bytes a leaf, as a .qs file",
        "3.2",
        "6 (9 with color)",
        format!("{plain:.2} ({colored:.2})"),
        "4 or 6 a node, and 4 for each group with grandchildren",
    );
    row(
        "error of centers along an axis, radius of the parent 1",
        "3.1",
        "0.04",
        format!("{:.3}", found.axis_error),
        "mean of all nodes",
    );
    row(
        "error of radii, radius of the parent 1",
        "3.1",
        "0.15",
        format!("{:.3}", found.radius_error),
        "decoded spheres contain the true ones",
    );
    let [exact, coded] = found.culled;
    row(
        "leaves culled as facing away, by exact cones",
        "3.1",
        "-",
        format!("{:.1} %", 100.0 * exact),
        "with exact spheres",
    );
    row(
        "of these culled by 2-bit cones",
        "3.1",
        "90 %",
        format!("{:.1} %", 100.0 * coded / exact.max(f64::MIN_POSITIVE)),
        "with decoded spheres",
    );
}
