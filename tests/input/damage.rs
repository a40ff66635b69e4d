//! What is damaged, strange or too large: every case gives a mesh that keeps its promises or one error that names
//! the file.

use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec3, Vec3};
use surfel::input::{self, Error, ReadLimits, ReadOptions, ReadWarning};
use surfel::progress::{Progress, SilentProgress};

use super::{check, read, try_read};

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// Small good files, one of every format and encoding.
fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let head = |encoding: &str, vertices: usize| {
        format!(
            "ply\nformat {encoding} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
             property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 2\n\
             property list uchar int vertex_indices\nend_header\n"
        )
    };
    let points: [[f32; 3]; 4] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ];
    let mut little = head("binary_little_endian", 4).into_bytes();
    let mut big = head("binary_big_endian", 4).into_bytes();
    for point in points {
        point
            .iter()
            .for_each(|value| little.extend(value.to_le_bytes()));
        point
            .iter()
            .for_each(|value| big.extend(value.to_be_bytes()));
        little.extend([1, 2, 3]);
        big.extend([1, 2, 3]);
    }
    for corners in [&[0_i32, 1, 2][..], &[0, 1, 2, 3]] {
        little.push(corners.len() as u8);
        big.push(corners.len() as u8);
        corners
            .iter()
            .for_each(|corner| little.extend(corner.to_le_bytes()));
        corners
            .iter()
            .for_each(|corner| big.extend(corner.to_be_bytes()));
    }
    let mut stl = b"solid binary".to_vec();
    stl.resize(80, 0);
    stl.extend(2_u32.to_le_bytes());
    for corner in [0, 1, 2, 0, 2, 3].chunks(3) {
        stl.extend([0; 12]);
        corner
            .iter()
            .flat_map(|&c: &usize| points[c])
            .for_each(|value| stl.extend(value.to_le_bytes()));
        stl.extend([0; 2]);
    }
    let ascii = head("ascii", 4)
        + "0 0 0 1 2 3\n1 0 0 1 2 3\n1 1 0 1 2 3\n0 1 0 1 2 3\n3 0 1 2\n4 0 1 2 3\n";
    let obj = "mtllib a.mtl\nv 0 0 0 1 .5 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nusemtl a\nf 1//1 2//1 3//1\nf -4 -2/1 \\\n-1\n";
    let facet = |a: &str, b: &str| {
        format!(
            "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex {a}\nvertex {b}\nendloop\nendfacet\n"
        )
    };
    let stl_ascii = format!(
        "solid a\n{}{}endsolid\n",
        facet("1 0 0", "1 1 0"),
        facet("1 1 0", "0 1 0")
    );
    let off = "CNOFF\n4 2 0\n0 0 0 0 0 1 1 0 0 1\n1 0 0 0 0 1 1 0 0 1\n1 1 0 0 0 1 1 0 0 1\n0 1 0 0 0 1 1 0 0 1\n3 0 1 2\n4 0 1 2 3\n";
    let tri = "Vertices 4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\nVertices' Normals\n4\n0 0 1\n0 0 1\n0 0 1\n0 0 1\nTriangles\n0 1 2\n0 2 3\n";
    let public_tri = "4 2\n0 0 0 0 0 1\n1 0 0 0 0 1\n1 1 0 0 0 1\n0 1 0 0 0 1\n0 1 2\n0 2 3\n";
    let packed = gzip(&little);
    vec![
        ("a.ply", little),
        ("b.ply", big),
        ("c.ply", ascii.into_bytes()),
        ("a.obj", obj.into()),
        ("a.stl", stl),
        ("b.stl", stl_ascii.into_bytes()),
        ("a.off", off.into()),
        ("a.tri", tri.into()),
        ("b.tri", public_tri.into()),
        ("a.ply.gz", packed),
    ]
}

/// The next number of a fixed sequence (Steele and others, SplitMix64).
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Reads a damaged file: a good mesh, or an error that names the file and fits on a few lines. Returns whether it
/// was read.
fn survives(name: &str, bytes: &[u8]) -> bool {
    match try_read(name, bytes) {
        Ok(loaded) => {
            // Packed files may grow by their ratio.
            check(
                &loaded,
                if name.ends_with(".gz") {
                    1 << 20
                } else {
                    bytes.len()
                },
            );
            true
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.starts_with(name) && text.len() < 400, "{text}");
            false
        }
    }
}

