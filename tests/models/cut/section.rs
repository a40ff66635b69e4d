//! A section: what touches its box is in the cut once, what lies outside is not.

use super::testing::{Random, Strips, chaos, look, model, sphere};
use super::{coverage, leaves_below};
use glam::{DVec3, Vec3};
use surfel::cut::{Cut, CutSettings, select};
use surfel::math::section_box::SectionBox;

/// A box of which ends may be anywhere, also without end.
pub(crate) fn random_section(random: &mut Random) -> SectionBox {
    let [mut a, mut b] = [(); 2].map(|()| random.in_ball() * 1.5);
    for axis in 0..3 {
        match random.below(4) {
            0 => a[axis] = f64::NEG_INFINITY,
            1 => b[axis] = f64::INFINITY,
            _ => {}
        }
    }
    SectionBox::of_file([a, b], DVec3::ZERO)
}

#[test]
fn the_cut_has_what_touches_the_section_and_nothing_else() {
    let mut random = Random(31);
    let view = look(DVec3::new(0.0, 1.0, 9.0), DVec3::ZERO, (0.1, 30.0));
    let (mut drawn, mut dropped) = (0, 0);
    for own in [
        model(&sphere(40, 20), Strips::Yes),
        model(&chaos(1_500, 5), Strips::Yes),
    ] {
        for round in 0..60 {
            let section = random_section(&mut random);
            let settings = CutSettings {
                threshold_px: [0.0, 2.0, 20.0][round % 3],
                section: Some(section),
                ..CutSettings::default()
            };
            let mut cut = Cut::default();
            select(&own, &view, &settings, &mut cut);
            // A ball that reaches the box by less than rounding may be in or not.
            let touches = |center: Vec3, radius: f32, margin: f32| {
                section.depth_of(center) >= margin - radius
            };
            for (leaf, &times) in own.tree.leaves.iter().zip(&coverage(&own, &cut)) {
                assert!(times <= 1);
                assert!(times == 1 || !touches(leaf.center, leaf.radius, 1e-4));
                dropped += usize::from(times == 0);
            }
            for &leaf in cut.leaves.iter().chain(&cut.triangles) {
                let leaf = &own.tree.leaves[leaf as usize];
                assert!(touches(leaf.center, leaf.radius, -1e-4));
                drawn += 1;
            }
            for &id in &cut.nodes {
                let node = &own.tree.nodes[id as usize];
                assert!(touches(node.center, node.radius, -1e-4));
                drawn += leaves_below(&own.tree, id).len();
            }
        }
    }
    assert!(drawn > 10_000 && dropped > 10_000, "{drawn}, {dropped}");
}
