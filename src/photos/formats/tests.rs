//! Two cameras written in every format, each with its traps.

#[path = "tests/colmap.rs"]
mod colmap;

use self::colmap::save_colmap;
use super::read_scene;
use crate::photos::error::PhotoError;
use crate::photos::lens::{CameraLens, LensModel};
use crate::photos::scene::{CalibratedCamera, PhotoScene, SceneFormat};
use glam::{DMat3, DQuat, DVec2, DVec3};
use std::fmt::Write;
use std::path::Path;

const SIZE: [u32; 2] = [64, 48];

/// Two cameras with an uneven principal point.
fn truth() -> [CalibratedCamera; 2] {
    [0.2, -0.7].map(|angle: f64| CalibratedCamera {
        width: SIZE[0],
        height: SIZE[1],
        focal: [70.0, 70.0],
        principal: [30.25, 25.5],
        lens: CameraLens::default(),
        rotation: DMat3::from_rotation_z(0.3)
            * DMat3::from_rotation_x(angle)
            * DMat3::from_rotation_y(2.0 * angle),
        center: DVec3::new(4.0 * angle, 1.0, -2.0),
    })
}

/// These with the principal point in the middle.
fn centered() -> [CalibratedCamera; 2] {
    truth().map(|camera| CalibratedCamera {
        principal: [32.0, 24.0],
        ..camera
    })
}

fn folder() -> tempfile::TempDir {
    folder_in(&std::env::temp_dir())
}

fn folder_in(above: &Path) -> tempfile::TempDir {
    let folder = tempfile::tempdir_in(above).unwrap();
    for name in ["a.png", "b.png"] {
        save_photo(&folder.path().join(name), SIZE);
    }
    folder
}

fn save_photo(path: &Path, [width, height]: [u32; 2]) {
    ::image::RgbImage::new(width, height).save(path).unwrap();
}

/// Every camera takes points to the same pixels as the true one.
fn assert_same(scene: &PhotoScene, truth: &[CalibratedCamera]) {
    assert_eq!(scene.photos.len(), truth.len(), "{:?}", scene.remarks);
    for (photo, truth) in scene.photos.iter().zip(truth) {
        assert!(photo.file.is_some(), "{}", photo.name);
        assert_eq!(
            [photo.camera.width, photo.camera.height],
            [truth.width, truth.height]
        );
        for i in 0..20 {
            let pixel = DVec2::new(f64::from(3 * i), f64::from((17 * i) % 48));
            let world = truth.center + f64::from(i + 1) * truth.direction(pixel).unwrap();
            let seen = photo.camera.project(world).unwrap();
            assert!(
                (seen - pixel).length() < 1e-3,
                "{}: {seen} is not {pixel}",
                photo.name
            );
        }
    }
}

fn words(values: impl IntoIterator<Item = f64>) -> String {
    values.into_iter().map(|v| format!("{v:.12} ")).collect()
}

fn row_major(m: DMat3) -> [f64; 9] {
    m.transpose().to_cols_array()
}

fn quaternion(m: DMat3) -> [f64; 4] {
    let q = DQuat::from_mat3(&m);
    [q.w, q.x, q.y, q.z]
}

/// Text of a bundle file whose cameras have these focal lengths.
fn bundle(cameras: &[(f64, CalibratedCamera)], points: &str, count: usize) -> String {
    let mut text = format!("# Bundle file v0.3\n{} {count}\n", cameras.len());
    for (f, camera) in cameras {
        let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let r = flip * camera.rotation;
        let t = -(r * camera.center);
        let values = row_major(r).into_iter().chain(t.to_array());
        let _ = writeln!(text, "{f} 0 0\n{}", words(values));
    }
    text + points
}

