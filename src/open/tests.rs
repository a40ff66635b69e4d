#![allow(clippy::unwrap_used, reason = "tests may panic")]

use super::*;
use crate::generate::GenerateError;
use crate::input::Error as InputError;
use crate::progress::SilentProgress;
use crate::tree::{Error as TreeError, ModelKind};
use std::sync::atomic::{AtomicU32, Ordering};

fn opened(source: impl AsRef<Path>) -> Result<OpenedModel, Error> {
    open(source, &OpenOptions::default(), &SilentProgress)
}

fn asset(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("assets")
        .join(name)
}

/// Two triangles and one that is left out.
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    element face 3\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n2 0 1\n";

/// A folder with a model `a.ply` and its tree `a.surfel`.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("a.ply"), PLY).unwrap();
    let model = opened(at.join("a.ply")).unwrap().model;
    tree::file::write(&model, &at.join("a.surfel")).unwrap();
    folder
}

#[test]
fn a_mesh_file_comes_with_its_format_its_counts_and_what_was_left_out() {
    let folder = folder();
    let path = folder.path().join("a.ply");
    let found = opened(&path).unwrap();
    assert_eq!(found.name, path.display().to_string());
    assert_eq!(found.format, SourceFormat::Mesh(Format::PlyAscii));
    assert_eq!(found.format.to_string(), "PLY (text)");
    assert_eq!(found.file_bytes, PLY.len() as u64);
    assert_eq!((found.counts.vertices, found.counts.faces), (4, 3));
    assert_eq!(found.warnings, [ReadWarning::FacesTooSmall { count: 1 }]);
    assert_eq!(found.model.triangles.len(), 2);
    assert_eq!(found.model.kind(), ModelKind::Surface);
    assert!(found.scene.is_none() && found.load_ms > 0.0 && found.build_ms > 0.0);

    let ring = opened(asset("ring.obj")).unwrap();
    assert_eq!(ring.format, SourceFormat::Mesh(Format::Obj));
    assert_eq!(ring.model.kind(), ModelKind::Surface);
    // Packed files are measured as they are stored.
    let scan = opened(asset("scan.ply.gz")).unwrap();
    let stored = std::fs::metadata(asset("scan.ply.gz")).unwrap().len();
    assert_eq!(scan.file_bytes, stored);
}

/// A box as OBJ, from its smallest to its largest corner.
fn box_obj(low: [f64; 3], high: [f64; 3]) -> String {
    let mut text = String::new();
    for corner in 0..8 {
        let side = |axis: usize| {
            if corner >> axis & 1 == 0 {
                low[axis]
            } else {
                high[axis]
            }
        };
        text += &format!("v {} {} {}\n", side(0), side(1), side(2));
    }
    text + "f 1 2 4 3\nf 5 6 8 7\nf 1 2 6 5\nf 3 4 8 7\n"
}

#[test]
fn the_axis_that_is_up_is_told_by_format_and_place() {
    let folder = tempfile::tempdir().unwrap();
    let up = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let guess = opened(&path).unwrap().up;
        assert_eq!(guess.axis == UpAxis::Y, guess.reason.is_empty());
        guess.axis
    };
    // A tower on the ground, one that lies, a cube around the zero, a place on a map.
    let tower = box_obj([-1.0, -1.0, 0.0], [1.0, 1.0, 5.0]);
    assert_eq!(up("tower.obj", &tower), UpAxis::Z);
    let other = box_obj([-1.0, 0.0, -1.0], [1.0, 5.0, 1.0]);
    assert_eq!(up("other.obj", &other), UpAxis::Y);
    assert_eq!(up("cube.obj", &box_obj([-1.0; 3], [1.0; 3])), UpAxis::Y);
    // In the first octant nothing tells.
    assert_eq!(up("corner.obj", &box_obj([0.0; 3], [1.0; 3])), UpAxis::Y);
    let map = box_obj([4e5, 5e6, 100.0], [4.001e5, 5.0001e6, 130.0]);
    assert_eq!(up("map.obj", &map), UpAxis::Z);
    let facet = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
    assert_eq!(up("part.stl", facet), UpAxis::Z);
    assert_eq!(opened("generate:square:100").unwrap().up.axis, UpAxis::Y);
}

