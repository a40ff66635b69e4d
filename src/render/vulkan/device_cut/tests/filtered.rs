//! Filtered splats of cuts on the device: the records of the processor, whatever their order.

use super::*;
use crate::abi::FilteredSplat;
use crate::abi::constants::LARGEST_PIECED_PX;
use crate::mesh::Mesh;
use crate::pack::filtered;
use crate::render::pack_params::filtered_shade;
use glam::Vec3;

/// Points in one place, which have no neighbors.
fn in_one_place(points: usize) -> Model {
    let mesh = Mesh {
        positions: vec![Vec3::new(0.1, 0.2, 0.3); points],
        normals: vec![Vec3::Y; points],
        ..Mesh::default()
    };
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// Small triangles before two large ones.
fn on_ground() -> Model {
    let square = |triangles| ShapeSpec::with_triangles(GeneratedShape::Square, triangles).unwrap();
    let mut mesh = generate::mesh(&square(5_000));
    let ground = generate::mesh(&square(2));
    let first = mesh.positions.len() as u32;
    (mesh.positions).extend(ground.positions.iter().map(|&p| p * 2.5 - 0.01));
    mesh.normals.extend(ground.normals);
    (mesh.triangles).extend(
        ground
            .triangles
            .iter()
            .map(|t| t.map(|corner| first + corner)),
    );
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// Settings of a frame whose cut the device chooses.
fn settings_of(threshold_px: f32, culling: Culling, method: Method) -> Settings {
    Settings {
        splat: SplatKind::Filtered,
        threshold_px,
        culling,
        method,
        cut_on: CutOn::Device,
        ..Settings::default()
    }
}

fn shade_of(model: &Model, view: &View, settings: &Settings) -> FilteredShade {
    let facts = DrawnFacts::from(model);
    let depth_range = FrameContext::new(&facts, view, settings, 1.0, 0).depth_range;
    filtered_shade(settings, &facts, depth_range, 255.0)
}

/// Cut that a frame asks of the device.
fn asked_of<'a>(settings: &'a Settings, shade: FilteredShade) -> AskedCut<'a> {
    AskedCut {
        settings,
        kind: ExpandedKind {
            are_oriented: false,
            have_areas: false,
            have_quads: false,
            are_filtered: true,
        },
        rules: ChoiceRules {
            threshold_px: settings.threshold_px,
            by_compute: false,
            are_samples: false,
            draws_large_leaves: false,
            are_oriented: false,
            largest_px: ANY_SIDE_PX,
            are_pieces: settings.method == Method::Splats,
        },
        max_point_px: 255.0,
        shade: Some(shade),
        pixels: 1 << 18,
    }
}

/// What the processor draws of a cut.
struct PackedCut {
    /// Without the triangles that became splats.
    cut: Cut,
    /// Triangles before some became splats.
    triangles: usize,
    splats: Vec<FilteredSplat>,
    corners: Vec<[u32; 3]>,
}

fn of_processor(
    model: &Model,
    view: &View,
    (settings, shade): (&Settings, &FilteredShade),
) -> PackedCut {
    let mut cut = Cut::default();
    CutSelector::default().select(model, view, &cut_settings(settings, model), &mut cut);
    let triangles = cut.triangles.len();
    let large = filtered::take_triangles(model, view, shade, &mut cut);
    let most = filtered::splat_count(&cut, large);
    let mut splats = vec![bytemuck::Zeroable::zeroed(); most];
    let count = filtered::splats(model, &cut, large, view, *shade, &mut splats);
    splats.truncate(count);
    let corners = cut.triangles.iter().map(|&id| model.triangles[id as usize]);
    PackedCut {
        corners: corners.collect(),
        cut,
        triangles,
        splats,
    }
}

/// Those that show something: the others lie before the near plane.
fn drawn(splats: &[FilteredSplat]) -> Vec<FilteredSplat> {
    let is_drawn = |splat: &&FilteredSplat| splat.depth <= 1.0;
    splats.iter().filter(is_drawn).copied().collect()
}