#[test]
fn bundler_looks_along_minus_z_and_leaves_out_what_is_not_registered() {
    // Lists are looked for in the folder above too, where anything may lie.
    let above = tempfile::tempdir().unwrap();
    let folder = folder_in(above.path());
    let [a, b] = centered();
    let cameras = [(70.0, a), (0.0, a), (70.0, b)];
    // Seen by cameras 1 (not registered) and 2, 3 right and 4 above the middle.
    let text = bundle(&cameras, "1 2 3\n10 20 30\n2 1 0 0 0 2 0 3 4\n", 1);
    std::fs::write(folder.path().join("bundle.out"), &text).unwrap();
    std::fs::write(
        folder.path().join("list.txt"),
        "a.png 0 70.0\nlost.png\nb.png\n",
    )
    .unwrap();
    let scene = read_scene(folder.path(), None).unwrap();
    assert_eq!(scene.format, SceneFormat::Bundler);
    assert_same(&scene, &[a, b]);
    assert!(scene.remarks[0].contains("lost.png"), "{:?}", scene.remarks);
    assert_eq!(scene.points[0].color, [10, 20, 30]);
    assert_eq!(scene.points[0].views.len(), 1);
    assert_eq!(scene.points[0].views[0].photo, 1);
    assert_eq!(scene.points[0].views[0].pixel, [35.0, 20.0]);

    // No camera at all is one sentence.
    std::fs::write(folder.path().join("bundle.out"), bundle(&[(0.0, a)], "", 0)).unwrap();
    let message = read_scene(folder.path(), None).unwrap_err().to_string();
    assert!(message.contains("none is registered"), "{message}");
    // A list that is too short, and none.
    std::fs::write(folder.path().join("bundle.out"), text).unwrap();
    std::fs::write(folder.path().join("list.txt"), "a.png\n").unwrap();
    let message = read_scene(folder.path(), None).unwrap_err().to_string();
    assert!(message.contains("camera 1 has no photograph"), "{message}");
    std::fs::remove_file(folder.path().join("list.txt")).unwrap();
    let message = read_scene(folder.path(), None).unwrap_err().to_string();
    assert!(message.contains("no list.txt"), "{message}");
}

/// A file of OpenMVS. Without a size the matrix is in units of the larger side.
fn mvs(version: u32, has_size: bool) -> Vec<u8> {
    let mut out = b"MVSI".to_vec();
    let text = |out: &mut Vec<u8>, text: &str| {
        out.extend((text.len() as u64).to_le_bytes());
        out.extend(text.bytes());
    };
    let numbers = |out: &mut Vec<u8>, values: &[f64]| {
        out.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    };
    out.extend(version.to_le_bytes());
    out.extend(0_u32.to_le_bytes());
    out.extend(1_u64.to_le_bytes());
    text(&mut out, "platform");
    out.extend(1_u64.to_le_bytes());
    text(&mut out, "camera");
    if version > 3 {
        text(&mut out, "band");
    }
    let size = if has_size { SIZE } else { [0, 0] };
    out.extend(size.iter().flat_map(|v| v.to_le_bytes()));
    // An integer is the center of a pixel: half a pixel less than here.
    let unit = if has_size { 1.0 } else { 64.0 };
    let (f, cx, cy) = (70.0 / unit, 29.75 / unit, 25.0 / unit);
    numbers(&mut out, &[f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0]);
    // The camera is turned on its platform and stands off.
    let turn = DMat3::from_rotation_y(0.4);
    let off = DVec3::new(0.1, 0.2, 0.3);
    numbers(&mut out, &row_major(turn));
    numbers(&mut out, &off.to_array());
    out.extend(2_u64.to_le_bytes());
    for camera in truth() {
        let pose = turn.transpose() * camera.rotation;
        numbers(&mut out, &row_major(pose));
        numbers(
            &mut out,
            &(camera.center - pose.transpose() * off).to_array(),
        );
    }
    out.extend(3_u64.to_le_bytes());
    for (name, pose) in [("a.png", 0), ("x.png", u32::MAX), ("b.png", 1)] {
        text(&mut out, name);
        if version > 4 {
            text(&mut out, "");
        }
        out.extend([0, 0, pose].iter().flat_map(|v| v.to_le_bytes()));
        if version > 2 {
            out.extend(0_u32.to_le_bytes());
        }
        if version > 6 {
            out.extend([0.0_f32; 3].iter().flat_map(|v| v.to_le_bytes()));
            out.extend(1_u64.to_le_bytes());
            out.extend([0; 24]);
        }
    }
    out.extend(1_u64.to_le_bytes());
    out.extend([1.0_f32, 2.0, 3.0].iter().flat_map(|v| v.to_le_bytes()));
    out.extend(2_u64.to_le_bytes());
    for image in [1_u32, 2] {
        out.extend(image.to_le_bytes());
        out.extend(1.0_f32.to_le_bytes());
    }
    out.extend(0_u64.to_le_bytes());
    out.extend(1_u64.to_le_bytes());
    // Blue first.
    out.extend([50, 100, 200]);
    out
}