#[test]
fn options_reach_the_reader() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(
        &path,
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nf 1 2 3\nf 4 3 2\n",
    )
    .unwrap();
    let used = |options: &OpenOptions| {
        open(&path, options, &SilentProgress).map(|o| o.model.used_vertices)
    };
    let mut options = OpenOptions::default();
    // Back to back: both edges and corners that they share are sharp.
    assert_eq!(used(&options).unwrap(), 6);
    options.tree.crease_degrees = Some(180.0);
    assert_eq!(used(&options).unwrap(), 4);
    options.input.weld = true;
    assert_eq!(used(&options).unwrap(), 3);
    options.input.limits.file_bytes = 8;
    let found = used(&options);
    assert!(
        matches!(
            &found,
            Err(Error::Input(InputError::TooLarge { limit: 8, .. }))
        ),
        "{found:?}"
    );
}

/// A folded sheet whose file says that all its normals point up.
#[test]
fn normals_of_a_file_stay_unless_a_crease_angle_is_given() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fold.obj");
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 1\nv 1 1 1\nvn 0 0 1\n\
        f 1//1 2//1 3//1 4//1\nf 2//1 5//1 6//1 3//1\n";
    std::fs::write(&path, text).unwrap();
    let normals = |crease_degrees: Option<f32>| {
        let mut options = OpenOptions::default();
        options.tree.crease_degrees = crease_degrees;
        let model = open(&path, &options, &SilentProgress).unwrap().model;
        let of = |v: &crate::abi::Vertex| crate::math::octahedral::decode(v.normal);
        model.vertices.iter().map(of).collect::<Vec<_>>()
    };
    let kept = normals(None);
    assert_eq!(kept.len(), 6);
    assert!(kept.iter().all(|normal| normal.z > 0.999));
    let flat = normals(Some(40.0));
    assert_eq!(flat.len(), 8);
    assert!(
        flat.iter()
            .all(|normal| normal.z > 0.999 || normal.x < -0.999 || normal.x > 0.999)
    );
    let smooth = normals(Some(180.0));
    assert_eq!(smooth.len(), 6);
    assert!(
        smooth
            .iter()
            .any(|normal| normal.z > 0.4 && normal.z < 0.95)
    );
}

#[test]
fn a_tree_file_is_told_by_its_content_and_read_as_it_is() {
    let folder = folder();
    let at = folder.path();
    let plain = opened(at.join("a.ply")).unwrap();
    std::fs::copy(at.join("a.surfel"), at.join("b.obj")).unwrap();
    for name in ["a.surfel", "b.obj"] {
        let found = opened(at.join(name)).unwrap();
        assert_eq!(found.format, SourceFormat::Tree);
        assert_eq!(found.format.name(), "surfel tree");
        assert_eq!(found.model.triangles, plain.model.triangles);
        assert_eq!(found.build_ms, 0.0);
        assert_eq!((found.counts.vertices, found.counts.faces), (4, 2));
        let stored = std::fs::metadata(at.join(name)).unwrap().len();
        assert_eq!(found.file_bytes, stored);
    }
    // A model with the ending of a tree is a model.
    std::fs::copy(at.join("a.ply"), at.join("c.surfel")).unwrap();
    let found = opened(at.join("c.surfel")).unwrap();
    assert_eq!(found.format, SourceFormat::Mesh(Format::PlyAscii));
}