/// Nodes, rows and points of a cloud become the very splats that the processor packs.
#[test]
fn points_become_the_splats_of_the_processor() {
    let Some(gpu) = device() else { return };
    // Nodes, points, and what shows nothing.
    let mut kinds = [0; 3];
    for (name, model) in [
        ("statue", model_of(GeneratedShape::Statue, 60_000, true)),
        ("sphere", model_of(GeneratedShape::Sphere, 8_000, true)),
        ("place", in_one_place(200)),
        ("point", in_one_place(1)),
    ] {
        let mut bed = CutBed::new(&gpu, &model);
        for (index, view) in views_of(&model).iter().enumerate() {
            for (threshold_px, culling, method) in [
                (1.0, Culling::Auto, Method::Pop),
                (2.5, Culling::Off, Method::Splats),
                (7.0, Culling::Auto, Method::Pop),
            ] {
                let settings = settings_of(threshold_px, culling, method);
                let shade = shade_of(&model, view, &settings);
                let what = format!("{name}, view {index}, {method:?} of {threshold_px} px");
                let packed = of_processor(&model, view, (&settings, &shade));
                let (cut, host) = (packed.cut, packed.splats);
                assert!(packed.corners.is_empty(), "{what}");
                let asked = asked_of(&settings, shade);
                let found = bed.chosen::<FilteredSplat>(view, asked);
                let device = drawn(&found.points);
                let all = [cut.nodes.len(), cut.leaves.len()];
                let nothing = found.points.len() - device.len();
                let found = all.into_iter().chain([nothing]);
                kinds.iter_mut().zip(found).for_each(|(sum, n)| *sum += n);
                // Elsewhere roots and quotients may differ in the last place, and with them single nodes.
                if !gpu.info().is_cpu() {
                    let most = 2 + host.len() / 1000;
                    assert!(device.len().abs_diff(host.len()) <= most, "{what}");
                    continue;
                }
                assert_eq!(device.len(), host.len(), "{what}");
                let is_same = sorted(&device) == sorted(&host);
                assert!(is_same, "{what}: other records");
            }
        }
    }
    assert!(kinds.iter().all(|&n| n > 10), "{kinds:?}");
    close_in_silence(gpu);
}

/// How the device drew the large triangles of a cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum TriangleFate {
    /// They stayed triangles.
    Kept,
    /// Those up to the limit became splats.
    SomeTaken,
    /// All became splats.
    AllTaken,
}

impl TriangleFate {
    fn of(counts: &CutCounters) -> Self {
        match counts.pieces.taken_px {
            0.0 => Self::Kept,
            px if px <= LARGEST_PIECED_PX => Self::SomeTaken,
            _ => Self::AllTaken,
        }
    }
}

/// Compares what both draw of a cut, whatever the order; what became of its triangles, if there are any.
fn compare(
    bed: &mut CutBed<'_>,
    view: &View,
    settings: &Settings,
    what: &str,
) -> Option<TriangleFate> {
    let model = bed.model;
    let shade = shade_of(model, view, settings);
    let host = of_processor(model, view, (settings, &shade));
    let asked = asked_of(settings, shade);
    let device = bed.chosen::<FilteredSplat>(view, asked);
    let counts = device.counts;
    let fate = TriangleFate::of(&counts);
    let fate = (counts.pieces.named > 0).then_some(fate);
    let splats = drawn(&device.points);
    let [fine, corners] = &device.corners;
    assert!(fine.is_empty(), "{what}");
    if !bed.gpu.info().is_cpu() {
        let near = |a: usize, b: usize| a.abs_diff(b) <= 2 + b / 500;
        assert!(near(splats.len(), host.splats.len()), "{what}");
        assert!(near(corners.len(), host.corners.len()), "{what}");
        return fate;
    }
    // What single precision takes for edge-on stays.
    let kept = host.cut.stats.facing_away - u64::from(counts.facing_away);
    let more_named = u64::from(counts.pieces.named) - host.triangles as u64;
    assert!(more_named <= kept, "{what}: {more_named} {kept}");
    let Some(extra) = more(&sorted(&splats), &sorted(&host.splats)) else {
        panic!("{what}: splats of the host are missing, {counts:?}");
    };
    let Some(edge_on) = more(&sorted(corners), &sorted(&host.corners)) else {
        panic!("{what}: triangles of the host are missing, {counts:?}");
    };
    assert!((extra.len() + edge_on.len()) as u64 <= kept, "{what}");
    check_edge_on(model, view, &edge_on, what);
    fate
}

