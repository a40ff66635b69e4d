//! Progress of a job of the loader, shared with its thread.

use crate::mesh::Mesh;
use crate::progress::{PointSample, Progress};
use glam::DVec3;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// Takes the mesh of a sample.
type SampleTaker = Box<dyn FnOnce(Mesh) + Send>;

/// Progress of a job.
#[derive(Default)]
pub(super) struct SharedProgress {
    stage: Mutex<String>,
    total: AtomicU64,
    done: AtomicU64,
    is_cancelled: AtomicBool,
    /// Whoever wants a sample of the points before all are read.
    sampler: Mutex<Option<SampleTaker>>,
}

impl SharedProgress {
    /// Asks the job to stop.
    pub(super) fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
    }

    /// Lets `take` have one sample of what is read from now on, or nobody.
    pub(super) fn give_sample_to(&self, take: Option<SampleTaker>) {
        *self.sampler.lock().unwrap_or_else(PoisonError::into_inner) = take;
    }

    /// The stage and how far it is, such as `building nodes 43%`.
    pub(super) fn words(&self) -> String {
        let stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        let (done, total) = (
            self.done.load(Ordering::Relaxed),
            self.total.load(Ordering::Relaxed),
        );
        match (stage.as_str(), total) {
            ("", _) => "opening".into(),
            (name, 0) => name.into(),
            (name, total) => format!(
                "{name} {}%",
                (u128::from(done) * 100 / u128::from(total)).min(100)
            ),
        }
    }
}

impl Progress for SharedProgress {
    fn stage(&self, name: &str, total: u64) {
        let mut stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        name.clone_into(&mut stage);
        self.done.store(0, Ordering::Relaxed);
        self.total.store(total, Ordering::Relaxed);
    }

    fn advance(&self, amount: u64) {
        self.done.fetch_add(amount, Ordering::Relaxed);
    }

    fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }

    fn wants_sample(&self) -> bool {
        let sampler = self.sampler.lock().unwrap_or_else(PoisonError::into_inner);
        sampler.is_some()
    }

    fn sample(&self, sample: PointSample) {
        let sampler = self.sampler.lock();
        let take = sampler.unwrap_or_else(PoisonError::into_inner).take();
        if let Some(take) = take {
            take(mesh_of(sample));
        }
    }
}

/// The points as a cloud about their middle.
fn mesh_of(sample: PointSample) -> Mesh {
    let places = || sample.places.iter().copied();
    let low = places().reduce(DVec3::min).unwrap_or_default();
    let high = places().reduce(DVec3::max).unwrap_or_default();
    let origin = (0.5 * (low + high)).round();
    Mesh {
        positions: places().map(|place| (place - origin).as_vec3()).collect(),
        colors: sample.colors,
        origin,
        ..Mesh::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;

    #[test]
    fn one_sample_is_taken_where_it_is_and_no_second() {
        let progress = SharedProgress::default();
        assert!(!progress.wants_sample());
        let (sender, taken) = channel();
        let take = move |mesh| drop(sender.send(mesh));
        progress.give_sample_to(Some(Box::new(take)));
        assert!(progress.wants_sample());
        let sample = || PointSample {
            places: vec![DVec3::new(5e5, 4e6, 1.25), DVec3::new(5e5 + 2.0, 4e6, 3.25)],
            colors: Vec::new(),
        };
        progress.sample(sample());
        progress.sample(sample());
        let meshes: Vec<Mesh> = taken.try_iter().collect();
        assert_eq!(meshes.len(), 1);
        let mesh = &meshes[0];
        let world = |i: usize| mesh.origin + mesh.positions[i].as_dvec3();
        assert_eq!(
            [world(0), world(1)],
            [sample().places[0], sample().places[1]]
        );
        assert!(!progress.wants_sample());
    }
}