#[test]
fn generators_and_scenes_are_opened_by_name() {
    let found = opened("generate:torus:2_000").unwrap();
    assert_eq!(found.format, SourceFormat::Generated);
    assert_eq!(found.name, "generate:torus:2_000");
    assert_eq!(found.counts.faces, found.model.triangles.len() as u64);
    assert!(found.counts.faces.abs_diff(2000) < 500 && found.scene.is_none());
    assert_eq!(found.file_bytes, 0);

    let entry = scenes::find("needles").unwrap().make();
    let found = opened("scene:needles").unwrap();
    let view = found.scene.unwrap();
    assert_eq!(view.camera, entry.camera);
    assert_eq!(view.threshold_px, entry.threshold_px);
    assert_eq!(found.model.triangles.len(), entry.mesh.triangles.len());
    assert_eq!(found.format.name(), "generated");
    let empty = opened("scene:empty").unwrap();
    assert_eq!(empty.model.kind(), ModelKind::Empty);
}

#[test]
fn names_mean_sources_without_a_file_being_touched() {
    let parse = |name: &str| ModelSource::parse(Path::new(name)).unwrap();
    assert!(matches!(parse("-"), ModelSource::StandardInput));
    assert!(matches!(parse("scene:fence"), ModelSource::Scene(entry) if entry.name == "fence"));
    let ModelSource::Generator(spec) = parse("generate:square") else {
        panic!("no generator");
    };
    assert_eq!(
        spec,
        ShapeSpec::with_triangles(generate::GeneratedShape::Square, 1_000_000).unwrap()
    );
    for name in [
        "a.ply",
        "./-",
        "./scene:fence",
        "C:\\a.ply",
        "a b://c",
        "://a",
        "7z://a",
    ] {
        assert!(
            matches!(parse(name), ModelSource::File(path) if path == Path::new(name)),
            "{name}"
        );
    }
}

#[test]
fn every_error_has_its_type_and_says_what_to_do() {
    let folder = folder();
    let at = folder.path();
    std::fs::write(at.join("empty.ply"), "").unwrap();
    std::fs::write(at.join("empty.surfel"), "").unwrap();
    std::fs::write(at.join("text.surfel"), "hello\n").unwrap();
    std::fs::create_dir(at.join("folder.surfel")).unwrap();
    let tree = std::fs::read(at.join("a.surfel")).unwrap();
    std::fs::write(at.join("short.surfel"), &tree[..tree.len() - 1]).unwrap();
    let in_folder = |name: &str| at.join(name).display().to_string();
    type Check = fn(&Error) -> bool;
    let cases: [(String, Check, &str); 16] = [
        (
            "generate:cube".into(),
            |e| matches!(e, Error::Generate(GenerateError::UnknownShape(shape)) if shape == "cube"),
            "statue",
        ),
        (
            "generate:sphere:many".into(),
            |e| matches!(e, Error::Generate(GenerateError::BadCount(text)) if text == "many"),
            "generate: \"many\" is no number of triangles",
        ),
        (
            "generate:sphere:0".into(),
            |e| matches!(e, Error::Generate(GenerateError::TooFewTriangles)),
            "at least one",
        ),
        (
            "scene:no-such".into(),
            |e| matches!(e, Error::Scene(SceneError::Unknown(name)) if name == "no-such"),
            "surfel scenes lists them",
        ),
        (
            "https://example.org/a.ply".into(),
            |e| {
                cfg!(feature = "https")
                    || !cfg!(feature = "remote")
                    || matches!(e, Error::Input(InputError::Fetch { url, .. }) if url == "https://example.org/a.ply")
            },
            "https://example.org/a.ply: ",
        ),
        (
            "S3://example.org/a.ply".into(),
            |e| matches!(e, Error::Input(InputError::Remote { .. })),
            "standard input",
        ),
        (
            in_folder("missing.ply"),
            |e| matches!(e, Error::Input(InputError::Open { .. })),
            "missing.ply: cannot be read",
        ),
        (
            in_folder("missing.surfel"),
            |e| matches!(e, Error::Tree(TreeError::Io { .. })),
            "missing.surfel",
        ),
        (
            in_folder("folder.surfel"),
            |e| matches!(e, Error::Input(InputError::Open { .. })),
            "folder.surfel: cannot be read",
        ),
        (
            in_folder("empty.ply"),
            |e| matches!(e, Error::Input(InputError::Empty { .. })),
            "the file is empty",
        ),
        (
            in_folder("empty.surfel"),
            |e| matches!(e, Error::Tree(TreeError::File { offset: 0, .. })),
            "not a tree file",
        ),
        (
            in_folder("text.surfel"),
            |e| matches!(e, Error::Input(InputError::UnknownFormat { .. })),
            "not a model in a known format",
        ),
        (
            in_folder("short.surfel"),
            |e| matches!(e, Error::Tree(TreeError::File { .. })),
            "its header says",
        ),
        (
            String::new(),
            |e| matches!(e, Error::Input(InputError::Open { .. })),
            "cannot be read",
        ),
        (
            "scene:".into(),
            |e| matches!(e, Error::Scene(SceneError::Unknown(name)) if name.is_empty()),
            "no scene \"\"",
        ),
        (
            "generate:".into(),
            |e| matches!(e, Error::Generate(GenerateError::UnknownShape(_))),
            "unknown shape",
        ),
    ];
    for (source, is_expected, text) in cases {
        let error = opened(&source).expect_err(&source);
        assert!(is_expected(&error), "{source}: {error:?}");
        assert!(error.to_string().contains(text), "{source}: {error}");
        assert!(!error.is_cancelled(), "{source}");
    }
}

