//! Places of the scanners that measured a cloud: a surface turns toward the scanner that saw it.

use glam::DVec3;

/// Scanners in the order of a cloud's points, each with the points that it measured, one after another.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ScannerPlaces {
    runs: Vec<ScannerRun>,
}

/// Points that one scanner measured.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ScannerRun {
    /// Number of the point after the last one.
    end: usize,
    /// Place in world space, where it is known.
    place: Option<DVec3>,
}

impl ScannerPlaces {
    /// Adds as many points after those so far, of a scanner at this place in world space. A place that is not finite is unknown.
    pub fn push(&mut self, points: usize, place: Option<DVec3>) {
        let start = self.runs.last().map_or(0, |run| run.end);
        self.runs.push(ScannerRun {
            end: start + points,
            place: place.filter(|place| place.is_finite()),
        });
    }

    /// Tells whether the place of any scanner is known.
    pub fn is_any_known(&self) -> bool {
        self.runs.iter().any(|run| run.place.is_some())
    }

    /// Place of the scanner that measured a point, in world space, where it is known.
    pub fn of_point(&self, point: usize) -> Option<DVec3> {
        let run = self.runs.partition_point(|run| run.end <= point);
        self.runs.get(run)?.place
    }

    /// Leaves out the points that are not kept.
    pub fn retain(&mut self, is_kept: impl Fn(usize) -> bool) {
        let (mut start, mut kept) = (0, 0);
        for run in &mut self.runs {
            kept += (start..run.end).filter(|&point| is_kept(point)).count();
            (start, run.end) = (run.end, kept);
        }
    }

    /// Moves all places.
    pub fn transform(&mut self, moved: impl Fn(DVec3) -> DVec3) {
        for place in self.runs.iter_mut().filter_map(|run| run.place.as_mut()) {
            *place = moved(*place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_have_the_scanner_of_their_run_after_others_are_left_out() {
        let mut own = ScannerPlaces::default();
        assert_eq!((own.of_point(0), own.is_any_known()), (None, false));
        own.push(0, Some(DVec3::Z));
        own.push(3, Some(DVec3::X));
        own.push(2, None);
        own.push(1, Some(DVec3::NAN));
        own.push(2, Some(DVec3::Y));
        let places = |own: &ScannerPlaces| (0..9).map(|i| own.of_point(i)).collect::<Vec<_>>();
        let (x, y) = (Some(DVec3::X), Some(DVec3::Y));
        assert_eq!(places(&own), [x, x, x, None, None, None, y, y, None]);
        own.retain(|point| point != 1 && point != 6);
        assert_eq!(places(&own)[..7], [x, x, None, None, None, y, None]);
        own.transform(|place| place * 2.0);
        assert_eq!(own.of_point(5), Some(DVec3::Y * 2.0));
    }
}
