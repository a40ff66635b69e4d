//! One measurement as a row of `rows.csv`, and the file of them.

use super::{ChartError, DrawConfiguration};
use crate::measure::ValueDistribution;
use crate::printable::{MOST_CHARS, printable};
use std::path::Path;

/// What one choice cost and how far it was off, from one view. Times in milliseconds, errors as [`super::errors::PictureErrors`]
/// has them; NaN where there is none. `docs/MEASURING.md` has a line on every column.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "docs/MEASURING.md has a line on every column")]
pub struct ChartRow {
    pub version: String,
    pub commit: String,
    pub device: String,
    pub driver: String,
    pub model: String,
    pub model_triangles: u64,
    pub model_vertices: u64,
    pub width: u32,
    pub height: u32,
    pub fill: f64,
    pub view: u32,
    pub views: u32,
    pub method: String,
    pub splat: String,
    pub path: String,
    pub threshold_px: f32,
    pub samples: u32,
    pub repeats: u32,
    pub refused: String,
    pub frame_ms: f64,
    pub frame_p5_ms: f64,
    pub frame_p95_ms: f64,
    pub cpu_ms: f64,
    pub cpu_p5_ms: f64,
    pub cpu_p95_ms: f64,
    pub cut_ms: f64,
    pub pack_ms: f64,
    pub upload_ms: f64,
    pub submit_ms: f64,
    pub wait_ms: f64,
    pub passes_ms: String,
    pub nodes_visited: u64,
    pub splats: u64,
    pub triangles: u64,
    pub points: u64,
    pub draw_list_bytes: u64,
    pub flip: f64,
    pub flip_object: f64,
    pub psnr_db: f64,
    pub psnr_object_db: f64,
    pub ssim: f64,
    pub object_pixels: u64,
    pub missing: u64,
    pub extra: u64,
    pub holes: u64,
    pub hole_pixels: u64,
    pub silhouette_mean_px: f64,
    pub silhouette_p99_px: f64,
    pub depth_mean_footprints: f64,
    pub depth_p99_footprints: f64,
    pub normal_mean_degrees: f64,
    pub normal_p99_degrees: f64,
    pub worst_x: u32,
    pub worst_y: u32,
    pub worst_side: u32,
    pub worst_levels: f64,
}

impl ChartRow {
    /// The choice; `None` when the words of the file name none.
    pub fn choice(&self) -> Option<DrawConfiguration> {
        DrawConfiguration::of_words(&self.method, &self.splat, &self.path, self.threshold_px)
    }

    /// Tells whether another row was measured under the same conditions: program, device, picture and effort.
    pub fn is_like(&self, other: &Self) -> bool {
        let conditions = |r: &Self| {
            (
                [
                    r.version.clone(),
                    r.commit.clone(),
                    r.device.clone(),
                    r.driver.clone(),
                ],
                [r.width, r.height, r.views, r.samples, r.repeats],
            )
        };
        conditions(self) == conditions(other)
    }

    /// Tells whether it is of the same model, distance and view.
    pub fn is_of_block(&self, other: &Self) -> bool {
        self.model == other.model
            && self.model_triangles == other.model_triangles
            && self.model_vertices == other.model_vertices
            && self.fill == other.fill
            && self.view == other.view
    }

    /// Median, 5th and 95th percentile of the frame.
    pub fn frame(&self) -> ValueDistribution {
        ValueDistribution {
            median: self.frame_ms,
            p5: self.frame_p5_ms,
            p95: self.frame_p95_ms,
        }
    }
}

/// Writes rows with a header, beside `path` and renamed.
///
/// # Errors
/// When the file cannot be written.
pub fn write_rows(path: &Path, rows: &[ChartRow]) -> Result<(), ChartError> {
    crate::image::write(path, |file| {
        let mut writer = csv::Writer::from_writer(file);
        for row in rows {
            writer.serialize(row).map_err(std::io::Error::other)?;
        }
        writer.flush()
    })?;
    Ok(())
}

/// Reads rows back; none where there is no file.
///
/// # Errors
/// [`ChartError::Rows`] with the line when the file is not readable or holds something else.
pub fn read_rows(path: &Path) -> Result<Vec<ChartRow>, ChartError> {
    let fail = |line: u64, cause: String| ChartError::Rows {
        path: path.to_owned(),
        line,
        cause,
    };
    let file = match std::fs::File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(fail(0, error.to_string())),
    };
    let mut reader = csv::Reader::from_reader(std::io::BufReader::new(file));
    let headers = reader.headers().map_err(|e| fail(0, e.to_string()))?;
    // An empty file has none.
    if !headers.is_empty() && !headers.iter().take(2).eq(["version", "commit"]) {
        return Err(fail(1, "these are no rows of a chart".into()));
    }
    reader
        .into_deserialize()
        .map(|row: Result<ChartRow, csv::Error>| {
            let row = row.map_err(|error| {
                let line = error.position().map_or(0, csv::Position::line);
                let cause = match error.kind() {
                    csv::ErrorKind::Deserialize { err, .. } => {
                        printable(&err.to_string(), MOST_CHARS)
                    }
                    _ => printable(&error.to_string(), MOST_CHARS),
                };
                fail(line, cause)
            })?;
            if row.choice().is_none() {
                let cause = format!("no choice: {} {} {}", row.method, row.splat, row.path);
                return Err(fail(0, printable(&cause, MOST_CHARS)));
            }
            Ok(row)
        })
        .collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