#[test]
fn openmvs_of_all_versions_counts_centers_of_pixels() {
    let folder = folder();
    let path = folder.path().join("scene.mvs");
    for version in 1..=7 {
        for has_size in [true, false] {
            std::fs::write(&path, mvs(version, has_size)).unwrap();
            let scene = read_scene(folder.path(), None).unwrap();
            assert_same(&scene, &truth());
            assert_eq!(scene.points[0].color, [200, 100, 50]);
            assert_eq!(scene.points[0].views.len(), 1);
            assert_eq!(scene.points[0].views[0].photo, 1);
            assert!(scene.remarks[0].contains("x.png"), "{:?}", scene.remarks);
        }
    }
    let whole = mvs(7, true);
    for length in 0..whole.len() {
        std::fs::write(&path, &whole[..length]).unwrap();
        assert!(read_scene(folder.path(), None).is_err(), "{length}");
    }
    std::fs::write(&path, mvs(8, true)).unwrap();
    let message = read_scene(folder.path(), None).unwrap_err().to_string();
    assert!(message.contains("version 8"), "{message}");
    std::fs::write(&path, b"\x16\0\0\0serialization::archive").unwrap();
    let message = read_scene(&path, None).unwrap_err().to_string();
    assert!(message.contains("Boost"), "{message}");
}

/// A model of VisualSFM.
fn nvm(header: &str) -> String {
    let mut text = format!("{header}\n\n2\n");
    for (name, camera) in [("a.png", centered()[0]), ("my\"b.png", centered()[1])] {
        let q = words(quaternion(camera.rotation));
        let _ = writeln!(
            text,
            "{name}\t70 {q}{}0.17 0",
            words(camera.center.to_array())
        );
    }
    text + "\n1\n1 2 3 10 20 30 2 0 5 -3 4 1 6 1 -2\n\n0\n"
}

#[test]
fn visualsfm_has_its_distortion_on_the_measured_side() {
    let folder = folder();
    std::fs::rename(folder.path().join("b.png"), folder.path().join("my\"b.png")).unwrap();
    std::fs::write(folder.path().join("model.nvm"), nvm("NVM_V3")).unwrap();
    let scene = read_scene(folder.path(), None).unwrap();
    let lens = CameraLens::new(LensModel::MeasuredRadial, &[0.17]);
    assert_same(
        &scene,
        &centered().map(|camera| CalibratedCamera { lens, ..camera }),
    );
    // Measured from the middle.
    assert_eq!(scene.points[0].views[0].pixel, [29.0, 28.0]);
    assert_eq!(scene.photos[1].name, "my b.png");
    let fixed = nvm("NVM_V3 FixedK 71 30 72 25 0.1");
    std::fs::write(folder.path().join("model.nvm"), fixed).unwrap();
    let camera = read_scene(folder.path(), None).unwrap().photos[0].camera;
    assert_eq!(
        (camera.focal, camera.principal),
        ([71.0, 72.0], [30.0, 25.0])
    );
}

