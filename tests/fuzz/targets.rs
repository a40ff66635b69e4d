//! One entry of the library for each kind of file that a user may hand over, with what has to hold whatever is in it.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use surfel::cut::{Cut, CutSettings, select};
use surfel::image::{FloatImage, PictureChannels};
use surfel::input::{self, LoadedMesh, ReadOptions};
use surfel::pages::file::PagedFile;
use surfel::pages::source::MemorySource;
use surfel::pages::{check as check_pages, join, qs};
use surfel::photos::decode::{decode_photo, decode_thumbnail};
use surfel::photos::formats::read_scene;
use surfel::progress::SilentProgress;
use surfel::tree::{self, Model};

/// What became of an input that kept every promise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct InputOutcome {
    pub(crate) is_opened: bool,
    /// Kind of the outcome: inputs of one kind go the same way. Kept inputs are those of a new kind.
    pub(crate) class: u64,
}

/// A kind of input.
pub(crate) struct FuzzTarget {
    /// Name of its folder in the corpus.
    pub(crate) name: &'static str,
    /// Words of its formats.
    pub(crate) words: &'static [&'static str],
    /// Opens a file of this name in a folder of its own. The error says which promise was broken.
    pub(crate) run: fn(&Path, &str, &[u8]) -> Result<InputOutcome, String>,
    /// Memory beyond 4 x file + 64 MiB that pictures of few bytes may take, bytes.
    pub(crate) more_memory: usize,
    /// Whether the files of the corpus are the parts of one input: all of the ending are in the folder.
    pub(crate) has_parts: bool,
}

const fn target(
    name: &'static str,
    run: fn(&Path, &str, &[u8]) -> Result<InputOutcome, String>,
    words: &'static [&'static str],
) -> FuzzTarget {
    FuzzTarget {
        name,
        words,
        run,
        more_memory: 0,
        has_parts: false,
    }
}

