//! Files: PNG, OpenEXR and NumPy, written beside their place and renamed, so none is ever half there.

use super::{Error, FloatImage, Image, unorm8};
use exr::prelude as openexr;
use openexr::WritableImage;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Names of the channels of a normal in an EXR file.
pub(super) const NORMAL_CHANNELS: [&str; 3] = ["N.X", "N.Y", "N.Z"];

impl Image {
    /// Writes the color as an opaque 8-bit RGB PNG, bytes as they are (no transfer function). The background
    /// is already in the color, so alpha would apply it twice; see [`save_coverage_png`](Self::save_coverage_png).
    ///
    /// # Errors
    /// [`Error::Write`] when the folder is missing or the file cannot be written.
    pub fn save_png(&self, path: &Path) -> Result<(), Error> {
        write_bytes(path, &self.png()?)
    }

    /// The bytes of the file that [`save_png`](Self::save_png) writes.
    ///
    /// # Errors
    /// [`Error::Missing`] for a picture of no pixels.
    pub fn png(&self) -> Result<Vec<u8>, Error> {
        let bytes: Vec<u8> = self
            .color
            .iter()
            .flat_map(|&[r, g, b, _]| [r, g, b])
            .collect();
        let size = (self.width, self.height);
        encode_png(&bytes, size, ::image::ExtendedColorType::Rgb8)
    }

    /// Writes color and coverage as an 8-bit RGBA PNG. The color is already blended with the background
    /// (premultiplied, when that is black), so most programs show such a file with wrong edges; it keeps
    /// everything for comparison.
    ///
    /// # Errors
    /// As [`save_png`](Self::save_png).
    pub fn save_png_with_coverage(&self, path: &Path) -> Result<(), Error> {
        let bytes: Vec<u8> = self.color.iter().copied().flatten().collect();
        write_png(
            path,
            &bytes,
            (self.width, self.height),
            ::image::ExtendedColorType::Rgba8,
        )
    }

    /// Writes a picture before black as an 8-bit RGBA PNG whose colors are not premultiplied, as PNG has it: each is divided by the
    /// covered fraction, and limited to white. Where nothing is everything is 0.
    ///
    /// # Errors
    /// As [`save_png`](Self::save_png).
    pub fn save_transparent_png(&self, path: &Path) -> Result<(), Error> {
        self.to_float().save_transparent_png(path)
    }

    /// Writes the covered fraction as an 8-bit grey PNG, white where covered.
    ///
    /// # Errors
    /// As [`save_png`](Self::save_png).
    pub fn save_coverage_png(&self, path: &Path) -> Result<(), Error> {
        let bytes: Vec<u8> = self.color.iter().map(|c| c[3]).collect();
        write_png(
            path,
            &bytes,
            (self.width, self.height),
            ::image::ExtendedColorType::L8,
        )
    }

    /// Writes the color as 32-bit float RGBA EXR, value / 255.
    ///
    /// # Errors
    /// As [`save_png`](Self::save_png).
    pub fn save_exr(&self, path: &Path) -> Result<(), Error> {
        self.to_float().save_exr(path)
    }

    /// Writes the depth as an EXR of the single float channel "Z": view-space distance, infinity where
    /// nothing is.
    ///
    /// # Errors
    /// [`Error::Missing`] without depth; otherwise as [`save_png`](Self::save_png).
    pub fn save_depth_exr(&self, path: &Path) -> Result<(), Error> {
        let depth = self.depth_or_missing()?.to_vec();
        write_exr(path, (self.width, self.height), vec![("Z", depth)])
    }

    /// Writes the world-space normals as an EXR of the float channels "N.X", "N.Y" and "N.Z".
    ///
    /// # Errors
    /// [`Error::Missing`] without normals; otherwise as [`save_png`](Self::save_png).
    pub fn save_normal_exr(&self, path: &Path) -> Result<(), Error> {
        if self.normal.len() != self.color.len() {
            return Err(Error::Missing { what: "normals" });
        }
        let axis = |axis: usize| self.normal.iter().map(|n| n[axis]).collect();
        let channels = (0..3).map(|i| (NORMAL_CHANNELS[i], axis(i))).collect();
        write_exr(path, (self.width, self.height), channels)
    }

