//! Trees whose triangles are divided so that nodes are flat.

use surfel::progress::SilentProgress;
use surfel::tree::{BuildOptions, Model, SplitRule, build, check};

fn models(spec: &str) -> [Model; 2] {
    [SplitRule::Longest, SplitRule::Flat].map(|split| {
        let mesh = surfel::generate::mesh(&spec.parse().unwrap());
        let options = BuildOptions {
            split,
            ..BuildOptions::default()
        };
        build(mesh, &options, &SilentProgress).unwrap()
    })
}

/// Corners of all triangles, sorted.
fn content(model: &Model) -> Vec<[[u32; 3]; 3]> {
    let position = |corner: u32| model.vertices[corner as usize].position;
    let bits = |corner: u32| position(corner).to_array().map(f32::to_bits);
    let mut list: Vec<_> = model.triangles.iter().map(|t| t.map(bits)).collect();
    list.sort_unstable();
    list
}

#[test]
fn both_rules_give_the_same_shape_and_a_tree_without_fault() {
    for spec in ["torus:5000", "statue:3000", "sphere:16"] {
        let [longest, flat] = models(spec);
        assert_eq!(longest.tree.level_starts, flat.tree.level_starts);
        assert_eq!(longest.tree.first_leaf, flat.tree.first_leaf);
        let faults = check(&flat).violations;
        assert!(faults.is_empty(), "{faults:?}");
        assert_eq!(content(&longest), content(&flat));
        assert_eq!(longest.is_closed, flat.is_closed);
    }
}

/// A plate whose sheets are as far apart as its triangles are wide: nodes of both sheets are fewer.
#[test]
fn sheets_are_kept_apart() {
    let mut mesh = surfel::mesh::Mesh::default();
    const CELLS: u32 = 64;
    for z in [0.0, 0.02] {
        let first = mesh.positions.len() as u32;
        for i in 0..(CELLS + 1) * (CELLS + 1) {
            let (x, y) = (i % (CELLS + 1), i / (CELLS + 1));
            let place = [x as f32, y as f32].map(|c| c / CELLS as f32);
            mesh.positions.push(glam::Vec3::new(place[0], place[1], z));
        }
        for i in 0..CELLS * CELLS {
            let a = first + i / CELLS * (CELLS + 1) + i % CELLS;
            let [b, c, d] = [a + 1, a + CELLS + 2, a + CELLS + 1];
            let two = [[a, b, c], [a, c, d]];
            // The lower sheet faces down.
            mesh.triangles
                .extend(two.map(|[a, b, c]| if z == 0.0 { [a, c, b] } else { [a, b, c] }));
        }
    }
    let mixed = [SplitRule::Longest, SplitRule::Flat].map(|split| {
        let options = BuildOptions {
            split,
            ..BuildOptions::default()
        };
        let model = build(mesh.clone(), &options, &SilentProgress).unwrap();
        let height = |corner: u32| model.vertices[corner as usize].position.z;
        let is_mixed = |node: &u32| {
            let leaves = model.tree.leaf_range(*node);
            let mut lower = leaves.map(|leaf| height(model.triangles[leaf as usize][0]) == 0.0);
            let first = lower.next().unwrap();
            lower.any(|is_lower| is_lower != first)
        };
        (0..model.tree.nodes.len() as u32).filter(is_mixed).count()
    });
    assert!(mixed[1] * 4 < mixed[0], "{mixed:?}");
}

#[test]
fn the_order_does_not_depend_on_threads() {
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().unwrap();
        pool.install(|| models("torus:60000")[1].triangles.clone())
    };
    assert_eq!(of(1), of(3));
}