/// All kinds.
pub(crate) const TARGETS: &[FuzzTarget] = &[
    target(
        "obj",
        model_in_memory,
        &[
            "v ",
            "vn ",
            "vt ",
            "f ",
            "usemtl a\n",
            "mtllib a.mtl\n",
            "l 1 2\n",
            "p 1\n",
            "g x\n",
            "\\\n",
            "#MRGB ",
            "1/1/1",
            "//",
        ],
    ),
    target(
        "materials",
        model_in_folder,
        &[
            "newmtl ",
            "Kd ",
            "map_Kd ",
            "d ",
            "Tr ",
            "-o 1 2 3 ",
            "-s 2 2 2 ",
            "-clamp on ",
            "-mm 0 1 ",
            "a.png",
            "..",
            "/",
        ],
    ),
    target(
        "ply",
        model_in_memory,
        &[
            "element vertex ",
            "element face ",
            "property list uchar int vertex_indices\n",
            "property double x\n",
            "property float x\n",
            "property uchar red\n",
            "end_header\n",
            "format ascii 1.0\n",
            "format binary_big_endian 1.0\n",
            "comment TextureFile a.png\n",
            "uint",
            "int8",
            "float64",
            "tristrips",
        ],
    ),
    target(
        "splats",
        model_in_memory,
        &[
            "f_dc_0",
            "scale_0",
            "rot_0",
            "opacity",
            "property float ",
            "end_header\n",
        ],
    ),
    target(
        "stl",
        model_in_memory,
        &[
            "solid ",
            "facet normal ",
            "outer loop\n",
            "vertex ",
            "endloop\n",
            "endfacet\n",
            "endsolid\n",
            "COLOR=",
        ],
    ),
    target(
        "off",
        model_in_memory,
        &[
            "OFF", "COFF", "NOFF", "STOFF", "CNOFF", "4OFF", "nOFF", "BINARY", "#",
        ],
    ),
    target(
        "tri",
        model_in_memory,
        &["Vertices ", "Vertices' Normals", "Triangles", "Colors"],
    ),
    target(
        "las",
        model_in_memory,
        &["LASF", "laszip encoded", "copc", "LASF_Spec"],
    ),
    target(
        "e57",
        model_in_memory,
        &[
            "Float",
            "Integer",
            "ScaledInteger",
            "minimum=\"",
            "maximum=\"",
            "recordCount=\"",
            "fileOffset=\"",
            "sphericalRange",
            "cartesianX",
            "<vectorChild",
            "precision=\"single\"",
        ],
    ),
    target(
        "pcd",
        model_in_memory,
        &[
            "FIELDS ",
            "SIZE ",
            "TYPE ",
            "COUNT ",
            "WIDTH ",
            "HEIGHT ",
            "VIEWPOINT ",
            "POINTS ",
            "DATA ascii\n",
            "DATA binary\n",
            "DATA binary_compressed\n",
            "rgb",
            "normal_x",
        ],
    ),
    target(
        "text",
        model_in_memory,
        &[
            "x,y,z\n",
            "X Y Z Intensity R G B\n",
            ";",
            ",",
            "\t",
            "//",
            "#",
            "nan",
        ],
    ),
    target(
        "ptx",
        model_in_memory,
        &["1 0 0 0\n", "0 0 0\n", "0.5", "\n"],
    ),
    target(
        "gltf",
        model_in_folder,
        &[
            "\"bufferView\":",
            "\"byteOffset\":",
            "\"byteStride\":",
            "\"count\":",
            "\"componentType\":5126",
            "\"sparse\":",
            "\"children\":[0]",
            "\"mode\":5",
            "\"normalized\":true",
            "\"uri\":\"data:,\"",
            "KHR_draco_mesh_compression",
            "EXT_meshopt_compression",
            "null",
            "[]",
            "{}",
        ],
    ),
    target("gzip", model_in_memory, &[]),
    target("tree", tree_file, &[]),
    target("paged", paged_file, &[]),
    target("qsplat", qs_file, &["QSplat"]),
    target(
        "camera",
        camera_file,
        &[
            "\"width\":",
            "\"view\":",
            "\"proj\":",
            "\"light\":\"directional\"",
            "\"y_down\":true",
            "null",
            "[]",
            "{}",
            "1e999",
        ],
    ),
    #[cfg(feature = "viewer")]
    target(
        "recording",
        recording,
        &[
            "{\"surfel_input\":1}\n",
            "\"step\":",
            "\"time\":",
            "\"key\"",
            "null",
            "{}",
        ],
    ),
    #[cfg(feature = "viewer")]
    target(
        "settings",
        settings_file,
        &[
            "[window]\n",
            "[look]\n",
            "width = ",
            "frame_ms = ",
            "true",
            "\"\"",
            "[[",
            "nan",
            "inf",
        ],
    ),
    target(
        "chart-rows",
        chart_rows,
        &["version", "commit", ",", "\"", "\n"],
    ),
    target(
        "bundler",
        scene,
        &["# Bundle file v0.3\n", "0 0 0\n", "1 0 0\n"],
    ),
    target(
        "visualsfm",
        scene,
        &["NVM_V3", "NVM_V3_R9T", "FixedK", "0\n"],
    ),
    target("openmvs", scene, &["MVSI", "MVS\0"]),
    target(
        "alicevision",
        scene,
        &[
            "\"views\":",
            "\"intrinsics\":",
            "\"poses\":",
            "\"sfmData\":",
            "\"version\":[\"1\",\"2\",\"8\"]",
            "null",
            "[]",
            "{}",
            "radial3",
            "fisheye4",
        ],
    ),
    target(
        "nerfstudio",
        scene,
        &[
            "\"frames\":",
            "\"transform_matrix\":",
            "\"applied_transform\":",
            "\"camera_model\":",
            "OPENCV_FISHEYE",
            "null",
            "[]",
            "{}",
        ],
    ),
    target(
        "realitycapture",
        scene,
        &[
            "xcr:Position=\"",
            "xcr:Rotation=\"",
            "xcr:FocalLength35mm=\"",
            "<xcr:Rotation>",
            "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n",
        ],
    ),
    FuzzTarget {
        has_parts: true,
        ..target(
            "colmap",
            scene,
            &[
                "PINHOLE",
                "SIMPLE_PINHOLE",
                "OPENCV",
                "FULL_OPENCV",
                "SIMPLE_RADIAL",
                "OPENCV_FISHEYE",
                "FOV",
                "-1",
            ],
        )
    },
    // A decoded picture is as large as its header says, whatever the file's size.
    FuzzTarget {
        more_memory: 6 * PICTURE_BYTES,
        ..target(
            "photographs",
            photograph,
            &["Exif\0\0", "IHDR", "IDAT", "PLTE", "tRNS", "iCCP"],
        )
    },
    FuzzTarget {
        more_memory: 6 * PICTURE_BYTES,
        ..target(
            "pictures",
            picture,
            &[
                "channels\0chlist\0",
                "compression\0compression\0",
                "dataWindow\0box2i\0",
                "tiles\0tiledesc\0",
                "IHDR",
                "IDAT",
                "PLTE",
                "tRNS",
            ],
        )
    },
];