    /// Writes the depth as a NumPy array, float32 of shape (height, width).
    ///
    /// # Errors
    /// [`Error::Missing`] without depth; otherwise as [`save_png`](Self::save_png).
    pub fn save_npy(&self, path: &Path) -> Result<(), Error> {
        use npyz::WriterBuilder;
        let depth = self.depth_or_missing()?;
        let shape = [u64::from(self.height), u64::from(self.width)];
        write(path, |file| {
            let mut array = npyz::WriteOptions::new()
                .default_dtype()
                .shape(&shape)
                .writer(file)
                .begin_nd()?;
            array.extend(depth.iter().copied())?;
            array.finish()
        })
    }

    fn depth_or_missing(&self) -> Result<&[f32], Error> {
        if self.depth.len() == self.color.len() {
            Ok(&self.depth)
        } else {
            Err(Error::Missing { what: "depth" })
        }
    }
}

impl FloatImage {
    /// As [`Image::save_transparent_png`].
    ///
    /// # Errors
    /// As [`Image::save_png`].
    pub fn save_transparent_png(&self, path: &Path) -> Result<(), Error> {
        write_bytes(path, &self.transparent_png()?)
    }

    /// The bytes of the file that [`save_transparent_png`](Self::save_transparent_png) writes.
    ///
    /// # Errors
    /// [`Error::Missing`] for a picture of no pixels.
    pub fn transparent_png(&self) -> Result<Vec<u8>, Error> {
        let bytes: Vec<u8> = self
            .color
            .iter()
            .flat_map(|&color| straight(color))
            .collect();
        let size = (self.width, self.height);
        encode_png(&bytes, size, ::image::ExtendedColorType::Rgba8)
    }

    /// Writes the color as 32-bit float RGBA EXR, unclamped.
    ///
    /// # Errors
    /// [`Error::Missing`] for a picture of no pixels, [`Error::Write`] when the folder is missing or the
    /// file cannot be written.
    pub fn save_exr(&self, path: &Path) -> Result<(), Error> {
        let channel = |c: usize| self.color.iter().map(|v| v[c]).collect();
        let channels = vec![
            ("R", channel(0)),
            ("G", channel(1)),
            ("B", channel(2)),
            ("A", channel(3)),
        ];
        write_exr(path, (self.width, self.height), channels)
    }
}

/// The bytes of a color that is premultiplied by its last component, when it is not.
fn straight([red, green, blue, alpha]: [f32; 4]) -> [u8; 4] {
    if alpha <= 0.0 {
        return [0; 4];
    }
    let of = |color: f32| unorm8(f64::from(color / alpha));
    [of(red), of(green), of(blue), unorm8(f64::from(alpha))]
}

/// Writes a file through a temporary one in the same folder, which takes its place when it is complete; what
/// was there before stays when anything fails. A link is followed, and what is no regular file (a device, a
/// pipe) is written in place instead of being replaced.
pub(crate) fn write(
    path: &Path,
    contents: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>,
) -> Result<(), Error> {
    let attempt = || -> io::Result<()> {
        let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        if target.is_dir() {
            return Err(io::Error::new(
                io::ErrorKind::IsADirectory,
                "it is a folder",
            ));
        }
        let fill = |file: &mut File| {
            let mut buffered = BufWriter::new(file);
            contents(&mut buffered)?;
            buffered.flush()
        };
        if target.exists() && !target.is_file() {
            return fill(&mut File::options().write(true).open(&target)?);
        }
        let folder = folder_of(&target)?;
        let mut builder = tempfile::Builder::new();
        builder.prefix(".surfel-");
        // The default is for the owner alone; a picture gets what the user's mask leaves.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut temporary = builder.tempfile_in(folder)?;
        fill(temporary.as_file_mut())?;
        temporary.persist(&target).map_err(|e| e.error)?;
        Ok(())
    };
    attempt().map_err(|source| Error::Write {
        path: path.to_owned(),
        source,
    })
}

/// The folder that a file is to be put in, which has to be there.
fn folder_of(path: &Path) -> io::Result<&Path> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if folder.is_dir() {
        Ok(folder)
    } else if folder.exists() {
        Err(io::Error::new(
            io::ErrorKind::NotADirectory,
            format!("{} is not a folder", folder.display()),
        ))
    } else {
        Err(io::Error::new(
            io::ErrorKind::NotFound,
            format!("the folder {} does not exist", folder.display()),
        ))
    }
}

fn write_png(
    path: &Path,
    bytes: &[u8],
    size: (u32, u32),
    color: ::image::ExtendedColorType,
) -> Result<(), Error> {
    write_bytes(path, &encode_png(bytes, size, color)?)
}

fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    write(path, |file| file.write_all(bytes))
}

