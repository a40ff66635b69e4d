//! Faults while a window is open: it loads, draws, is resized, writes a picture and closes, and each call of loader,
//! instance, device, surface and swapchain fails once.

use super::{alone, is_full};
use crate::common::Device;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use surfel::gpu::DeviceOptions;
use surfel::gpu::faults::{CallFault, CallFaults, open_devices};
use surfel::render::window_renderer::WindowBackend;
use surfel::viewer::event::{KeyModifiers, KeyboardKey, MouseButton, ViewerEvent};
use surfel::viewer::record::{EventRecorder, RecordEntry};
use surfel::viewer::{self, RunFigures, ViewerOptions};

/// Set where this process has a display of its own.
const HAS_DISPLAY: &str = "SURFEL_FAULTS_DISPLAY";

/// How long a run may take before it counts as hung.
const HANG: Duration = Duration::from_secs(120);

/// Model of the window.
const MODEL: &str = "generate:statue:3000";

/// A virtual X server.
struct VirtualDisplay {
    server: Child,
    name: String,
}

impl VirtualDisplay {
    fn open() -> Option<Self> {
        let server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "640x480x24"])
            .args(["-noreset", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let Ok(mut server) = server else {
            let is_required = std::env::var_os("SURFEL_REQUIRE_DEVICE").is_some();
            assert!(
                !is_required,
                "a window is required here: Xvfb is not installed"
            );
            eprintln!("no window, nothing tested: Xvfb is not installed");
            return None;
        };
        let mut number = String::new();
        let mut said = BufReader::new(server.stdout.take().unwrap());
        said.read_line(&mut number).unwrap();
        Some(Self {
            server,
            name: format!(":{}", number.trim()),
        })
    }
}