/// Budget of a photograph here, bytes.
const PICTURE_BYTES: usize = 16 << 20;

fn class_of(text: &str) -> u64 {
    let mut hasher = DefaultHasher::new();
    let mut is_quoted = false;
    let mut last = ' ';
    for c in text.chars() {
        is_quoted ^= c == '"';
        let shown = if c.is_ascii_digit() { '0' } else { c };
        if !is_quoted && shown != last {
            shown.hash(&mut hasher);
        }
        last = shown;
    }
    hasher.finish()
}

fn opened(facts: &str) -> Result<InputOutcome, String> {
    Ok(InputOutcome {
        is_opened: true,
        class: class_of(facts),
    })
}

/// An error, which has to name the file and be short.
fn refused(name: &str, text: &str) -> Result<InputOutcome, String> {
    expect(
        text.contains(name),
        &format!("an error without the file: {text}"),
    )?;
    expect(text.len() < 1000, &format!("a long error: {text}"))?;
    expect(
        is_clean(text),
        &format!("an error with control characters: {text:?}"),
    )?;
    Ok(InputOutcome {
        is_opened: false,
        class: class_of(text),
    })
}

/// Whether a text can be shown on a terminal: nothing in it moves the cursor or rings.
fn is_clean(text: &str) -> bool {
    text.chars().all(|c| c == '\n' || !c.is_control())
}

fn expect(holds: bool, what: &str) -> Result<(), String> {
    if holds { Ok(()) } else { Err(what.to_owned()) }
}

/// What a mesh promises, whatever it was read from; some are built into a tree, checked and cut.
fn check_loaded(loaded: LoadedMesh, bytes: &[u8]) -> Result<InputOutcome, String> {
    let mesh = &loaded.mesh;
    let vertices = mesh.positions.len();
    expect(vertices > 0, "a mesh without vertices")?;
    expect(
        mesh.positions.iter().all(|point| point.is_finite()) && mesh.origin.is_finite(),
        "a position that is not finite",
    )?;
    let corners = mesh.triangles.iter().flatten();
    expect(
        corners.copied().all(|corner| (corner as usize) < vertices),
        "a corner without a vertex",
    )?;
    let fits = |length: usize| length == 0 || length == vertices;
    expect(
        fits(mesh.normals.len()) && fits(mesh.colors.len()),
        "normals or colors of another number than vertices",
    )?;
    let is_unit = |n: &glam::Vec3| *n == glam::Vec3::ZERO || (n.length() - 1.0).abs() < 1e-5;
    expect(
        mesh.normals.iter().all(is_unit),
        "a normal of another length than 1",
    )?;
    let columns = &loaded.attributes.columns;
    expect(
        columns.iter().all(|column| column.values.len() == vertices),
        "an attribute of another number than points",
    )?;
    let said: String = loaded.warnings.iter().map(ToString::to_string).collect();
    expect(
        is_clean(&said),
        &format!("remarks with control characters: {said:?}"),
    )?;
    let facts = format!(
        "{} {} {} {} {said}",
        loaded.format,
        mesh.triangles.is_empty(),
        mesh.normals.is_empty(),
        mesh.colors.is_empty()
    );
    if bytes.iter().map(|b| u64::from(*b)).sum::<u64>() % 4 == 0 && vertices < 20_000 {
        let model = tree::build(loaded.mesh, &tree::BuildOptions::default(), &SilentProgress)
            .map_err(|error| format!("no tree: {error}"))?;
        let report = tree::check(&model);
        expect(report.is_clean(), &report.violations.join("; "))?;
        check_model(&model)?;
    }
    opened(&facts)
}