fn encode_png(
    bytes: &[u8],
    (width, height): (u32, u32),
    color: ::image::ExtendedColorType,
) -> Result<Vec<u8>, Error> {
    use ::image::ImageEncoder;
    if bytes.is_empty() {
        return Err(Error::Missing { what: "pixels" });
    }
    let mut file = Vec::new();
    match ::image::codecs::png::PngEncoder::new(&mut file).write_image(bytes, width, height, color)
    {
        Ok(()) => Ok(file),
        // Memory takes everything, and the pixels are as many as the size says.
        Err(error) => unreachable!("a picture in memory: {error}"),
    }
}

fn write_exr(
    path: &Path,
    (width, height): (u32, u32),
    channels: Vec<(&str, Vec<f32>)>,
) -> Result<(), Error> {
    if width == 0 || height == 0 {
        return Err(Error::Missing { what: "pixels" });
    }
    let channels = channels
        .into_iter()
        .map(|(name, values)| openexr::AnyChannel::new(name, openexr::FlatSamples::F32(values)))
        .collect();
    let layer = openexr::Layer::new(
        (width as usize, height as usize),
        openexr::LayerAttributes::default(),
        openexr::Encoding::SMALL_LOSSLESS,
        openexr::AnyChannels::sort(channels),
    );
    let failed = |e| match e {
        openexr::Error::Io(e) => e,
        other => io::Error::other(other.to_string()),
    };
    let picture = openexr::Image::from_layer(layer);
    // The table of offsets is written last, in the beginning, where a pipe cannot go back to.
    let is_pipe = path.exists() && !path.is_file();
    write(path, |file| {
        if is_pipe {
            let mut whole = io::Cursor::new(Vec::new());
            picture.write().to_buffered(&mut whole).map_err(failed)?;
            file.write_all(whole.get_ref())
        } else {
            picture.write().to_buffered(file).map_err(failed)
        }
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    fn picture() -> Image {
        let mut image = Image::filled(5, 3, [7, 8, 9, 0]);
        for (i, c) in image.color.iter_mut().enumerate() {
            *c = [
                i as u8 * 17,
                255 - i as u8,
                (i * i) as u8,
                if i % 2 == 0 { 255 } else { 51 },
            ];
        }
        image.depth = (0..15)
            .map(|i| {
                if i == 4 {
                    f32::INFINITY
                } else {
                    0.1 + i as f32
                }
            })
            .collect();
        image.normal = (0..15)
            .map(|i| [i as f32 / 15.0, -0.25, 1.0 - i as f32])
            .collect();
        image
    }

    #[test]
    fn colors_of_what_is_half_covered_are_divided_by_that() {
        assert_eq!(straight([0.25, 0.5, 0.0, 0.5]), [128, 255, 0, 128]);
        assert_eq!(straight([0.2, 0.4, 0.6, 1.0]), [51, 102, 153, 255]);
        assert_eq!(straight([0.0, 0.0, 0.0, 0.0]), [0; 4]);
        assert_eq!(straight([0.6, 0.0, 0.0, 0.5]), [255, 0, 0, 128], "limited");
    }

    #[test]
    fn every_format_gives_back_what_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let image = picture();

        image.save_png(&at("rgb.png")).unwrap();
        let opaque: Vec<_> = image
            .color
            .iter()
            .map(|&[r, g, b, _]| [r, g, b, 255])
            .collect();
        let rgb = FloatImage::load(&at("rgb.png")).unwrap();
        assert_eq!((rgb.width, rgb.height), (5, 3));
        assert_eq!(rgb.to_image().color, opaque);

        image.save_png_with_coverage(&at("rgba.png")).unwrap();
        assert_eq!(
            FloatImage::load(&at("rgba.png")).unwrap().to_image().color,
            image.color
        );

        image.save_coverage_png(&at("a.png")).unwrap();
        let grey = FloatImage::load(&at("a.png")).unwrap().to_image();
        assert!(
            grey.color
                .iter()
                .zip(&image.color)
                .all(|(g, c)| *g == [c[3], c[3], c[3], 255])
        );

        image.save_exr(&at("color.exr")).unwrap();
        let color = FloatImage::load(&at("color.exr")).unwrap();
        assert_eq!(color.color, image.to_float().color);
        assert!(color.depth.is_empty() && color.normal.is_empty());

        image.save_depth_exr(&at("z.exr")).unwrap();
        let depth = FloatImage::load(&at("z.exr")).unwrap();
        assert_eq!(depth.depth, image.depth);
        assert_eq!(depth.color[4][3], 0.0);
        assert_eq!(depth.color[5][3], 1.0);

        image.save_normal_exr(&at("n.exr")).unwrap();
        assert_eq!(FloatImage::load(&at("n.exr")).unwrap().normal, image.normal);

        image.save_npy(&at("z.npy")).unwrap();
        let array = npyz::NpyFile::new(File::open(at("z.npy")).unwrap()).unwrap();
        assert_eq!(array.shape(), &[3, 5]);
        assert_eq!(array.order(), npyz::Order::C);
        assert_eq!(array.into_vec::<f32>().unwrap(), image.depth);

        // Nothing but the pictures is left.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 7);
    }

    #[test]
    fn the_stored_bytes_of_a_png_are_the_levels() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.png");
        picture().save_png(&path).unwrap();
        let raw = ::image::open(&path).unwrap();
        assert_eq!(raw.color(), ::image::ColorType::Rgb8);
        assert_eq!(raw.as_bytes()[3..6], [17, 254, 1]);
    }

    #[test]
    fn a_file_that_cannot_be_written_says_which_and_why() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("no such folder").join("a.png");
        let message = picture().save_png(&missing).unwrap_err().to_string();
        assert!(
            message.contains("a.png") && message.contains("does not exist"),
            "{message}"
        );

        let file = folder.path().join("file");
        std::fs::write(&file, "x").unwrap();
        let message = picture()
            .save_exr(&file.join("a.exr"))
            .unwrap_err()
            .to_string();
        assert!(message.contains("is not a folder"), "{message}");

        let message = picture().save_npy(folder.path()).unwrap_err().to_string();
        assert!(message.contains("it is a folder"), "{message}");

        let without = Image::filled(2, 2, [0; 4]);
        assert!(matches!(
            without.save_npy(&file),
            Err(Error::Missing { what: "depth" })
        ));
        assert!(matches!(
            without.save_normal_exr(&file),
            Err(Error::Missing { what: "normals" })
        ));
        assert!(matches!(
            Image::default().save_png(&file),
            Err(Error::Missing { what: "pixels" })
        ));
        assert!(matches!(
            Image::default().save_exr(&file),
            Err(Error::Missing { what: "pixels" })
        ));
        // None of these touched the file.
        assert_eq!(std::fs::read(&file).unwrap(), b"x");
    }

    #[test]
    fn a_failed_write_keeps_the_old_file_and_leaves_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("old.png");
        std::fs::write(&path, "old").unwrap();
        let result = write(&path, |file| {
            file.write_all(b"half a pic")?;
            Err(io::Error::other("disk on fire"))
        });
        assert!(result.unwrap_err().to_string().contains("disk on fire"));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_special_files_never_replaced() {
        use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (
            folder.path().join("file.png"),
            folder.path().join("link.png"),
        );
        std::fs::write(&file, "old").unwrap();
        symlink(&file, &link).unwrap();
        picture().save_png(&link).unwrap();
        assert!(link.symlink_metadata().unwrap().is_symlink());
        assert_eq!(FloatImage::load(&file).unwrap().width, 5);
        // The file may be read by whoever may read a file that the user makes in the plain way.
        let expected = {
            let plain = folder.path().join("plain");
            File::create(&plain).unwrap();
            plain.metadata().unwrap().permissions().mode()
        };
        assert_eq!(file.metadata().unwrap().permissions().mode(), expected);

        let socket = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        assert!(picture().save_png(&socket).is_err());
        assert!(socket.metadata().unwrap().file_type().is_socket());
    }

    #[test]
    fn files_that_are_no_pictures_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p");
        assert!(
            FloatImage::load(&path)
                .unwrap_err()
                .to_string()
                .contains("cannot read")
        );
        for bytes in [&b""[..], b"P6", b"a text file that is longer"] {
            std::fs::write(&path, bytes).unwrap();
            let message = FloatImage::load(&path).unwrap_err().to_string();
            assert!(message.contains("neither a PNG nor an EXR"), "{message}");
        }
        for (name, save) in [
            (
                "a.png",
                Image::save_png as fn(&Image, &Path) -> Result<(), Error>,
            ),
            ("a.exr", Image::save_exr),
        ] {
            let whole_path = folder.path().join(name);
            save(&picture(), &whole_path).unwrap();
            let whole = std::fs::read(&whole_path).unwrap();
            // The chunk that ends a PNG (12 bytes) holds no pixels; readers may do without.
            for length in 4..whole.len() - 12 {
                std::fs::write(&path, &whole[..length]).unwrap();
                assert!(
                    FloatImage::load(&path).is_err(),
                    "{name} cut to {length} of {} bytes",
                    whole.len()
                );
            }
        }
    }
}