/// Nodes, rows, triangles and their pieces become the very splats that the processor packs, and others stay triangles.
#[test]
fn triangles_become_the_pieces_of_the_processor() {
    let Some(gpu) = device() else { return };
    let mut fates = Vec::new();
    for (name, model) in [
        ("statue", model_of(GeneratedShape::Statue, 40_000, false)),
        ("square on a ground", on_ground()),
        ("torus", model_of(GeneratedShape::Torus, 20_000, false)),
        ("two triangles", model_of(GeneratedShape::Square, 2, false)),
        ("square", model_of(GeneratedShape::Square, 5_000, false)),
    ] {
        let mut bed = CutBed::new(&gpu, &model);
        for (index, view) in views_of(&model).iter().enumerate() {
            for (threshold_px, culling, method) in [
                (1.0, Culling::Auto, Method::Pop),
                (2.5, Culling::Off, Method::Pop),
                (7.0, Culling::On, Method::Pop),
                (1.0, Culling::Off, Method::Splats),
                (4.0, Culling::Auto, Method::Splats),
            ] {
                let settings = settings_of(threshold_px, culling, method);
                let what =
                    format!("{name}, view {index}, {method:?} of {threshold_px} px, {culling:?}");
                let fate = compare(&mut bed, view, &settings, &what);
                assert!(
                    method == Method::Pop || fate.is_none_or(|f| f == TriangleFate::AllTaken),
                    "{what}"
                );
                fates.extend(fate.map(|fate| (method, fate)));
            }
        }
    }
    for wanted in [
        TriangleFate::Kept,
        TriangleFate::SomeTaken,
        TriangleFate::AllTaken,
    ] {
        let wanted = (Method::Pop, wanted);
        assert!(fates.contains(&wanted), "{wanted:?}: {fates:?}");
    }
    close_in_silence(gpu);
}

/// What a list has no room for in pieces is drawn whole, and nothing is lost.
#[test]
fn pieces_without_room_stay_in_one() {
    let Some(gpu) = device() else { return };
    let model = model_of(GeneratedShape::Statue, 20_000, false);
    // One with room, and one without.
    let mut beds = [1 << 20, 1].map(|pixels| (pixels, CutBed::new(&gpu, &model)));
    // Splats without those of triangles, and triangles, of all that are named.
    let own = |counts: &CutCounters, is_one: bool| {
        let [within, beyond] = counts.pieces.pieces;
        let taken = match TriangleFate::of(counts) {
            _ if is_one => counts.pieces.named,
            TriangleFate::Kept => 0,
            TriangleFate::SomeTaken => within,
            TriangleFate::AllTaken => within + beyond,
        };
        counts.splats[0] - taken
    };
    let mut lacking = [0; 2];
    for method in [Method::Splats, Method::Pop] {
        for fill in [0.15, 0.2, 0.3, 0.5, 1.2] {
            let view = orbit(&model, (640, 400), fill, 1);
            let settings = settings_of(1.0, Culling::Off, method);
            let shade = shade_of(&model, &view, &settings);
            let [with_room, without] = beds.each_mut().map(|(pixels, bed)| {
                let asked = AskedCut {
                    pixels: *pixels,
                    ..asked_of(&settings, shade)
                };
                bed.chosen::<FilteredSplat>(&view, asked).counts
            });
            assert_eq!(with_room.pieces.named, without.pieces.named);
            let is_one = without.pieces.halved_px == 0.0;
            let what = format!("{method:?}, fill {fill}: {with_room:?} {without:?}");
            assert_eq!(own(&with_room, false), own(&without, is_one), "{what}");
            let kept = without.triangles[0] / 3;
            match method {
                Method::Splats => {
                    let is_other = without.splats != with_room.splats;
                    assert_eq!((kept, is_one), (0, is_other), "{what}");
                }
                _ => {
                    let all = TriangleFate::of(&without) == TriangleFate::Kept;
                    assert!(!all || kept == without.pieces.named, "{what}");
                }
            }
            let is_other = without.splats[0] < with_room.splats[0];
            lacking[usize::from(method == Method::Pop)] += usize::from(is_other);
        }
    }
    assert!(lacking.iter().all(|&n| n > 0), "{lacking:?}");
    // A larger picture gets lists with more room.
    let view = orbit(&model, (640, 400), 0.2, 1);
    let settings = settings_of(1.0, Culling::Off, Method::Splats);
    let asked = asked_of(&settings, shade_of(&model, &view, &settings));
    let grown = beds.each_mut().map(|(_, bed)| {
        let asked = AskedCut {
            pixels: 1 << 20,
            ..asked
        };
        bed.chosen::<FilteredSplat>(&view, asked).counts.splats
    });
    assert_eq!(grown[0], grown[1]);
    close_in_silence(gpu);
}