#[test]
fn every_truncation_is_read_or_refused() {
    for (name, bytes) in seeds() {
        assert!(survives(name, &bytes), "{name}");
        let read = (0..bytes.len())
            .filter(|&length| survives(name, &bytes[..length]))
            .count();
        if name == "a.stl" {
            // Cut after a whole triangle it is read, with a remark.
            assert_eq!(read, 1);
            continue;
        }
        let binary = matches!(name, "a.ply" | "b.ply" | "a.ply.gz");
        // Text can lose its last line end or digits, OBJ whole lines, and stays good; binary cannot.
        assert!(
            if binary {
                read == 0
            } else {
                read > 0 || name == "b.stl"
            },
            "{name}: {read} read"
        );
    }
}

#[test]
fn random_damage_is_read_or_refused() {
    let mut state = 1;
    for (name, bytes) in seeds() {
        let (mut read, mut refused) = (0, 0);
        for _ in 0..3000 {
            let mut damaged = bytes.clone();
            for _ in 0..=next(&mut state) % 4 {
                let at = (next(&mut state) % damaged.len() as u64) as usize;
                match next(&mut state) % 6 {
                    0 => damaged[at] ^= 1 << (next(&mut state) % 8),
                    1 => damaged[at] = next(&mut state) as u8,
                    2 => damaged[at] = b"0123456789 -.#/\n\r\\e"[(next(&mut state) % 19) as usize],
                    3 => drop(damaged.remove(at)),
                    4 => damaged.insert(at, b"9 0\n-1/"[(next(&mut state) % 7) as usize]),
                    _ => damaged.truncate(at.max(1)),
                }
                if damaged.is_empty() {
                    damaged.push(b'v');
                }
            }
            if survives(name, &damaged) {
                read += 1
            } else {
                refused += 1
            }
        }
        // Both outcomes must have been tried for this test to mean something.
        assert!(
            refused > 100 && (read > 20 || name.ends_with(".gz")),
            "{name}: {read} read, {refused} refused"
        );
    }
}

#[test]
fn empty_and_unknown_files_are_named() {
    for name in ["a.ply", "a.obj", "a.stl", "a.off", "a.tri", "a"] {
        assert!(
            matches!(try_read(name, b""), Err(Error::Empty { .. })),
            "{name}"
        );
    }
    assert!(matches!(
        try_read("a.obj", b"# nothing\n"),
        Err(Error::Empty { .. })
    ));
    assert!(matches!(
        try_read("a", b"hello, world\n"),
        Err(Error::UnknownFormat { .. })
    ));
    assert!(matches!(
        try_read("a.png", b"\x89PNG\r\n\x1a\n\0\0\0\0"),
        Err(Error::UnknownFormat { .. })
    ));
    let error = input::load(
        Path::new("no/such/file.ply"),
        &ReadOptions::default(),
        &SilentProgress,
    )
    .unwrap_err();
    assert!(matches!(error, Error::Open { .. }));
    assert!(
        error
            .to_string()
            .starts_with("no/such/file.ply: cannot be read")
    );
    assert!(
        input::load(
            Path::new(env!("CARGO_MANIFEST_DIR")),
            &ReadOptions::default(),
            &SilentProgress
        )
        .is_err()
    );
}

/// Runs itself again with a model on standard input.
#[test]
fn standard_input_is_read() {
    const CHILD: &str = "SURFEL_TEST_READS_STANDARD_INPUT";
    if std::env::var_os(CHILD).is_some() {
        let loaded = input::load(Path::new("-"), &ReadOptions::default(), &SilentProgress).unwrap();
        assert_eq!(loaded.mesh.triangles.len(), 3);
        let error =
            input::load(Path::new("-"), &ReadOptions::default(), &SilentProgress).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("standard input: the file is empty"),
            "{error}"
        );
        println!("child is done");
        return;
    }
    let mut child = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "damage::standard_input_is_read", "--nocapture"])
        .env(CHILD, "1")
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let (_, bytes) = seeds().swap_remove(9);
    child.stdin.take().unwrap().write_all(&bytes).unwrap();
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success() && said.contains("child is done"),
        "{said}"
    );
}

#[test]
fn formats_without_a_reader_are_named() {
    for (name, bytes, wanted) in [
        ("a", &b"QSplat11\0\0\0\0"[..], "a QSplat tree"),
        ("a.fbx", b"\0\0\0\0", "FBX"),
        ("a", b"PK\x03\x04", "a ZIP archive"),
    ] {
        let text = try_read(name, bytes)
            .expect_err("no reader exists")
            .to_string();
        assert_eq!(
            text,
            format!("{name}: this is {wanted}, which is not read yet; convert it to PLY")
        );
    }
}