pub(super) mod tests {
    use super::super::AvailablePaths;
    use super::*;

    /// A row of figures that differ from each other.
    pub(in crate::chart) fn row(
        model: &str,
        choice: DrawConfiguration,
        fill: f64,
        view: u32,
    ) -> ChartRow {
        let [method, splat, path] = choice.words();
        ChartRow {
            version: "1.2.3".into(),
            commit: String::new(),
            device: "a device, \"quoted\"".into(),
            driver: "driver\nof two lines".into(),
            model: model.into(),
            model_triangles: 12,
            model_vertices: 8,
            width: 500,
            height: 400,
            fill,
            view,
            views: 2,
            method,
            splat,
            path,
            threshold_px: choice.threshold_px,
            samples: 64,
            repeats: 5,
            refused: String::new(),
            frame_ms: 1.0 / 3.0,
            frame_p5_ms: 0.1,
            frame_p95_ms: 0.7,
            cpu_ms: 0.2,
            cpu_p5_ms: 0.19,
            cpu_p95_ms: 0.21,
            cut_ms: 0.01,
            pack_ms: 0.02,
            upload_ms: 0.0,
            submit_ms: 0.03,
            wait_ms: 0.3,
            passes_ms: "a.b=1/2/3; c.d=4/5/6".into(),
            nodes_visited: 1,
            splats: 2,
            triangles: 3,
            points: 4,
            draw_list_bytes: 5,
            flip: 0.01,
            flip_object: 0.02,
            psnr_db: f64::INFINITY,
            psnr_object_db: 30.0,
            ssim: 0.9,
            object_pixels: 7,
            missing: 8,
            extra: 9,
            holes: 10,
            hole_pixels: 11,
            silhouette_mean_px: 0.5,
            silhouette_p99_px: 2.0,
            depth_mean_footprints: 0.25,
            depth_p99_footprints: 1.5,
            normal_mean_degrees: 3.0,
            normal_p99_degrees: 30.0,
            worst_x: 16,
            worst_y: 32,
            worst_side: 32,
            worst_levels: 12.5,
        }
    }

    #[test]
    fn rows_come_back_as_they_were() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows.csv");
        assert_eq!(read_rows(&path).unwrap(), Vec::new());
        let rows: Vec<ChartRow> = DrawConfiguration::few(false, AvailablePaths::ALL)
            .into_iter()
            .enumerate()
            .map(|(i, c)| row("m, \"n\"", c, [1.0, 0.125][i % 2], i as u32))
            .collect();
        write_rows(&path, &rows).unwrap();
        assert_eq!(read_rows(&path).unwrap(), rows);
        assert!(rows[0].is_like(&rows[1]) && !rows[0].is_of_block(&rows[1]));

        // What has no value has none afterwards.
        let mut none = rows[0].clone();
        none.normal_mean_degrees = f64::NAN;
        write_rows(&path, &[none]).unwrap();
        assert!(read_rows(&path).unwrap()[0].normal_mean_degrees.is_nan());
    }

    #[test]
    fn damaged_files_are_refused_with_their_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows.csv");
        let one = row("m", super::super::choice::TRIANGLES, 1.0, 0);
        write_rows(&path, &[one.clone(), one]).unwrap();
        let whole = std::fs::read_to_string(&path).unwrap();
        for (damage, line) in [
            (whole.replace(",500,400,", ",500,x,"), 2),
            (whole.replace("frame_ms", "frame_s"), 2),
            (whole.replace(",triangles,square,", ",spheres,square,"), 0),
            // Cut in the middle of the last row: too few fields.
            (whole[..whole.len() - 40].to_owned(), 4),
        ] {
            assert_ne!(damage, whole);
            std::fs::write(&path, &damage).unwrap();
            match read_rows(&path) {
                Err(ChartError::Rows { line: found, .. }) => assert_eq!(found, line, "{damage}"),
                other => panic!("{other:?}"),
            }
        }
        std::fs::write(&path, [0xff, 0xfe, b'\n', 0, b'\n']).unwrap();
        assert!(read_rows(&path).is_err());
        assert!(read_rows(folder.path()).is_err());
    }
}