/// Bytes as a pipe gives them: once, in small pieces, of unknown length.
struct Dripping<'a>(&'a [u8]);

impl Read for Dripping<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let end = out.len().min(3);
        self.0.read(&mut out[..end])
    }
}

#[test]
fn a_stream_is_read_once_and_decided_by_its_first_bytes() {
    let folder = folder();
    let tree = std::fs::read(folder.path().join("a.surfel")).unwrap();
    let of_bytes = |bytes: &[u8]| {
        let stream = InputStream {
            path: Path::new(input::STANDARD_INPUT),
            folder: None,
            reader: &mut Dripping(bytes),
            expected_bytes: 0,
        };
        read_stream(stream, false, &OpenOptions::default(), &SilentProgress)
    };
    let found = of_bytes(PLY.as_bytes()).unwrap();
    assert_eq!(found.format, SourceFormat::Mesh(Format::PlyAscii));
    assert_eq!(found.file_bytes, PLY.len() as u64);
    let found = of_bytes(&tree).unwrap();
    assert_eq!(found.format, SourceFormat::Tree);
    assert_eq!(found.file_bytes, tree.len() as u64);
    assert_eq!((found.counts.vertices, found.counts.faces), (4, 2));
    for (bytes, text) in [
        (&tree[..tree.len() - 1], "standard input, byte"),
        (&tree[..9], "ends within its header"),
        (&tree[..7], "standard input: not a model"),
        (&[], "standard input: the file is empty"),
    ] {
        let error = of_bytes(bytes).err().unwrap().to_string();
        assert!(error.contains(text), "{error}");
    }
}

#[test]
#[cfg(unix)]
fn a_named_pipe_is_opened_once() {
    let folder = folder();
    let at = folder.path();
    for (name, format) in [
        ("a.ply", SourceFormat::Mesh(Format::PlyAscii)),
        ("a.surfel", SourceFormat::Tree),
    ] {
        let bytes = std::fs::read(at.join(name)).unwrap();
        let pipe = at.join(format!("pipe-{name}"));
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        let found = std::thread::scope(|scope| {
            // A reader that opens the pipe again would wait for another writer forever.
            scope.spawn(|| std::fs::write(&pipe, &bytes).unwrap());
            opened(&pipe).unwrap()
        });
        assert_eq!(found.format, format);
        assert_eq!(found.model.triangles.len(), 2);
        assert_eq!(found.file_bytes, bytes.len() as u64);
    }
}

/// Cancels from a stage on; notes all of them.
struct Until {
    stage: &'static str,
    is_over: std::sync::atomic::AtomicBool,
    stages: std::sync::Mutex<Vec<String>>,
}