/// A file of AliceVision: numbers are text, the rotation is written column by column.
fn sfm(version: [u32; 3], principal: [f64; 2], focal: &str, distortion: &str) -> String {
    let mut poses = Vec::new();
    for (id, camera) in truth().iter().enumerate() {
        let list = |values: &[f64]| {
            values
                .iter()
                .map(|v| format!("\"{v:.12}\""))
                .collect::<Vec<_>>()
                .join(",")
        };
        poses.push(format!(
            r#"{{"poseId":"{id}","pose":{{"transform":{{"rotation":[{}],"center":[{}]}},"locked":"0"}}}}"#,
            list(&camera.rotation.to_cols_array()),
            list(&camera.center.to_array())
        ));
    }
    let view = |name: &str, id: u32| {
        format!(
            r#"{{"viewId":"{id}","poseId":"{id}","intrinsicId":"9","path":"/elsewhere/{name}","width":"64","height":"48"}}"#
        )
    };
    let views = [view("a.png", 0), view("gone.png", 5), view("b.png", 1)].join(",");
    let [a, b, c] = version;
    let [px, py] = principal;
    let poses = poses.join(",");
    format!(
        r#"{{"version":["{a}","{b}","{c}"],"views":[{views}],"intrinsics":[{{"intrinsicId":"9","width":"64","height":"48",{focal},"principalPoint":["{px}","{py}"],{distortion}}}],"poses":[{poses}],"structure":[{{"X":["1","2","3"],"color":["9","8","7"],"observations":[{{"observationId":"1","x":["4","5"]}}]}}]}}"#
    )
}

