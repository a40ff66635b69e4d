//! Choices of splats from vertices with their words: what the command line and the panel of the window offer.

use crate::oriented::radius::RadiusRule;
use crate::oriented::resample::SamplePattern;
use crate::oriented::splats::LevelLeaf;

/// A value that can be chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WordedChoice<T: 'static> {
    /// The value.
    pub value: T,
    /// Word on the command line.
    pub option: &'static str,
    /// Word in the panel.
    pub label: &'static str,
    /// Explanation, without a full stop.
    pub tip: &'static str,
}

/// Levels of detail, or none.
pub type LevelChoice = Option<LevelLeaf>;

/// Radii of splats, the usual first.
pub const RADII: [WordedChoice<RadiusRule>; 3] = [
    WordedChoice {
        value: RadiusRule::Cover,
        option: "cover",
        label: "covering",
        tip: "the least radius that covers",
    },
    WordedChoice {
        value: RadiusRule::Dietz,
        option: "dietz",
        label: "0.65 d",
        tip: "0.65 of the distance to the farthest neighbor",
    },
    WordedChoice {
        value: RadiusRule::Dietz50,
        option: "dietz50",
        label: "0.5 d",
        tip: "half of the distance to the farthest neighbor",
    },
];

/// Levels of detail, the usual first.
pub const LEVELS: [WordedChoice<LevelChoice>; 3] = [
    WordedChoice {
        value: None,
        option: "off",
        label: "all",
        tip: "every splat is drawn",
    },
    WordedChoice {
        value: Some(LevelLeaf::Splats),
        option: "splats",
        label: "levels",
        tip: "what is smaller than the threshold is one disc; the rest is splats",
    },
    WordedChoice {
        value: Some(LevelLeaf::Triangles),
        option: "triangles",
        label: "levels, triangles",
        tip: "what is smaller than the threshold is one disc; the rest is triangles",
    },
];

/// Patterns of even splats.
pub const PATTERNS: [WordedChoice<SamplePattern>; 3] = [
    WordedChoice {
        value: SamplePattern::Lattice,
        option: "lattice",
        label: "lattice",
        tip: "splats lie evenly: in the middle of like parts of each triangle",
    },
    WordedChoice {
        value: SamplePattern::Poisson,
        option: "poisson",
        label: "Poisson disc",
        tip: "splats lie evenly: at random, none near another",
    },
    WordedChoice {
        value: SamplePattern::Rays,
        option: "rays",
        label: "rays",
        tip: "splats lie evenly: where parallel rays along three axes meet the surface",
    },
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oriented::splats::SplatRules;

    /// Words of a list, each once.
    fn assert_distinct<T: PartialEq + std::fmt::Debug>(all: &[WordedChoice<T>]) {
        for (i, a) in all.iter().enumerate() {
            for b in &all[..i] {
                assert_ne!(a.value, b.value);
                assert!(a.option != b.option && a.label != b.label && a.tip != b.tip);
            }
        }
    }

    #[test]
    fn choices_differ_and_the_usual_is_first() {
        assert_distinct(&RADII);
        assert_distinct(&LEVELS);
        assert_distinct(&PATTERNS);
        let usual = SplatRules::usual();
        assert_eq!(RADII[0].value, usual.radius);
        assert_eq!(LEVELS[0].value, usual.levels);
    }
}
