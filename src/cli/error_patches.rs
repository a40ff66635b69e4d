//! The options of patches: nodes that are drawn as one polygon once their error is small.

use super::{CommandFailure, usage};
use clap::{Args as ClapArgs, ValueEnum};
use surfel::patches::{ErrorTolerances, PatchRules};
use surfel::render::Method;

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ErrorBoundName {
    /// On average over what a node stands for
    Mean,
    /// At every vertex
    Strict,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum TinyNodeName {
    /// Squares of the threshold
    Squares,
    /// Polygons of their own, where no second sheet is below them: nearer to the triangles, and slower
    Polygons,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum RimName {
    /// Share of a pixel that the patches around it cover, in sixteen samples
    Covered,
    /// Color at the center of a pixel
    Stepped,
}

/// Which nodes are drawn as patches.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct ErrorArgs {
    /// Draw a node as one polygon, whatever its size, once it is wrong by less (--method pop): pixels at silhouettes, pixels
    /// elsewhere, grey levels of its shade; as 0.15,0.25,24. Records for it take seconds a million triangles unless the tree file has them
    /// (surfel build --patches), and 80 bytes a triangle
    #[arg(long, value_name = "RIM,INSIDE,SHADE", value_parser = parse_error, allow_hyphen_values = true)]
    error: Option<ErrorTolerances>,
    /// How the shade keeps to its part of --error
    #[arg(long, value_enum, default_value = "mean")]
    bound: ErrorBoundName,
    /// Shape of nodes below --threshold, with --error
    #[arg(long, value_enum, value_name = "AS", default_value = "squares")]
    tiny_nodes: TinyNodeName,
    /// Outlines of patches, with --error: covered is nearer to the triangles and takes longer. In pictures of several samples, and
    /// where colors are data or photographs, they are stepped
    #[arg(long, value_enum, value_name = "AS", default_value = "stepped")]
    rims: RimName,
}

impl ErrorArgs {
    /// The rules; `None` where none are given.
    pub(crate) fn rules(&self, method: Method) -> Result<Option<PatchRules>, CommandFailure> {
        let Some(tolerances) = self.error else {
            return match (self.bound, self.tiny_nodes, self.rims) {
                (ErrorBoundName::Strict, ..) => Err(usage("--bound is one of --error; give both")),
                (_, TinyNodeName::Polygons, _) => {
                    Err(usage("--tiny-nodes is of --error; give both"))
                }
                (.., RimName::Covered) => Err(usage("--rims is of --error; give both")),
                (.., RimName::Stepped) => Ok(None),
            };
        };
        if method != Method::Pop {
            return Err(usage(
                "--error chooses nodes of the tree; use it with --method pop",
            ));
        }
        Ok(Some(PatchRules {
            tolerances,
            is_strict: self.bound == ErrorBoundName::Strict,
            tiny_polygons: self.tiny_nodes == TinyNodeName::Polygons,
            covers_rims: self.rims == RimName::Covered,
        }))
    }
}

/// Three numbers; negative ones and zeros draw no patch.
pub(crate) fn parse_error(text: &str) -> Result<ErrorTolerances, String> {
    let numbers: Option<Vec<f32>> = text
        .split(',')
        .map(|part| part.trim().parse().ok())
        .collect();
    match numbers.as_deref() {
        Some(&[rim_px, inside_px, shade_levels])
            if [rim_px, inside_px, shade_levels]
                .iter()
                .all(|value| value.is_finite()) =>
        {
            Ok(ErrorTolerances {
                rim_px,
                inside_px,
                shade_levels,
            })
        }
        _ => Err(
            "three numbers are wanted: pixels at silhouettes, pixels elsewhere, grey levels".into(),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerances_are_three_numbers() {
        let found = parse_error("0.1, 0.5,-1").map(|t| [t.rim_px, t.inside_px, t.shade_levels]);
        assert_eq!(found, Ok([0.1, 0.5, -1.0]));
        for bad in ["", "1,2", "1,2,x", "1,2,inf", "1,2,3,4"] {
            assert!(parse_error(bad).is_err(), "{bad}");
        }
    }
    #[test]
    fn what_is_of_the_error_needs_one() {
        let usual = ErrorArgs {
            error: None,
            bound: ErrorBoundName::Mean,
            tiny_nodes: TinyNodeName::Squares,
            rims: RimName::Stepped,
        };
        assert!(matches!(usual.rules(Method::Pop), Ok(None)));
        let others = [
            ErrorArgs {
                bound: ErrorBoundName::Strict,
                ..usual.clone()
            },
            ErrorArgs {
                tiny_nodes: TinyNodeName::Polygons,
                ..usual.clone()
            },
            ErrorArgs {
                rims: RimName::Covered,
                ..usual.clone()
            },
        ];
        for args in others {
            assert!(args.rules(Method::Pop).is_err(), "{args:?}");
            let error = Some(ErrorTolerances::default());
            let rules = ErrorArgs { error, ..args }.rules(Method::Pop);
            let rules = rules.ok().flatten().expect("rules of an error");
            let changed = [rules.is_strict, rules.tiny_polygons, rules.covers_rims];
            assert_eq!(changed.iter().filter(|is_on| **is_on).count(), 1);
        }
    }
}