/// What a model promises: finite bounds, and cuts of it end.
fn check_model(model: &Model) -> Result<(), String> {
    expect(
        model.min.is_finite() && model.max.is_finite() && model.origin.is_finite(),
        "bounds that are not finite",
    )?;
    tree::links(model)?;
    if model.used_vertices == 0 {
        return Ok(());
    }
    let camera = model.orbit_camera((64, 48), 0.5, 0.35, 1.0);
    if let Ok(view) = camera.view(model.origin) {
        let mut cut = Cut::default();
        select(model, &view, &CutSettings::default(), &mut cut);
    }
    Ok(())
}

fn options() -> ReadOptions {
    ReadOptions {
        limits: input::ReadLimits {
            texture_bytes: 8 << 20,
            ..Default::default()
        },
        ..Default::default()
    }
}

fn model_in_memory(_: &Path, name: &str, bytes: &[u8]) -> Result<InputOutcome, String> {
    match input::load_bytes(name, bytes, &options(), &SilentProgress) {
        Ok(loaded) => check_loaded(loaded, bytes),
        Err(error) => refused(name, &error.to_string()),
    }
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    path
}

/// A model whose materials and images lie beside it; a file of materials is that of a fixed model.
fn model_in_folder(folder: &Path, name: &str, bytes: &[u8]) -> Result<InputOutcome, String> {
    let path = write(folder, name, bytes);
    let model = folder.join("square.obj");
    let is_model = !name.ends_with("mtl") && !name.ends_with("png") && !name.ends_with("jpg");
    if !is_model {
        let pictured = if name.ends_with("mtl") { "a.png" } else { name };
        if name.ends_with("mtl") {
            write(
                folder,
                "a.png",
                include_bytes!("corpus/pictures/colors.png"),
            );
        } else {
            write(
                folder,
                "a.mtl",
                format!("newmtl a\nmap_Kd {pictured}\n").as_bytes(),
            );
        }
        write(
            folder,
            "square.obj",
            b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
              usemtl a\nf 1/1 2/2 3/3 4/4\n",
        );
    }
    let path = if is_model { path } else { model };
    match input::load(&path, &options(), &SilentProgress) {
        Ok(loaded) => check_loaded(loaded, bytes),
        Err(error) => refused(&path.display().to_string(), &error.to_string()),
    }
}

fn tree_file(_: &Path, name: &str, bytes: &[u8]) -> Result<InputOutcome, String> {
    let read = tree::file::read_from(
        &mut &*bytes,
        bytes.len() as u64,
        Path::new(name),
        &SilentProgress,
    );
    match read {
        Ok(model) => {
            check_model(&model)?;
            let report = tree::check(&model);
            opened(&report.violations.join(" "))
        }
        Err(error) => refused(name, &error.to_string()),
    }
}

fn paged_file(_: &Path, name: &str, bytes: &[u8]) -> Result<InputOutcome, String> {
    let file = match PagedFile::open(Arc::new(MemorySource::new(name, bytes))) {
        Ok(file) => file,
        Err(error) => return refused(name, &error.to_string()),
    };
    let report = check_pages::check(&file, &SilentProgress);
    if let Ok(model) = file.stand_in(file.origin()) {
        check_model(&model)?;
    }
    match join::whole_model(&file, &SilentProgress) {
        Ok(model) => {
            check_model(&model)?;
            opened(&report.violations.join(" "))
        }
        Err(error) => refused(name, &error.to_string()),
    }
}

fn qs_file(_: &Path, name: &str, bytes: &[u8]) -> Result<InputOutcome, String> {
    let trees = match qs::read(bytes, Path::new(name)) {
        Ok(trees) => trees,
        Err(error) => return refused(name, &error.to_string()),
    };
    let cloud = qs::QsCloud::of_trees(&trees);
    if cloud.radii.len() > 20_000 {
        return opened("many");
    }
    match tree::build_with_radii(cloud.mesh, &cloud.radii, &SilentProgress) {
        Ok(model) => {
            let report = tree::check(&model);
            expect(report.is_clean(), &report.violations.join("; "))?;
            check_model(&model)?;
            opened("")
        }
        Err(error) => Ok(InputOutcome {
            is_opened: false,
            class: class_of(&error.to_string()),
        }),
    }
}