impl Until {
    fn new(stage: &'static str) -> Self {
        Self {
            stage,
            is_over: stage.is_empty().into(),
            stages: std::sync::Mutex::default(),
        }
    }
}

impl Progress for Until {
    fn stage(&self, name: &str, _total: u64) {
        self.stages.lock().unwrap().push(name.to_owned());
        if name == self.stage {
            self.is_over.store(true, Ordering::Relaxed);
        }
    }

    fn advance(&self, _amount: u64) {}

    fn is_cancelled(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }
}

#[test]
fn cancelled_work_ends_with_an_error_that_says_so() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let meshes = AtomicU32::new(0);
    let stopped = |source: &str, stage| {
        let progress = Until::new(stage);
        let options = OpenOptions::default();
        let error = open_with_preview(Path::new(source), &options, &progress, &mut |_| {
            meshes.fetch_add(1, Ordering::Relaxed);
        })
        .map(|found| found.model.tree.leaves.len())
        .expect_err(source);
        assert!(error.is_cancelled(), "{source}, {stage}: {error:?}");
        assert_eq!(error.to_string(), "cancelled");
        let stages = progress.stages.into_inner().unwrap();
        // Nothing begins after the stage that was cancelled.
        assert_eq!(stages.last().map_or("", String::as_str), stage, "{source}");
        error
    };
    // Before anything was read: not even standard input is waited for.
    for source in ["-", "scene:fence", "generate:sphere:100", "missing.ply"] {
        stopped(source, "");
    }
    let error = stopped("generate:sphere:1000", "generate");
    assert!(matches!(error, Error::Generate(GenerateError::Cancelled)));
    let error = stopped(&at("a.ply"), "read");
    assert!(matches!(error, Error::Input(InputError::Cancelled)));
    let error = stopped(&at("a.ply"), "parse");
    assert!(matches!(error, Error::Input(InputError::Cancelled)));
    let error = stopped(&at("a.surfel"), "read tree");
    assert!(matches!(error, Error::Tree(TreeError::Cancelled)));
    assert_eq!(meshes.load(Ordering::Relaxed), 0, "a mesh came too early");
}

#[test]
fn the_mesh_is_shown_before_its_tree_is_built() {
    let folder = folder();
    let see = |source: &Path| {
        let progress = Until::new("none of that name");
        let mut seen = Vec::new();
        let options = OpenOptions::default();
        let found = open_with_preview(source, &options, &progress, &mut |mesh| {
            let stages = progress.stages.lock().unwrap().clone();
            seen.push((mesh.positions.len(), stages));
        });
        found.unwrap();
        (seen, progress.stages.into_inner().unwrap())
    };
    let (seen, stages) = see(&folder.path().join("a.ply"));
    assert_eq!(seen, [(4, vec!["read".to_owned(), "parse".to_owned()])]);
    assert!(
        stages.len() > 2,
        "the tree has stages of its own: {stages:?}"
    );
    let (seen, stages) = see(Path::new("generate:square:2"));
    assert_eq!(seen, [(4, vec!["generate".to_owned()])]);
    assert!(stages.len() > 1);
    // A tree is there at once.
    let (seen, stages) = see(&folder.path().join("a.surfel"));
    assert!(seen.is_empty() && stages == ["read tree"], "{stages:?}");
}

#[test]
fn what_lies_far_off_is_said_and_framed_when_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stray.obj");
    let mut text: String = (0..400)
        .map(|i| format!("v {} {} 0\n", i % 20, i / 20))
        .collect();
    text += "v 50000 0 0\nv 50001 0 0\nv 50000 1 0\nf 401 402 403\n";
    text.extend((1..380).map(|i| format!("f {} {} {}\n", i, i + 1, i + 20)));
    std::fs::write(&path, text).unwrap();
    let open_framing = |frame_all| {
        let options = OpenOptions {
            frame_all,
            ..OpenOptions::default()
        };
        open(&path, &options, &SilentProgress).unwrap()
    };
    let robust = open_framing(false);
    assert!(robust.model.orbit_sphere().radius < 20.0);
    let [ReadWarning::FarOff { vertices: 3, sizes }] = robust.warnings[..] else {
        panic!("{:?}", robust.warnings)
    };
    assert!((1500.0..2500.0).contains(&sizes), "{sizes}");
    assert_eq!(robust.parts.len(), 2);
    let all = open_framing(true);
    assert!(all.model.orbit_sphere().radius > 20_000.0 && all.warnings.is_empty());
    // A tree file knows it, too.
    let tree_path = folder.path().join("stray.surfel");
    tree::file::write(&all.model, &tree_path).unwrap();
    let tree = open(&tree_path, &OpenOptions::default(), &SilentProgress).unwrap();
    assert_eq!(tree.model.framed, robust.model.framed);
    assert_eq!(tree.warnings.len(), 1);
}