#[test]
fn content_goes_before_the_ending() {
    for (name, bytes) in seeds()
        .into_iter()
        .filter(|(name, _)| !name.ends_with(".gz") && !name.ends_with(".tri"))
    {
        let right = read(name, &bytes);
        assert!(
            !right
                .warnings
                .iter()
                .any(|warning| matches!(warning, ReadWarning::EndingDisagrees { .. }))
        );
        for wrong in ["a.xyz", "a.tri"] {
            let loaded = read(wrong, &bytes);
            assert_eq!(
                (loaded.format, loaded.mesh),
                (right.format, right.mesh.clone())
            );
            assert!(
                matches!(&loaded.warnings[0], ReadWarning::EndingDisagrees { .. }),
                "{wrong} {name}"
            );
        }
        assert_eq!(read("no ending", &bytes).warnings, right.warnings);
    }
    let marked = [&b"\xef\xbb\xbf"[..], b"OFF\n1 0 0\n1 2 3\n"].concat();
    assert_eq!(
        read("a.off", marked).mesh.positions,
        [Vec3::new(1.0, 2.0, 3.0)]
    );
}

#[test]
fn gzip_is_unpacked_within_bounds() {
    let (_, plain) = seeds().swap_remove(0);
    let (first, second) = plain.split_at(200);
    let members = [gzip(first), gzip(second)].concat();
    for packed in [gzip(&plain), members] {
        let loaded = read("a.ply", &packed);
        assert_eq!(loaded.mesh, read("a.ply", &plain).mesh);
        assert_eq!(loaded.file_bytes, packed.len() as u64);
    }
    let mut damaged = gzip(&plain);
    let crc = damaged.len() - 8;
    damaged[crc] ^= 1;
    assert!(matches!(
        try_read("a.ply.gz", &damaged),
        Err(Error::Gzip { .. })
    ));
    // Zeros pack a thousand times: 80 MiB in some 80 kB.
    let bomb = gzip(&vec![0; 80 << 20]);
    assert!(bomb.len() < 100_000);
    assert!(
        matches!(try_read("a.ply", &bomb), Err(Error::TooLarge { found, .. }) if found <= (64 << 20) + 1)
    );
    let small = ReadLimits {
        unpacked_bytes: 100,
        ..ReadLimits::default()
    };
    let options = ReadOptions {
        limits: small,
        ..ReadOptions::default()
    };
    assert!(matches!(
        input::load_bytes("a", &gzip(&plain), &options, &SilentProgress),
        Err(Error::TooLarge {
            limit: 100,
            found: 101,
            ..
        })
    ));
}

#[test]
fn limits_are_kept() {
    for (name, bytes) in seeds().iter().filter(|(name, _)| *name != "a.ply.gz") {
        let limit = |limits| ReadOptions {
            limits,
            ..ReadOptions::default()
        };
        let few = limit(ReadLimits {
            vertices: 3,
            ..ReadLimits::default()
        });
        let error = input::load_bytes(name, bytes, &few, &SilentProgress)
            .expect_err("four vertices are over three");
        assert!(
            matches!(
                error,
                Error::TooLarge {
                    what: "vertices",
                    limit: 3,
                    ..
                }
            ),
            "{name}: {error}"
        );
        let short = limit(ReadLimits {
            file_bytes: 30,
            ..ReadLimits::default()
        });
        assert!(matches!(
            input::load_bytes(name, bytes, &short, &SilentProgress),
            Err(Error::TooLarge { limit: 30, .. })
        ));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        assert!(matches!(
            input::load(&path, &short, &SilentProgress),
            Err(Error::TooLarge { limit: 30, .. })
        ));
    }
}

#[test]
fn what_is_not_finite_is_dropped_and_counted() {
    let text = "v 0 0 0\nv nan 0 0\nv 1 0 0\nv 0 1e99 0\nv 0 1 0\nf 1 2 3\nf 1 3 5\nf 4 1 3\n";
    let loaded = read("a.obj", text);
    assert_eq!(loaded.mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2]]);
    assert_eq!(
        loaded.warnings,
        [ReadWarning::NotFiniteDropped {
            vertices: 2,
            triangles: 2
        }]
    );
    let colors = "OFF\n2 0 0\n";
    let cloud = read(
        "a.off",
        colors.replace("OFF", "CNOFF") + "inf 0 0 1 0 0 1 0 0\n1 2 3 0 0 0 0 1 0\n",
    );
    assert_eq!(cloud.mesh.colors, [[0, 255, 0, 255]]);
    assert_eq!(cloud.mesh.normals, [], "the only normal left is unknown");
    assert!(
        cloud
            .warnings
            .contains(&ReadWarning::NormalsUnknown { count: 1 })
    );
    let nothing = try_read("a.off", "OFF\n2 0 0\nnan 0 0\n1e99 0 0\n");
    assert!(matches!(nothing, Err(Error::NotFinite { vertices: 2, .. })));
}