impl Drop for VirtualDisplay {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// What is done in the window.
fn write_recording(path: &Path) {
    let size = |width, height| ViewerEvent::Size {
        width,
        height,
        scale: 1.0,
    };
    let key = |key, pressed| ViewerEvent::Key {
        key,
        pressed,
        repeat: false,
        modifiers: KeyModifiers::default(),
    };
    let button = |pressed| ViewerEvent::Button {
        button: MouseButton::Left,
        pressed,
        modifiers: KeyModifiers::default(),
    };
    let picture = KeyboardKey::Char('p');
    let steps = [
        vec![size(200, 150), ViewerEvent::Loaded(MODEL.into())],
        vec![ViewerEvent::Scroll([0.0, 1.0])],
        vec![ViewerEvent::Cursor([20.0, 30.0]), button(true)],
        vec![ViewerEvent::Cursor([60.0, 40.0]), button(false)],
        vec![size(260, 190)],
        vec![key(picture, true), key(picture, false)],
        vec![
            key(KeyboardKey::Tab, true),
            ViewerEvent::Scroll([0.0, -1.0]),
        ],
        vec![ViewerEvent::Scroll([0.0, 1.0])],
    ];
    let entries: Vec<RecordEntry> = (0..)
        .zip(steps)
        .flat_map(|(step, events)| {
            events.into_iter().map(move |event| RecordEntry {
                step,
                time: step as f64 * 0.1,
                event,
            })
        })
        .collect();
    let mut recorder = EventRecorder::create(path).unwrap();
    recorder.add(&entries).unwrap();
    recorder.finish().unwrap();
}

/// Opens the window, plays the recording and closes it.
///
/// # Panics
/// When it hangs, leaves a device open, or validation says anything.
fn play(
    recording: &Path,
    faults: &CallFaults,
    what: &str,
) -> Result<RunFigures, viewer::ViewerError> {
    let options = ViewerOptions {
        model: MODEL.into(),
        orbit: (0.5, 0.35, 0.9),
        size: (200, 150),
        backend: WindowBackend::Vulkan,
        gpu: DeviceOptions {
            validation: true,
            call_faults: Some(faults.clone()),
            ..DeviceOptions::default()
        },
        replay: Some(recording.to_owned()),
        ..ViewerOptions::default()
    };
    let start = Instant::now();
    let result = viewer::run(options, &|| start.elapsed() > HANG);
    assert!(start.elapsed() < HANG, "{what}: hangs");
    assert_eq!(open_devices(), 0, "{what}: a device is left open");
    let said = faults.messages();
    assert!(said.is_empty(), "{what}: validation said {said:#?}");
    result
}

/// Lets every `step`-th call that can fail so fail once; prints how the runs ended.
fn sweep(recording: &Path, fault: CallFault, step: u64) {
    let counting = CallFaults::new(fault, 0);
    let whole = play(recording, &counting, "no fault").unwrap();
    assert!(whole.frames >= 4, "{whole:?}");
    let calls = counting.calls();
    assert!(calls > 0, "{fault:?}: no call is counted");
    let (mut pictures, mut less, mut sentences) = (0, 0, 0);
    for at in (1..=calls).step_by(step as usize) {
        let faults = CallFaults::new(fault, at);
        let result = play(
            recording,
            &faults,
            &format!("{fault:?} at call {at} of {calls}"),
        );
        let Some(call) = faults.failed() else {
            // An image that was shown late saves calls.
            continue;
        };
        if std::env::var_os("SURFEL_FAULTS_SHOW").is_some() {
            let ended = result
                .as_ref()
                .map(|f| f.frames)
                .map_err(ToString::to_string);
            println!("{fault:?} {at} {call}: {ended:?}");
        }
        match result {
            Ok(figures) if figures.frames >= whole.frames => pictures += 1,
            Ok(_) => less += 1,
            Err(error) => {
                let text = error.to_string();
                let is_sentence = text.lines().count() == 1 && text.len() < 400 && text.len() > 20;
                assert!(is_sentence, "{call}: {text}");
                sentences += 1;
            }
        }
    }
    println!("| window | {fault:?} | {calls} | {pictures} | {less} | {sentences} |");
    assert!(pictures + less + sentences > 0, "{fault:?}: no call failed");
}

/// In a process of its own, since the display is found by a variable.
#[test]
fn a_window_whose_calls_fail_goes_on_or_says_why() {
    let _alone = alone();
    if std::env::var_os(HAS_DISPLAY).is_some() {
        let folder = tempfile::tempdir().unwrap();
        let recording = folder.path().join("window.jsonl");
        write_recording(&recording);
        // The key for pictures writes them where the program is.
        std::env::set_current_dir(folder.path()).unwrap();
        for fault in CallFault::ALL {
            let step = match fault {
                _ if is_full() => 1,
                CallFault::OutOfHostMemory | CallFault::OutOfDeviceMemory => 41,
                CallFault::DeviceLost => 17,
                CallFault::SurfaceLost => 11,
                _ => 5,
            };
            sweep(&recording, fault, step);
        }
        return;
    }
    let Some(device) = Device::open() else { return };
    drop(device);
    let Some(display) = VirtualDisplay::open() else {
        return;
    };
    let cache = tempfile::tempdir().unwrap();
    let run = Command::new(std::env::current_exe().unwrap())
        .args(["a_window_whose_calls_fail_goes_on_or_says_why"])
        .args(["--nocapture", "--test-threads=1"])
        .env("DISPLAY", &display.name)
        .env(HAS_DISPLAY, "1")
        .env("SURFEL_CALIBRATE", "off")
        .env("XDG_CACHE_HOME", cache.path())
        .output()
        .unwrap();
    let out = String::from_utf8_lossy(&run.stdout);
    for line in out.lines() {
        match line.find("| window |") {
            // The name of the test stands before the first.
            Some(at) => println!("{}", &line[at..]),
            None if line.contains(" vk") => println!("{line}"),
            None => {}
        }
    }
    let err = String::from_utf8_lossy(&run.stderr);
    assert!(
        run.status.success() && out.contains("1 passed"),
        "{out}{err}"
    );
}