#[test]
fn a_qsplat_tree_opens_as_the_cloud_of_its_leaves() {
    use crate::pages::qs;
    let folder = folder();
    let at = folder.path().join("a.qs");
    let whole = opened("generate:torus:2000").unwrap().model;
    let tree = qs::of_model(&whole).unwrap();
    std::fs::write(&at, qs::to_bytes(&tree).unwrap()).unwrap();
    let found = opened(&at).unwrap();
    assert_eq!(found.format, SourceFormat::QSplat);
    assert_eq!(found.format.name(), "QSplat tree");
    assert_eq!(found.file_bytes, std::fs::metadata(&at).unwrap().len());
    assert_eq!(found.model.kind(), ModelKind::Points);
    assert_eq!(found.model.tree.leaves.len(), whole.tree.leaves.len());
    assert!(!found.model.has_colors && !found.model.lacks_normals());
    assert!(tree::check(&found.model).is_clean());
    // Radii are those of the file, which contain the triangles'; measured ones would be spacings.
    let radii = |model: &Model| {
        let mut radii: Vec<f32> = model.tree.leaves.iter().map(|leaf| leaf.radius).collect();
        radii.sort_unstable_by(f32::total_cmp);
        radii
    };
    let mut expected: Vec<f32> = tree.leaves().iter().map(|l| l.sphere.radius).collect();
    expected.sort_unstable_by(f32::total_cmp);
    assert_eq!(radii(&found.model), expected);
    std::fs::write(&at, b"QSplat11").unwrap();
    let error = opened(&at).unwrap_err().to_string();
    assert!(
        error.contains("a.qs, byte 8: the file ends within a header"),
        "{error}"
    );
}

#[test]
fn a_paged_tree_opens_whole_from_a_file_and_from_a_stream() {
    use crate::pages::write::{PagedOptions, to_bytes};
    let folder = folder();
    let at = folder.path().join("paged.surfel");
    let whole = opened("generate:torus:6000").unwrap().model;
    let bytes = to_bytes(&whole, &PagedOptions::default()).unwrap();
    std::fs::write(&at, &bytes).unwrap();
    let found = opened(&at).unwrap();
    assert_eq!(found.format, SourceFormat::PagedTree);
    assert_eq!(found.format.name(), "paged surfel tree");
    assert_eq!(found.file_bytes, bytes.len() as u64);
    assert_eq!(found.model.kind(), ModelKind::Surface);
    assert_eq!(found.model.triangles.len(), whole.triangles.len());
    assert_eq!(found.model.is_closed, whole.is_closed);
    let stream = InputStream {
        path: Path::new(input::STANDARD_INPUT),
        folder: None,
        reader: &mut Dripping(&bytes),
        expected_bytes: 0,
    };
    let streamed = read_stream(stream, false, &OpenOptions::default(), &SilentProgress).unwrap();
    assert_eq!(streamed.format, SourceFormat::PagedTree);
    assert_eq!(streamed.file_bytes, bytes.len() as u64);
    std::fs::write(&at, &bytes[..bytes.len() - 1]).unwrap();
    let error = opened(&at).unwrap_err().to_string();
    assert!(error.contains("paged.surfel, byte"), "{error}");
    assert!(error.contains("its header says"), "{error}");
}