#[test]
fn large_coordinates_keep_their_detail() {
    // Millimeters at UTM coordinates, in a text and in doubles.
    let points = [(0.001, 0.002), (7.5, 0.25), (3.125, 9.75)]
        .map(|(x, y)| DVec3::new(484_649.0 + x, 6_632_629.0 + y, 21.5));
    let text: String = points
        .iter()
        .map(|p| format!("v {} {} {}\n", p.x, p.y, p.z))
        .collect();
    let mut ply = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\nproperty double y\n\
        property double z\nend_header\n"
        .to_vec();
    points
        .iter()
        .flat_map(|p| p.to_array())
        .for_each(|value| ply.extend(value.to_le_bytes()));
    for loaded in [read("a.obj", &text), read("a.ply", &ply)] {
        let mesh = &loaded.mesh;
        assert_eq!(mesh.origin, DVec3::new(484_653.0, 6_632_634.0, 22.0));
        assert_eq!(
            loaded.warnings,
            [ReadWarning::OriginMoved {
                origin: mesh.origin
            }]
        );
        for (position, point) in mesh.positions.iter().zip(points) {
            assert!((mesh.origin + position.as_dvec3()).distance(point) < 1e-6);
        }
    }
    // The same in single precision: the detail is gone, but what is left is kept exactly.
    let mut single = b"ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\nproperty float y\n\
        property float z\nend_header\n"
        .to_vec();
    let values = [8_388_607.5_f32, 1.0, 2.0, 8_388_600.0, 1.5, 2.0];
    values
        .iter()
        .for_each(|value| single.extend(value.to_le_bytes()));
    let mesh = read("a.ply", single).mesh;
    assert!(mesh.origin != DVec3::ZERO);
    assert_eq!(
        mesh.origin + mesh.positions[0].as_dvec3(),
        DVec3::new(8_388_607.5, 1.0, 2.0)
    );
}

#[test]
fn welding_merges_equal_vertices_when_asked() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 5 4 6\n";
    assert_eq!(read("a.obj", text).mesh.positions.len(), 6);
    let options = ReadOptions {
        weld: true,
        ..ReadOptions::default()
    };
    let loaded = input::load_bytes("a.obj", text.as_bytes(), &options, &SilentProgress).unwrap();
    assert_eq!(loaded.mesh.positions.len(), 4);
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [2, 1, 3]]);
}

/// Counts what it is told and cancels after so many questions.
struct Counting {
    total: AtomicU64,
    done: AtomicU64,
    questions: AtomicU64,
    patience: u64,
}

impl Counting {
    fn new(patience: u64) -> Self {
        Self {
            total: 0.into(),
            done: 0.into(),
            questions: 0.into(),
            patience,
        }
    }
}

impl Progress for Counting {
    fn stage(&self, _: &str, total: u64) {
        self.total.fetch_add(total, Ordering::Relaxed);
    }
    fn advance(&self, amount: u64) {
        self.done.fetch_add(amount, Ordering::Relaxed);
    }
    fn is_cancelled(&self) -> bool {
        self.questions.fetch_add(1, Ordering::Relaxed) >= self.patience
    }
}

#[test]
fn progress_adds_up_and_cancelling_stops_anywhere() {
    for (name, small) in seeds() {
        // Large enough that reading passes several of its looks at the progress.
        let bytes = match name {
            "a.obj" => [&small[..], &b"v 1.25 2.5 3.75\n".repeat(600_000)].concat(),
            _ => small,
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, &bytes).unwrap();
        let all = Counting::new(u64::MAX);
        input::load(&path, &ReadOptions::default(), &all).unwrap();
        assert_eq!(all.done.into_inner(), all.total.into_inner(), "{name}");
        let questions = all.questions.into_inner();
        assert!(questions >= 3, "{name}");
        for patience in 0..questions {
            let result = input::load(&path, &ReadOptions::default(), &Counting::new(patience));
            assert!(
                matches!(result, Err(Error::Cancelled)),
                "{name} after {patience} of {questions}"
            );
        }
    }
}
