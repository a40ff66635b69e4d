//! A coarse sample of a large file, before its points are read: what a window shows meanwhile.

use super::byte_of_color;
use super::fields::{PointLayout, RecordBlock};
use super::header::LasHeader;
use crate::input::assemble::StepGrid;
use crate::input::job::ReadJob;
use crate::progress::PointSample;
use glam::DVec3;

/// Files of fewer points are read before anybody could look at a sample.
const LEAST_POINTS: u64 = 1_000_000;
/// Points of a sample, about.
const SAMPLE_POINTS: usize = 40_000;

/// Places that a sample takes, and how many points of each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SamplePlan {
    /// One of so many places is looked at.
    pub(super) step: usize,
    /// Points of each.
    pub(super) points: usize,
}

impl SamplePlan {
    /// The plan for a file of so many points in so many places; `None` where no sample is wanted.
    pub(super) fn of(job: &ReadJob<'_>, points: u64, places: usize) -> Option<Self> {
        let is_wanted = points >= LEAST_POINTS && job.progress.wants_sample();
        is_wanted.then(|| Self {
            step: places.div_ceil(SAMPLE_POINTS).max(1),
            points: SAMPLE_POINTS.div_ceil(places.max(1)),
        })
    }
}

/// Rows of a file that is not packed, evenly.
pub(super) fn of_rows(layout: &PointLayout, rows: &[u8], plan: SamplePlan) -> RecordBlock {
    let rows = rows.chunks_exact(layout.record_bytes).step_by(plan.step);
    layout
        .clone()
        .without_fields()
        .block(&rows.collect::<Vec<_>>().concat())
}

/// Gives points as a sample of the file.
pub(super) fn give(job: &ReadJob<'_>, header: &LasHeader, blocks: &[RecordBlock]) {
    let grid = StepGrid {
        steps: Vec::new(),
        scale: DVec3::from_array(header.scale),
        offset: DVec3::from_array(header.offset),
    };
    let colors = || blocks.iter().flat_map(|block| &block.colors);
    let largest = colors().flatten().copied().max().unwrap_or(0);
    let color = |&[r, g, b]: &[u16; 3]| {
        let [r, g, b] = [r, g, b].map(|value| byte_of_color(value, largest));
        [r, g, b, 255]
    };
    let steps = blocks.iter().flat_map(|block| &block.steps);
    let places: Vec<DVec3> = steps.map(|&step| grid.place(step)).collect();
    let is_usable = places.iter().all(|place| place.is_finite());
    if is_usable && !places.is_empty() {
        job.progress.sample(PointSample {
            places,
            colors: match largest {
                0 => Vec::new(),
                _ => colors().map(color).collect(),
            },
        });
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use crate::input::{self, write_las};
    use crate::mesh::Mesh;
    use crate::mesh::attributes::PointAttributes;
    use crate::progress::{PointSample, Progress};
    use glam::{DVec3, Vec3};
    use std::path::Path;
    use std::sync::Mutex;

    /// Takes samples.
    #[derive(Default)]
    struct SampleList(Mutex<Vec<PointSample>>);

    impl Progress for SampleList {
        fn stage(&self, _: &str, _: u64) {}

        fn advance(&self, _: u64) {}

        fn wants_sample(&self) -> bool {
            true
        }

        fn sample(&self, sample: PointSample) {
            self.0.lock().unwrap().push(sample);
        }
    }

    fn samples_of(path: &Path, rows: u32) -> Vec<PointSample> {
        let mesh = Mesh {
            positions: (0..1000 * rows)
                .map(|i| Vec3::new((i % 1000) as f32, (i / 1000) as f32, 2.0))
                .collect(),
            origin: DVec3::new(5e5, 4e6, 0.0),
            ..Mesh::default()
        };
        let is_packed = path.extension().is_some_and(|ending| ending == "laz");
        let mut file = std::io::BufWriter::new(std::fs::File::create(path).unwrap());
        write_las(
            (&mesh, &PointAttributes::default()),
            &input::CoordinateRecords::default(),
            is_packed,
            &mut file,
        )
        .unwrap();
        drop(file);
        let progress = SampleList::default();
        let loaded = input::load(path, &input::ReadOptions::default(), &progress).unwrap();
        assert_eq!(loaded.counts.vertices, u64::from(1000 * rows));
        progress.0.into_inner().unwrap()
    }

    #[test]
    fn large_files_give_a_sample_from_all_over() {
        let folder = tempfile::tempdir().unwrap();
        for ending in ["las", "laz"] {
            let path = folder.path().join(format!("a.{ending}"));
            let samples = samples_of(&path, 1100);
            assert_eq!(samples.len(), 1, "{ending}");
            let places = &samples[0].places;
            assert!(
                (20_000..=80_000).contains(&places.len()),
                "{}",
                places.len()
            );
            let own = places
                .iter()
                .map(|place| *place - DVec3::new(5e5, 4e6, 0.0));
            let own: Vec<DVec3> = own.collect();
            let is_one = |p: &DVec3| p.distance(p.round()) < 1e-3;
            assert!(own.iter().all(|p| is_one(p) && p.min_element() >= 0.0));
            let far = own.iter().fold(DVec3::ZERO, |a, b| a.max(*b));
            assert!(
                far.x > 950.0 && far.x < 1000.0 && far.y > 1000.0 && far.y < 1100.0,
                "{far}"
            );
            assert!(samples_of(&path, 900).is_empty());
        }
    }
}