#[test]
fn alicevision_moved_its_principal_point_to_the_middle() {
    let folder = folder();
    let path = folder.path().join("cameras.sfm");
    let pixels = r#""pxFocalLength":"70""#;
    let both = r#""pxFocalLength":["70","70"]"#;
    // 35 mm of a sensor of 32 mm and 64 pixels.
    let millimeters = r#""focalLength":"35","sensorWidth":"32","pixelRatio":"1""#;
    let none = r#""type":"pinhole","distortionParams":"""#;
    for (version, principal, focal) in [
        ([1, 0, 0], [30.25, 25.5], pixels),
        ([1, 2, 0], [30.25, 25.5], both),
        ([1, 2, 1], [-1.75, 1.5], both),
        ([1, 2, 8], [-1.75, 1.5], millimeters),
    ] {
        std::fs::write(&path, sfm(version, principal, focal, none)).unwrap();
        let scene = read_scene(folder.path(), None).unwrap();
        assert_same(&scene, &truth());
        assert!(scene.remarks[0].contains("gone.png"), "{:?}", scene.remarks);
        assert_eq!(scene.points[0].color, [9, 8, 7]);
        assert_eq!(scene.points[0].views[0].photo, 1);
    }
    let lens = |distortion: &str| {
        std::fs::write(&path, sfm([1, 0, 0], [30.25, 25.5], pixels, distortion)).unwrap();
        read_scene(&path, None).map(|scene| scene.photos[0].camera.lens)
    };
    assert_eq!(
        lens(r#""type":"radial3","distortionParams":["-0.1","0.02","0.003"]"#).unwrap(),
        CameraLens::new(LensModel::Brown, &[-0.1, 0.02, 0.0, 0.0, 0.003])
    );
    assert_eq!(
        lens(
            r#""type":"pinhole","distortionType":"brown","distortionParams":["1","2","3","4","5"]"#
        )
        .unwrap()
        .coefficients,
        [1.0, 2.0, 4.0, 5.0, 3.0, 0.0, 0.0, 0.0]
    );
    let error = lens(r#""type":"fisheye1","distortionParams":["0.9"]"#)
        .unwrap_err()
        .to_string();
    assert!(error.contains("fisheye1"), "{error}");
}

#[test]
fn nerfstudio_moved_the_world_and_it_is_moved_back() {
    let folder = folder();
    let path = folder.path().join("transforms.json");
    let applied = DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0]);
    let shift = DVec3::new(0.5, -1.0, 2.0);
    let rows = |m: DMat3, t: DVec3| {
        let row = |i: usize| {
            format!(
                "[{:.12},{:.12},{:.12},{:.12}]",
                m.row(i).x,
                m.row(i).y,
                m.row(i).z,
                t[i]
            )
        };
        format!("[{},{},{}]", row(0), row(1), row(2))
    };
    let frame = |name: &str, camera: &CalibratedCamera| {
        let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let axes = applied * camera.rotation.transpose() * flip;
        let center = 3.0 * (applied * camera.center + shift);
        let matrix = rows(axes, center).trim_end_matches(']').to_owned() + "],[0,0,0,1]]";
        format!(r#"{{"file_path":"./{name}","transform_matrix":{matrix}}}"#)
    };
    let [a, b] = truth();
    let file = |model: &str| {
        format!(
            r#"{{"camera_model":"{model}","fl_x":70,"fl_y":70,"cx":30.25,"cy":25.5,"w":64,"h":48,"applied_scale":3,"applied_transform":{},"frames":[{},{}]}}"#,
            rows(applied, shift),
            // Endings may be left out.
            frame("a", &a),
            frame("b.png", &b)
        )
    };
    std::fs::write(&path, file("OPENCV")).unwrap();
    assert_same(&read_scene(folder.path(), None).unwrap(), &truth());
    std::fs::write(&path, file("EQUIRECTANGULAR")).unwrap();
    let error = read_scene(folder.path(), None).unwrap_err().to_string();
    assert!(error.contains("EQUIRECTANGULAR"), "{error}");
    // The angle of view instead of a focal length, and no size.
    let angle = 2.0 * (32.0_f64 / 70.0).atan();
    let text = format!(
        r#"{{"camera_angle_x":{angle},"frames":[{}]}}"#,
        frame("b", &b)
    );
    std::fs::write(&path, text).unwrap();
    let camera = read_scene(folder.path(), None).unwrap().photos[0].camera;
    assert!((camera.focal[0] - 70.0).abs() < 1e-9 && camera.focal[0] == camera.focal[1]);
    assert_eq!((camera.width, camera.principal), (64, [32.0, 24.0]));
}

#[test]
fn realitycapture_has_films_of_36_millimeters_along_the_larger_side() {
    let folder = folder();
    // Straight down from 5 above: x of the world to the right, y to the top.
    let down = CalibratedCamera {
        rotation: DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)),
        center: DVec3::new(1.0, 2.0, 5.0),
        ..truth()[0]
    };
    // Heading 90 degrees: what was north is on the left, so the top of the picture is east.
    let turned = CalibratedCamera {
        rotation: down.rotation * DMat3::from_rotation_z(std::f64::consts::FRAC_PI_2),
        ..down
    };
    let (f, px, py) = (70.0 / 64.0 * 36.0, -1.75 / 64.0 * 36.0, 1.5 / 64.0 * 36.0);
    let table = format!(
        "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\na.png,1,2,5,0,0,0,{f},{px},{py},0,0,0,0,0,0\nb.png,1,2,5,90,0,0,{f},{px},{py},0,0,0,0,0,0\n"
    );
    let path = folder.path().join("cameras.csv");
    std::fs::write(&path, &table).unwrap();
    let scene = read_scene(folder.path(), None).unwrap();
    assert_same(&scene, &[down, turned]);
    assert!(
        scene.remarks[0].contains("principal point"),
        "{:?}",
        scene.remarks
    );
    std::fs::write(&path, table.replace(",90,", ",north,")).unwrap();
    let error = read_scene(folder.path(), None).unwrap_err().to_string();
    assert!(
        error.contains("line 3") && error.contains("north"),
        "{error}"
    );
    std::fs::remove_file(path).unwrap();

    let xmp = |camera: &CalibratedCamera, model: &str, pose: bool| {
        let rotation = words(row_major(camera.rotation));
        let position = words(camera.center.to_array());
        let pose = match pose {
            true => format!(
                "<xcr:Rotation>{rotation}</xcr:Rotation><xcr:Position>{position}</xcr:Position>"
            ),
            false => String::new(),
        };
        format!(
            r#"<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#" xcr:DistortionModel="{model}" xcr:FocalLength35mm="{f}" xcr:PrincipalPointU="{}" xcr:PrincipalPointV="{}">{pose}<xcr:DistortionCoeficients>0 0 0 0 0 0</xcr:DistortionCoeficients></rdf:Description></rdf:RDF></x:xmpmeta>"#,
            px / 36.0,
            py / 36.0
        )
    };
    let save = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    save("a.xmp", xmp(&truth()[0], "brown3", true));
    save("b.xmp", xmp(&truth()[1], "perspective", true));
    save("c.xmp", xmp(&truth()[1], "perspective", false));
    let scene = read_scene(folder.path(), None).unwrap();
    assert_eq!(scene.format, SceneFormat::RealityCaptureXmp);
    assert_same(&scene, &truth());
    assert!(scene.remarks[1].contains("c.xmp"), "{:?}", scene.remarks);
    save("b.xmp", xmp(&truth()[1], "division", true));
    let error = read_scene(folder.path(), None).unwrap_err().to_string();
    assert!(
        error.contains("division") && error.contains("b.xmp"),
        "{error}"
    );
}