fn camera_file(folder: &Path, name: &str, bytes: &[u8]) -> Result<InputOutcome, String> {
    let path = write(folder, name, bytes);
    match surfel::math::camera::Camera::read(&path) {
        Ok(camera) => {
            let view = camera
                .view(glam::DVec3::ZERO)
                .map_err(|error| error.to_string())?;
            opened(&format!("{:?}", view.is_perspective))
        }
        Err(error) => Ok(InputOutcome {
            is_opened: false,
            class: class_of(&error.to_string()),
        }),
    }
}

#[cfg(feature = "viewer")]
fn recording(folder: &Path, name: &str, bytes: &[u8]) -> Result<InputOutcome, String> {
    let path = write(folder, name, bytes);
    match surfel::viewer::record::read(&path) {
        Ok(entries) => {
            let is_timed = entries.iter().all(|entry| entry.time.is_finite());
            expect(is_timed, "a time that is not finite")?;
            opened("")
        }
        Err(error) => refused(name, &error.to_string()),
    }
}

#[cfg(feature = "viewer")]
fn settings_file(folder: &Path, name: &str, bytes: &[u8]) -> Result<InputOutcome, String> {
    let path = write(folder, name, bytes);
    match surfel::viewer::store::load(&path) {
        Ok((stored, _)) => {
            let again = folder.join("again.toml");
            surfel::viewer::store::save(&again, &stored)?;
            surfel::viewer::store::load(&again)
                .map_err(|error| format!("not read again: {error}"))?;
            opened("")
        }
        Err(error) => refused(name, &error),
    }
}

fn chart_rows(folder: &Path, name: &str, bytes: &[u8]) -> Result<InputOutcome, String> {
    let path = write(folder, name, bytes);
    match surfel::chart::read_rows(&path) {
        Ok(rows) => opened(if rows.is_empty() { "" } else { "rows" }),
        Err(error) => refused(name, &error.to_string()),
    }
}

fn scene_at(path: &Path, folder: &Path) -> Result<InputOutcome, String> {
    match read_scene(path, None) {
        Ok(scene) => {
            for photo in &scene.photos {
                expect(photo.camera.is_usable(), "a camera that is not usable")?;
            }
            let photos = scene.photos.len();
            let views = scene.points.iter().flat_map(|point| &point.views);
            expect(
                views.into_iter().all(|view| (view.photo as usize) < photos),
                "a view of no photograph",
            )?;
            let (center, radius) = scene.extent();
            expect(
                center.is_finite() && radius.is_finite(),
                "an extent that is not finite",
            )?;
            let said = scene.remarks.join(" ");
            expect(
                is_clean(&said),
                &format!("remarks with control characters: {said:?}"),
            )?;
            opened(&said)
        }
        Err(error) => refused(&folder.display().to_string(), &error.to_string()),
    }
}

fn scene(folder: &Path, name: &str, bytes: &[u8]) -> Result<InputOutcome, String> {
    let path = write(folder, name, bytes);
    // The folder is the scene where each photograph has a file of its own.
    let is_folder = name.ends_with(".xmp");
    scene_at(if is_folder { folder } else { &path }, folder)
}

fn photograph(folder: &Path, name: &str, bytes: &[u8]) -> Result<InputOutcome, String> {
    let path = write(folder, name, bytes);
    let size = [16, 12];
    let small = decode_thumbnail(&path, size, PICTURE_BYTES as u64).is_ok();
    match decode_photo(&path, size, PICTURE_BYTES as u64) {
        Ok(pixels) => {
            let count = pixels.width as usize * pixels.height as usize;
            expect(
                pixels.rgb.len() == count,
                "pixels of another number than its size",
            )?;
            opened(&format!("{small}"))
        }
        Err(error) => refused(name, &error.to_string()),
    }
}

fn picture(folder: &Path, name: &str, bytes: &[u8]) -> Result<InputOutcome, String> {
    let path = write(folder, name, bytes);
    if let Ok(channels) = PictureChannels::load(&path) {
        let is_whole = channels
            .channels
            .iter()
            .all(|channel| channel.values.len() == channel.width * channel.height);
        expect(is_whole, "values of another number than pixels")?;
    }
    match FloatImage::load(&path) {
        Ok(image) => {
            let count = image.width as usize * image.height as usize;
            expect(
                image.color.len() == count,
                "pixels of another number than its size",
            )?;
            opened("")
        }
        Err(error) => refused(name, &error.to_string()),
    }
}
