//! A virtual X server, a window on it, and hands and eyes for both: keys, mouse, drops, the clipboard, pictures.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use x11rb::connection::Connection;
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    Atom, AtomEnum, BUTTON_PRESS_EVENT, BUTTON_RELEASE_EVENT, ClientMessageEvent,
    ConfigureWindowAux, ConnectionExt, CreateWindowAux, EventMask, ImageFormat, InputFocus,
    KEY_PRESS_EVENT, KEY_RELEASE_EVENT, MOTION_NOTIFY_EVENT, MapState, PropMode,
    SELECTION_NOTIFY_EVENT, SelectionNotifyEvent, WindowClass,
};
use x11rb::protocol::xtest::ConnectionExt as _;
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;

/// How long anything may take before a test counts as hung.
pub(crate) const HANG: Duration = Duration::from_secs(60);

/// A virtual X server of its own, so that tests share neither pointer nor focus.
pub(crate) struct Display {
    server: Child,
    name: String,
    x: RustConnection,
    root: u32,
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

fn skip(reason: &str) {
    assert!(
        std::env::var_os("SURFEL_REQUIRE_DEVICE").is_none(),
        "a window is required here: {reason}"
    );
    eprintln!("no window, nothing tested: {reason}");
}

pub(crate) fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(start.elapsed() < HANG, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Keysyms of the keys that are no letters.
fn keysym(name: &str) -> u32 {
    match name {
        "Return" => 0xff0d,
        "Escape" => 0xff1b,
        "Tab" => 0xff09,
        "BackSpace" => 0xff08,
        "F1" => 0xffbe,
        "F5" => 0xffc2,
        "F11" => 0xffc8,
        "Shift" => 0xffe1,
        "Control" => 0xffe3,
        "Home" => 0xff50,
        "Left" => 0xff51,
        "Up" => 0xff52,
        "Right" => 0xff53,
        "Down" => 0xff54,
        "Page_Down" => 0xff56,
        "End" => 0xff57,
        "plus" => 0x2b,
        "question" => 0x3f,
        name => {
            let mut chars = name.chars();
            let c = chars.next().unwrap();
            assert!(chars.next().is_none() && c.is_ascii(), "no key {name}");
            u32::from(c)
        }
    }
}

impl Display {
    pub(crate) fn open() -> Option<Self> {
        let devices = Command::new(env!("CARGO_BIN_EXE_surfel"))
            .arg("devices")
            .output()
            .unwrap();
        if !devices.status.success() {
            skip("no Vulkan device");
            return None;
        }
        // Without -noreset the server starts anew whenever its last client leaves, and refuses others meanwhile.
        let server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x1024x24"])
            .args(["-noreset", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let Ok(mut server) = server else {
            skip("Xvfb is not installed");
            return None;
        };
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap())
            .read_line(&mut number)
            .unwrap();
        let name = format!(":{}", number.trim());
        assert!(!number.trim().is_empty(), "Xvfb did not start");
        let (x, screen) = x11rb::connect(Some(&name)).unwrap();
        let root = x.setup().roots[screen].root;
        Some(Self {
            server,
            name,
            x,
            root,
        })
    }

    pub(crate) fn surfel(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_surfel"));
        command
            .args(arguments)
            .env("DISPLAY", &self.name)
            // Measured costs may change the last bits of a picture.
            .env("SURFEL_CALIBRATE", "off")
            // What a window was left like must not reach another test.
            .env("SURFEL_CONFIG", "");
        command
    }

    fn atom(&self, name: &str) -> Atom {
        let cookie = self.x.intern_atom(false, name.as_bytes()).unwrap();
        cookie.reply().unwrap().atom
    }

    /// Says how many dots an inch of the screen has, as desktops do.
    pub(crate) fn set_dots_per_inch(&self, dots: u32) {
        let text = format!("Xft.dpi:\t{dots}\n");
        let atom = AtomEnum::RESOURCE_MANAGER;
        self.x
            .change_property8(
                PropMode::REPLACE,
                self.root,
                atom,
                AtomEnum::STRING,
                text.as_bytes(),
            )
            .unwrap();
        self.x.sync().unwrap();
    }

    fn text(&self, window: u32, property: &str) -> Option<Vec<u8>> {
        let property = self.atom(property);
        let cookie = self
            .x
            .get_property(false, window, property, AtomEnum::ANY, 0, 1 << 20)
            .unwrap();
        cookie.reply().ok().map(|reply| reply.value)
    }

    fn fake(&self, kind: u8, detail: u8, (x, y): (i16, i16)) {
        self.x
            .xtest_fake_input(kind, detail, 0, self.root, x, y, 0)
            .unwrap();
        self.x.sync().unwrap();
    }

    /// The key of a sign, and whether it takes Shift.
    fn key_code(&self, name: &str) -> (u8, bool) {
        let wanted = keysym(name);
        let setup = self.x.setup();
        let (first, count) = (setup.min_keycode, setup.max_keycode - setup.min_keycode + 1);
        let map = self
            .x
            .get_keyboard_mapping(first, count)
            .unwrap()
            .reply()
            .unwrap();
        let per_key = usize::from(map.keysyms_per_keycode);
        for level in 0..2 {
            for (index, symbols) in map.keysyms.chunks(per_key).enumerate() {
                if symbols.get(level) == Some(&wanted) {
                    return (first + index as u8, level == 1);
                }
            }
        }
        panic!("no key prints {name}")
    }

    fn press(&self, name: &str, is_down: bool) {
        let (code, _) = self.key_code(name);
        let kind = if is_down {
            KEY_PRESS_EVENT
        } else {
            KEY_RELEASE_EVENT
        };
        self.fake(kind, code, (0, 0));
    }
}

/// A running window with its place on the screen.
pub(crate) struct Window<'d> {
    display: &'d Display,
    pub(crate) process: Child,
    id: u32,
}

impl Drop for Window<'_> {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl<'d> Window<'d> {
    pub(crate) fn open(display: &'d Display, arguments: &[&str]) -> Self {
        Self::open_in(display, Path::new("."), arguments)
    }

    pub(crate) fn open_in(display: &'d Display, folder: &Path, arguments: &[&str]) -> Self {
        let mut command = display.surfel(arguments);
        command.current_dir(folder);
        Self::start(display, command)
    }

    /// Starts a window that shows whole frames of one sample, with which most tests compare it, unless the command says otherwise.
    pub(crate) fn start(display: &'d Display, mut command: Command) -> Self {
        let says = |command: &Command, option: &str| command.get_args().any(|word| word == option);
        if !says(&command, "--smooth") {
            command.args(["--smooth", "off"]);
        }
        // Windows with settings of their own are as these say.
        let has_settings = (command.get_envs())
            .any(|(key, value)| key == "SURFEL_CONFIG" && value.is_some_and(|v| !v.is_empty()));
        if !has_settings && !says(&command, "--frame-ms") {
            command.args(["--frame-ms", "off"]);
        }
        let mut process = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let pid = process.id().to_ne_bytes().to_vec();
        let id = wait_for("the window", || {
            if let Some(status) = process.try_wait().unwrap() {
                let mut text = String::new();
                let mut err = process.stderr.take().unwrap();
                err.read_to_string(&mut text).unwrap();
                panic!("ended before its window came, {status}: {text}");
            }
            let tree = display.x.query_tree(display.root).unwrap().reply().unwrap();
            tree.children.into_iter().find(|&id| {
                let is_seen = display
                    .x
                    .get_window_attributes(id)
                    .unwrap()
                    .reply()
                    .is_ok_and(|a| a.map_state == MapState::VIEWABLE);
                is_seen && display.text(id, "_NET_WM_PID") == Some(pid.clone())
            })
        });
        // There is no window manager that would do it.
        display
            .x
            .set_input_focus(InputFocus::PARENT, id, x11rb::CURRENT_TIME)
            .unwrap();
        display.x.sync().unwrap();
        Self {
            display,
            process,
            id,
        }
    }

    pub(crate) fn title(&self) -> String {
        let text = self.display.text(self.id, "_NET_WM_NAME");
        String::from_utf8_lossy(&text.unwrap_or_default()).into_owned()
    }

    pub(crate) fn wait_for_title(&self, part: &str) -> String {
        let mut title = String::new();
        let start = Instant::now();
        while start.elapsed() < HANG {
            title = self.title();
            if title.contains(part) {
                return title;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("waited in vain for a title with {part:?}; it is {title:?}")
    }

    /// Presses and releases a key; `Control+c` and the like hold the first one.
    pub(crate) fn key(&self, name: &str) {
        let (held, key) = match name.split_once('+') {
            Some((held, key)) if !key.is_empty() => (Some(held), key),
            _ => (None, name),
        };
        let (_, takes_shift) = self.display.key_code(key);
        let held = held.or(takes_shift.then_some("Shift"));
        if let Some(name) = held {
            self.hold(name);
        }
        self.hold(key);
        self.release(key);
        if let Some(name) = held {
            self.release(name);
        }
    }

    pub(crate) fn hold(&self, name: &str) {
        self.display.press(name, true);
    }

    pub(crate) fn release(&self, name: &str) {
        self.display.press(name, false);
    }

    /// Moves the cursor to a pixel of the window.
    pub(crate) fn move_to(&self, x: i16, y: i16) {
        let display = self.display;
        let cookie = display
            .x
            .translate_coordinates(self.id, display.root, x, y)
            .unwrap();
        let at = cookie.reply().unwrap();
        display.fake(MOTION_NOTIFY_EVENT, 0, (at.dst_x, at.dst_y));
    }

    pub(crate) fn button(&self, button: u8, is_down: bool) {
        let kind = if is_down {
            BUTTON_PRESS_EVENT
        } else {
            BUTTON_RELEASE_EVENT
        };
        self.display.fake(kind, button, (0, 0));
    }

    pub(crate) fn click(&self, x: i16, y: i16) {
        self.move_to(x, y);
        self.button(1, true);
        self.button(1, false);
    }

    /// Drags with the left button over these pixels.
    pub(crate) fn drag(&self, way: &[(i16, i16)]) {
        self.move_to(way[0].0, way[0].1);
        self.button(1, true);
        for &(x, y) in &way[1..] {
            self.move_to(x, y);
        }
        self.button(1, false);
    }

    pub(crate) fn resize(&self, width: u32, height: u32) {
        let size = ConfigureWindowAux::new().width(width).height(height);
        self.display.x.configure_window(self.id, &size).unwrap();
        self.display.x.sync().unwrap();
    }

    /// Minimises the window as a window manager does, or brings it back: its state is told, and it is unmapped.
    pub(crate) fn minimise(&self, is_minimised: bool) {
        let x = &self.display.x;
        let state = self.display.atom("WM_STATE");
        // ICCCM 4.1.3.1: 3 is iconic, 1 normal; then the icon window.
        let value = [if is_minimised { 3 } else { 1 }, 0];
        x.change_property32(PropMode::REPLACE, self.id, state, state, &value)
            .unwrap();
        if is_minimised {
            x.unmap_window(self.id).unwrap();
        } else {
            x.map_window(self.id).unwrap();
        }
        x.sync().unwrap();
        if !is_minimised {
            wait_for("the window to be seen again", || {
                let attributes = x.get_window_attributes(self.id).unwrap().reply().unwrap();
                (attributes.map_state == MapState::VIEWABLE).then_some(())
            });
            x.set_input_focus(InputFocus::PARENT, self.id, x11rb::CURRENT_TIME)
                .unwrap();
            x.sync().unwrap();
        }
    }

    /// Processor time that the program has taken, all threads together; none where the system does not tell.
    pub(crate) fn processor_time(&self) -> Option<Duration> {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.process.id())).ok()?;
        // proc(5): after the name in parentheses utime and stime are fields 12 and 13, in hundredths of a second.
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
        let ticks: u64 = fields[11].parse::<u64>().ok()? + fields[12].parse::<u64>().ok()?;
        Some(Duration::from_millis(10 * ticks))
    }

    pub(crate) fn size(&self) -> (u32, u32) {
        let cookie = self.display.x.get_geometry(self.id).unwrap();
        let found = cookie.reply().unwrap();
        (u32::from(found.width), u32::from(found.height))
    }

    /// What is on the screen.
    pub(crate) fn picture(&self) -> image::RgbImage {
        let (width, height) = self.size();
        let cookie = self.display.x.get_image(
            ImageFormat::Z_PIXMAP,
            self.id,
            0,
            0,
            width as u16,
            height as u16,
            u32::MAX,
        );
        let Ok(reply) = cookie.unwrap().reply() else {
            // It was resized meanwhile.
            return image::RgbImage::new(1, 1);
        };
        let pixels = reply.data.chunks_exact(4).flat_map(|p| [p[2], p[1], p[0]]);
        image::RgbImage::from_raw(width, height, pixels.collect()).unwrap()
    }

    /// Waits until the screen shows this.
    pub(crate) fn wait_for_picture(&self, what: &str, expected: &image::RgbImage) {
        wait_for(what, || (self.picture() == *expected).then_some(()));
    }

    fn message(&self, kind: &str, data: [u32; 5]) {
        let event = ClientMessageEvent::new(32, self.id, self.display.atom(kind), data);
        self.display
            .x
            .send_event(false, self.id, EventMask::NO_EVENT, event)
            .unwrap();
        self.display.x.sync().unwrap();
    }

    /// Drops a file onto the window, as a file manager does (the XDND protocol).
    pub(crate) fn drop_file(&self, path: &Path) {
        self.drop_files(&[path]);
    }

    /// Drops files onto the window together.
    pub(crate) fn drop_files(&self, paths: &[&Path]) {
        let x = &self.display.x;
        let source = x.generate_id().unwrap();
        x.create_window(
            0,
            source,
            self.display.root,
            0,
            0,
            1,
            1,
            0,
            WindowClass::INPUT_OUTPUT,
            0,
            &CreateWindowAux::new(),
        )
        .unwrap();
        let selection = self.display.atom("XdndSelection");
        let list = self.display.atom("text/uri-list");
        let copy = self.display.atom("XdndActionCopy");
        x.set_selection_owner(source, selection, x11rb::CURRENT_TIME)
            .unwrap();
        self.message("XdndEnter", [source, 5 << 24, list, 0, 0]);
        self.message("XdndPosition", [source, 0, (40 << 16) | 40, 0, copy]);
        self.message("XdndDrop", [source, 0, 0, 0, 0]);
        wait_for("the window to ask for the file", || {
            let Some(Event::SelectionRequest(asked)) = x.poll_for_event().unwrap() else {
                return None;
            };
            let lines = paths
                .iter()
                .map(|path| format!("file://{}\r\n", path.display()));
            let text: String = lines.collect();
            x.change_property8(
                PropMode::REPLACE,
                asked.requestor,
                asked.property,
                asked.target,
                text.as_bytes(),
            )
            .unwrap();
            let answer = SelectionNotifyEvent {
                response_type: SELECTION_NOTIFY_EVENT,
                sequence: 0,
                time: asked.time,
                requestor: asked.requestor,
                selection: asked.selection,
                target: asked.target,
                property: asked.property,
            };
            x.send_event(false, asked.requestor, EventMask::NO_EVENT, answer)
                .unwrap();
            x.sync().unwrap();
            Some(())
        });
    }

    /// What the clipboard holds.
    pub(crate) fn clipboard(&self) -> String {
        let x = &self.display.x;
        let asker = x.generate_id().unwrap();
        x.create_window(
            0,
            asker,
            self.display.root,
            0,
            0,
            1,
            1,
            0,
            WindowClass::INPUT_OUTPUT,
            0,
            &CreateWindowAux::new(),
        )
        .unwrap();
        let selection = self.display.atom("CLIPBOARD");
        wait_for("an owner of the clipboard", || {
            let owner = x.get_selection_owner(selection).unwrap().reply().unwrap();
            (owner.owner != 0).then_some(())
        });
        let utf8 = self.display.atom("UTF8_STRING");
        x.convert_selection(asker, selection, utf8, selection, x11rb::CURRENT_TIME)
            .unwrap();
        x.flush().unwrap();
        wait_for("the clipboard", || {
            matches!(x.poll_for_event().unwrap(), Some(Event::SelectionNotify(_))).then_some(())
        });
        let text = self.display.text(asker, "CLIPBOARD").unwrap();
        String::from_utf8(text).unwrap()
    }

    /// Waits for the program to end.
    pub(crate) fn end(mut self) -> Output {
        output_of(&mut self.process)
    }
}

/// Waits for a program with piped output, which must be little, and kills it when it hangs.
fn output_of(process: &mut Child) -> Output {
    let start = Instant::now();
    let status = loop {
        if let Some(status) = process.try_wait().unwrap() {
            break status;
        }
        if start.elapsed() > HANG {
            process.kill().unwrap();
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    let mut output = Output {
        status,
        stdout: Vec::new(),
        stderr: Vec::new(),
    };
    if let Some(mut out) = process.stdout.take() {
        out.read_to_end(&mut output.stdout).unwrap();
    }
    if let Some(mut err) = process.stderr.take() {
        err.read_to_end(&mut output.stderr).unwrap();
    }
    output
}

pub(crate) fn run(command: &mut Command) -> Output {
    let mut process = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    output_of(&mut process)
}

pub(crate) fn must_succeed(output: &Output) {
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{:?}: {text}", output.status);
}

pub(crate) fn load(path: &Path) -> image::RgbImage {
    image::open(path).unwrap().to_rgb8()
}

pub(crate) fn lit_pixels(picture: &image::RgbImage) -> usize {
    picture.pixels().filter(|p| p.0 != [0; 3]).count()
}

/// How many pixels differ; all of them where the sizes do.
pub(crate) fn changed(a: &image::RgbImage, b: &image::RgbImage) -> usize {
    if a.dimensions() != b.dimensions() {
        return usize::MAX;
    }
    a.pixels().zip(b.pixels()).filter(|(a, b)| a != b).count()
}