#[test]
fn photographs_that_were_scaled_turned_or_cut_after_calibration() {
    // They are looked for in the folder above too, where anything may lie.
    let above = tempfile::tempdir().unwrap();
    let folder = folder_in(above.path());
    save_colmap(folder.path(), "PINHOLE 64 48 70 70 30.25 25.5");
    save_photo(&folder.path().join("a.png"), [32, 24]);
    let scene = read_scene(folder.path(), None).unwrap();
    assert_same(&scene, &[truth()[0].scaled(32, 24), truth()[1]]);
    assert!(
        scene.remarks[0].contains("its camera is scaled"),
        "{:?}",
        scene.remarks
    );
    assert_eq!(scene.points[0].views[0].pixel, [5.0, 5.5]);

    // Stored as the transpose: decoding turns it, the camera stays.
    save_photo(&folder.path().join("a.png"), [48, 64]);
    assert_same(&read_scene(folder.path(), None).unwrap(), &truth());

    save_photo(&folder.path().join("a.png"), [50, 48]);
    let scene = read_scene(folder.path(), None).unwrap();
    assert_eq!(scene.photos.len(), 1);
    assert!(
        scene.remarks[0].contains("a.png is left out"),
        "{:?}",
        scene.remarks
    );
    // Views of the photograph that is left out go with it, and the other's index follows.
    assert_eq!(scene.points[0].views.len(), 1);
    assert_eq!(scene.points[0].views[0].photo, 0);

    std::fs::write(folder.path().join("a.png"), "no picture").unwrap();
    std::fs::remove_file(folder.path().join("b.png")).unwrap();
    let scene = read_scene(folder.path(), None).unwrap();
    assert!(scene.photos.iter().all(|photo| photo.file.is_none()));
    assert_eq!(scene.remarks.len(), 2, "{:?}", scene.remarks);
}

#[test]
fn what_is_no_scene_is_said() {
    let folder = tempfile::tempdir().unwrap();
    for path in [folder.path().to_owned(), folder.path().join("missing")] {
        let error = read_scene(&path, None).unwrap_err();
        assert!(matches!(error, PhotoError::NoScene { .. }), "{error}");
    }
    let path = folder.path().join("x.json");
    std::fs::write(&path, "{\"frames\": [").unwrap();
    let error = read_scene(&path, None).unwrap_err().to_string();
    assert!(error.contains("line 1"), "{error}");
    std::fs::write(folder.path().join("x.out"), "# Bundle file v0.3\n1 1\n5 0").unwrap();
    std::fs::write(folder.path().join("list.txt"), "a\n").unwrap();
    let error = read_scene(&folder.path().join("x.out"), None)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("line 3") && error.contains("ends where"),
        "{error}"
    );
}
